//! What verbs that run for long do when the link ends: they try again, and never go on with a motion.

use std::future::pending;
use std::path::Path;
use std::time::Duration;

use indicatif::ProgressBar;
use tokio::time::{sleep, timeout};
use vergence_board::{Board, Follower, Port, ReaderMark, describe_pose, is_held, is_wanted};
use vergence_rig::Rig;

use super::connect::{connect_quietly, connect_with, port};
use crate::cli::Globals;
use crate::console::Console;
use crate::failure::{Failure, FailureKind};
use crate::interrupt::interrupted;
use crate::rig_file;

const FIRST_WAIT: Duration = Duration::from_millis(250);
const LONGEST_WAIT: Duration = Duration::from_secs(5);

/// Behaviour when the link ends.
#[derive(Clone, Copy, Debug, clap::Args)]
pub struct Persistence {
    /// Ends when the link ends, instead of trying to reach the board again.
    #[arg(long)]
    no_reconnect: bool,
}

impl Persistence {
    /// Whether to try again after `failure`.
    pub fn survives(self, failure: &Failure) -> bool {
        !self.no_reconnect && failure.kind() == FailureKind::Link
    }
}

/// How long a verb listens to the board, and what it does when the link ends.
#[derive(Clone, Copy, Debug, clap::Args)]
pub struct Listening {
    /// Stops after this time.
    #[arg(long = "for", value_name = "TIME", value_parser = humantime::parse_duration)]
    duration: Option<Duration>,
    #[command(flatten)]
    persistence: Persistence,
}

/// Where a verb that only reads gets the board's reports from.
pub enum Source<'a> {
    /// The board itself.
    Board(&'a mut Board),
    /// The process that drives the board, and the rig.
    Driver(&'a mut Follower, &'a Rig),
}

/// Time between two looks at whether a driver wants the port.
const LOOK: Duration = Duration::from_millis(50);
/// Longest wait for a driver to take the port that was left to it.
const HANDOVER: Duration = Duration::from_secs(2);

impl Listening {
    /// Has `listen` read the board's reports until it has read enough, the time is over or Ctrl-C is pressed. Where another
    /// vergence drives the board, the reports come from that one; a driver that wants the port gets it. When the link ends,
    /// `listen` goes on with the board that came back.
    ///
    /// # Errors
    /// Those of `listen`, of connecting, and of [`reconnect`].
    pub async fn to(
        self,
        globals: &Globals,
        console: Console,
        listen: impl AsyncFnMut(Source<'_>) -> Result<(), Failure>,
    ) -> Result<(), Failure> {
        let forever = Duration::from_secs(u64::from(u32::MAX));
        let listening = self.persistently(globals, console, listen);
        tokio::select! {
            outcome = timeout(self.duration.unwrap_or(forever), listening) => outcome.unwrap_or(Ok(())),
            () = interrupted() => Ok(()),
        }
    }

    async fn persistently(
        self,
        globals: &Globals,
        console: Console,
        mut listen: impl AsyncFnMut(Source<'_>) -> Result<(), Failure>,
    ) -> Result<(), Failure> {
        let rig = rig_file::load(globals.rig.as_deref())?;
        let port = port(globals)?;
        let (mut lost, mut was_connected) = (None, false);
        loop {
            if let Some(mut driver) = Follower::attach(&port).await {
                was_connected = true;
                match listen(Source::Driver(&mut driver, &rig)).await {
                    // The driver has ended: the port is free, or another one takes it.
                    Err(ended) if ended.kind() == FailureKind::Link => sleep(LOOK).await,
                    outcome => return outcome,
                }
                continue;
            }
            let device = match &port {
                Port::Serial(path) => Some(path.as_path()),
                _ => None,
            };
            // While this is held, drivers know that the port may be had.
            let _mark = device.and_then(ReaderMark::set);
            let connected = match lost.take() {
                Some(lost) => reconnect(globals, console, lost).await,
                None => connect_quietly(globals, console).await,
            };
            let mut board = match connected {
                Ok(board) => board,
                // A driver was quicker, or holds the port without passing anything on, as an update does.
                Err(_) if was_connected && device.is_some_and(is_held) => continue,
                Err(failure) => return Err(failure),
            };
            was_connected = true;
            tokio::select! {
                outcome = listen(Source::Board(&mut board)) => match outcome {
                    Err(ended) if self.persistence.survives(&ended) => lost = Some(ended),
                    outcome => return outcome,
                },
                () = wanted(device) => {
                    board.close().await;
                    leave_to_driver(&port).await;
                }
            }
        }
    }
}

/// Completes when a driver wants the serial device `port`; never for other ports.
async fn wanted(port: Option<&Path>) {
    let Some(port) = port else { return pending().await };
    while !is_wanted(port) {
        sleep(LOOK).await;
    }
}

/// Waits until the driver that wants the port has it.
async fn leave_to_driver(port: &Port) {
    let waited = async {
        while Follower::attach(port).await.is_none() {
            sleep(LOOK).await;
        }
    };
    // A driver that gave up leaves the port to this reader again.
    let _ = timeout(HANDOVER, waited).await;
}

/// Tries until the board is back, with twice the wait after each attempt, and says so.
///
/// # Errors
/// A board that came back with another protocol or rig.
pub async fn reconnect(globals: &Globals, console: Console, lost: Failure) -> Result<Board, Failure> {
    let mut wait = FIRST_WAIT;
    let mut told = lost;
    console.warn(format!("{told}\ntrying to reach it again; Ctrl-C ends this"));
    loop {
        sleep(wait).await;
        wait = LONGEST_WAIT.min(2 * wait);
        match connect_with(globals, ProgressBar::hidden()).await {
            Ok(board) => {
                console.warn(format!("connected again: {}", describe_pose(board.rig(), board.pose())));
                return Ok(board);
            }
            Err(failure) if matches!(failure.kind(), FailureKind::Device | FailureKind::Link) => {
                if failure != told {
                    console.warn(&failure);
                    told = failure;
                }
            }
            Err(failure) => return Err(failure),
        }
    }
}
