//! Readers beside the one who drives a board: the process that holds a serial port passes on what the board reports.
//!
//! A serial port has one reader. The driver therefore serves a Unix socket beside its port lock; followers read from it, as
//! lines of JSON, and cannot send anything to the board.

use std::io;
use std::path::PathBuf;
use std::sync::Arc;

use serde::{Deserialize, Serialize};
use tokio::io::{AsyncBufReadExt, AsyncWriteExt, BufReader, Lines};
use tokio::net::{UnixListener, UnixStream};
use tokio::sync::broadcast;
use tokio::sync::broadcast::error::RecvError;
use tokio::task::JoinHandle;
use vergence_protocol::PoseReport;

use super::error::LinkError;
use super::open::Port;
use super::port_lock::{PortLock, is_held};

/// Reports that are kept for a slow follower; it misses what is older.
const KEPT: usize = 1_024;

/// A report of the board as a follower receives it.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[non_exhaustive]
pub enum Followed {
    /// A pose.
    Pose(PoseReport),
    /// Bytes of the firmware's log.
    Log(Vec<u8>),
}

/// Passes reports on to all followers of one port, until it is dropped.
#[derive(Debug)]
pub(super) struct Broadcaster {
    reports: broadcast::Sender<Arc<str>>,
    socket: PathBuf,
    accepting: JoinHandle<()>,
}

impl Broadcaster {
    /// Listens beside the port lock.
    pub(super) fn start(lock: &PortLock) -> io::Result<Self> {
        let socket = lock.socket();
        // A driver that was killed leaves its socket behind; the lock shows that it is gone.
        match std::fs::remove_file(&socket) {
            Err(error) if error.kind() != io::ErrorKind::NotFound => return Err(error),
            _ => {}
        }
        let listener = UnixListener::bind(&socket)?;
        let (reports, _) = broadcast::channel(KEPT);
        let source = reports.clone();
        let accepting = tokio::spawn(async move {
            while let Ok((follower, _)) = listener.accept().await {
                tokio::spawn(feed(follower, source.subscribe()));
            }
        });
        Ok(Self { reports, socket, accepting })
    }

    /// Passes a report on. Costs nothing where nobody follows.
    pub(super) fn send(&self, report: impl FnOnce() -> Followed) {
        if self.reports.receiver_count() == 0 {
            return;
        }
        if let Ok(line) = serde_json::to_string(&report()) {
            // A follower that left in this instant misses nothing.
            let _ = self.reports.send(line.into());
        }
    }
}

impl Drop for Broadcaster {
    fn drop(&mut self) {
        self.accepting.abort();
        // The next driver removes it where this fails.
        let _ = std::fs::remove_file(&self.socket);
    }
}

async fn feed(mut follower: UnixStream, mut reports: broadcast::Receiver<Arc<str>>) {
    loop {
        match reports.recv().await {
            Ok(line) => {
                let sent = async { follower.write_all(line.as_bytes()).await.and(follower.write_all(b"\n").await) };
                if sent.await.is_err() {
                    return;
                }
            }
            Err(RecvError::Lagged(_)) => {}
            Err(RecvError::Closed) => return,
        }
    }
}

/// Reads the reports of a board that another vergence drives.
#[derive(Debug)]
pub struct Follower(Lines<BufReader<UnixStream>>);

impl Follower {
    /// Follows the driver of `port`; `None` where nobody drives it, or where its driver cannot be followed.
    pub async fn attach(port: &Port) -> Option<Self> {
        let Port::Serial(path) = port else { return None };
        if !is_held(path) {
            return None;
        }
        let stream = UnixStream::connect(PortLock::socket_of(path).ok()?).await.ok()?;
        Some(Self(BufReader::new(stream).lines()))
    }

    /// Waits for the next report.
    ///
    /// # Errors
    /// [`LinkError::Closed`] where the driver has let go of the port.
    pub async fn next(&mut self) -> Result<Followed, LinkError> {
        let closed = |problem: String| LinkError::Closed(problem);
        loop {
            let line = self.0.next_line().await.map_err(|error| closed(error.to_string()))?;
            let line = line.ok_or_else(|| closed("the vergence that held the port has ended".into()))?;
            // Another version may report what this one does not know.
            if let Ok(report) = serde_json::from_str(&line) {
                return Ok(report);
            }
        }
    }
}
