//! Serving a simulated board: it runs at the pace of the clock while bytes go in and out.

use std::future::poll_fn;
use std::io;
use std::path::PathBuf;
use std::pin::Pin;
use std::task::Poll;
use std::time::Duration;

use serialport::SerialPort;
use tokio::io::{AsyncRead, AsyncReadExt, AsyncWrite, DuplexStream};
use tokio::net::TcpListener;
use tokio::time::{MissedTickBehavior, interval};
use tokio_serial::SerialStream;

use super::served::{Served, Shared};
use crate::failure::Failure;

/// How often the board is run; its own control tick is exact whatever this is.
const PACE: Duration = Duration::from_millis(1);

/// Where a simulated board can be reached.
pub enum Listener {
    /// A pseudo-terminal: our end, and the other end held open so that hosts may come and go.
    Pty {
        /// Our end.
        ours: SerialStream,
        /// The end that hosts open.
        theirs: SerialStream,
        /// Its path.
        path: PathBuf,
    },
    /// A TCP port.
    Tcp(TcpListener),
}

impl Listener {
    /// Opens a pseudo-terminal.
    ///
    /// # Errors
    /// Where the system has none to give.
    pub fn pty() -> Result<Self, Failure> {
        let fail = |error: &dyn std::fmt::Display| Failure::device(format!("cannot open a pseudo-terminal: {error}"));
        let (ours, mut theirs) = SerialStream::pair().map_err(|error| fail(&error))?;
        // We only keep it open; hosts shall use it.
        theirs.set_exclusive(false).map_err(|error| fail(&error))?;
        let path = theirs.name().ok_or_else(|| fail(&"it has no name"))?.into();
        Ok(Self::Pty { ours, theirs, path })
    }

    /// Listens on a TCP address.
    ///
    /// # Errors
    /// Where the address cannot be had.
    pub async fn tcp(address: &str) -> Result<Self, Failure> {
        let listener = TcpListener::bind(address)
            .await
            .map_err(|error| Failure::device(format!("cannot listen on {address}: {error}; choose another address")))?;
        Ok(Self::Tcp(listener))
    }

    /// What to give to `--port`.
    ///
    /// # Errors
    /// The operating system's.
    pub fn port(&self) -> io::Result<String> {
        Ok(match self {
            Self::Pty { path, .. } => path.display().to_string(),
            Self::Tcp(listener) => format!("tcp:{}", listener.local_addr()?),
        })
    }
}

/// Serves the board until it or the listener fails.
///
/// # Errors
/// The board's and the listener's.
pub async fn serve<B: Served>(board: Shared<B>, listener: Listener) -> Result<(), Failure> {
    let fail = |error: io::Error| Failure::device(format!("the simulated link failed: {error}"));
    match listener {
        Listener::Pty { mut ours, theirs: _kept_open, .. } => {
            let ended = run_board(&board, &mut ours).await;
            board.lock().settle()?;
            ended.map_err(fail)
        }
        Listener::Tcp(listener) => loop {
            // Between two hosts the board goes on: a lease runs out, a move brakes.
            let mut pace = ticks();
            let mut stream = loop {
                tokio::select! {
                    accepted = listener.accept() => break accepted.map_err(fail)?.0,
                    _ = pace.tick() => board.lock().run_to_now(),
                }
                // Nobody listens.
                board.lock().take_output();
                board.lock().settle()?;
            };
            // A host that goes away is not a failure of the simulator.
            let _ = run_board(&board, &mut stream).await;
            board.lock().settle()?;
        },
    }
}

/// Starts the board inside this process and returns the host's end of its wire.
#[must_use]
pub fn spawn_in_process<B: Served + Send + 'static>(board: Shared<B>) -> DuplexStream {
    let (host_end, mut board_end) = tokio::io::duplex(1 << 16);
    tokio::spawn(async move {
        // Ends when the host drops its end.
        let _ = run_board(&board, &mut board_end).await;
    });
    host_end
}

fn ticks() -> tokio::time::Interval {
    let mut pace = interval(PACE);
    pace.set_missed_tick_behavior(MissedTickBehavior::Skip);
    pace
}

async fn run_board<B: Served, W: AsyncRead + AsyncWrite + Unpin>(board: &Shared<B>, wire: &mut W) -> io::Result<()> {
    let mut pace = ticks();
    let mut input = [0; 1024];
    loop {
        tokio::select! {
            read = wire.read(&mut input) => {
                let length = read?;
                if length == 0 {
                    return Ok(());
                }
                board.lock().receive(input.get(..length).unwrap_or_default());
            }
            _ = pace.tick() => board.lock().run_to_now(),
        }
        let output = board.lock().take_output();
        board.lock().settle().map_err(io::Error::other)?;
        write_or_drop(wire, &output).await?;
    }
}

/// A UART does not wait for its listener: what nobody takes is lost.
async fn write_or_drop<W: AsyncWrite + Unpin>(wire: &mut W, bytes: &[u8]) -> io::Result<()> {
    if bytes.is_empty() {
        return Ok(());
    }
    poll_fn(|context| match Pin::new(&mut *wire).poll_write(context, bytes) {
        Poll::Ready(result) => Poll::Ready(result.map(|_| ())),
        Poll::Pending => Poll::Ready(Ok(())),
    })
    .await
}
