//! Serves a simulated board on a pipe, a pseudo-terminal or TCP: the board runs at the pace of the clock while bytes go in
//! and out.

mod pace;
mod plug;
mod served;

use std::future::{pending, poll_fn};
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

pub use self::plug::Plug;
pub use self::served::{BoardGuard, Served, Shared};

/// How often the board is run. Its control ticks are exact whatever this is.
const PACE: Duration = Duration::from_millis(1);

/// The place where hosts reach a simulated board.
pub enum Listener {
    /// A pseudo-terminal. The hosts' end is held open too, so that hosts may come and go.
    Pty {
        /// The board's end.
        ours: SerialStream,
        /// The hosts' end.
        theirs: SerialStream,
        /// The path that hosts open.
        path: PathBuf,
    },
    /// A TCP port.
    Tcp(TcpListener),
}

/// Why a simulated board cannot be reached.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum ListenError {
    /// No pseudo-terminal can be opened.
    #[error("cannot open a pseudo-terminal: {0}")]
    Pty(String),
    /// The TCP address cannot be used.
    #[error("cannot listen on {address}: {problem}; choose another address")]
    Tcp {
        /// Host and port.
        address: String,
        /// What the operating system said.
        problem: String,
    },
}

/// Why serving a simulated board ended.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum ServeError<E> {
    /// The wire or the listener failed.
    #[error("the simulated link failed: {0}")]
    Link(String),
    /// The board cannot go on.
    #[error(transparent)]
    Board(E),
}

impl Listener {
    /// Opens a pseudo-terminal.
    ///
    /// # Errors
    /// [`ListenError::Pty`] where the system has none left.
    pub fn pty() -> Result<Self, ListenError> {
        let fail = |error: &dyn std::fmt::Display| ListenError::Pty(error.to_string());
        let (ours, mut theirs) = SerialStream::pair().map_err(|error| fail(&error))?;
        // It is only kept open here; hosts use it.
        theirs.set_exclusive(false).map_err(|error| fail(&error))?;
        let path = theirs.name().ok_or_else(|| fail(&"it has no name"))?.into();
        Ok(Self::Pty { ours, theirs, path })
    }

    /// Listens on a TCP address; port 0 takes a free one.
    ///
    /// # Errors
    /// [`ListenError::Tcp`] where the address cannot be used.
    pub async fn tcp(address: &str) -> Result<Self, ListenError> {
        let listener = TcpListener::bind(address)
            .await
            .map_err(|error| ListenError::Tcp { address: address.into(), problem: error.to_string() })?;
        Ok(Self::Tcp(listener))
    }

    /// The name of this place as `--port` takes it.
    ///
    /// # Errors
    /// The operating system's error where a socket has no address.
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
/// [`ServeError`] with the board's or the listener's error.
pub async fn serve<B: Served>(board: Shared<B>, listener: Listener) -> Result<(), ServeError<B::Error>> {
    let fail = |error: io::Error| ServeError::Link(error.to_string());
    match listener {
        Listener::Pty { mut ours, theirs: _kept_open, .. } => {
            let ended = run_board(&board, &mut ours, |wire| wire.baud_rate().ok()).await;
            board.lock().settle().map_err(ServeError::Board)?;
            ended.map_err(fail)
        }
        Listener::Tcp(listener) => loop {
            // The board keeps running between two hosts: its lease runs out, and a move brakes.
            let mut pace = ticks();
            let mut stream = loop {
                tokio::select! {
                    accepted = listener.accept() => break accepted.map_err(fail)?.0,
                    _ = pace.tick() => board.lock().run_to_now(),
                }
                // No host is there to read it.
                board.lock().take_output();
                board.lock().settle().map_err(ServeError::Board)?;
            };
            // A host that goes away is not a failure of the simulator.
            let _ = run_board(&board, &mut stream, |_| None).await;
            board.lock().settle().map_err(ServeError::Board)?;
        },
    }
}

/// Starts the board inside this process and returns the host's end of its wire.
#[must_use]
pub fn spawn_in_process<B: Served + Send + 'static>(board: Shared<B>) -> DuplexStream {
    spawn_until(board, pending())
}

/// As [`spawn_in_process`], on a wire that is pulled out when `pulled` completes. Then nobody runs the board but who else shares it.
fn spawn_until<B: Served + Send + 'static>(
    board: Shared<B>,
    pulled: impl Future<Output = ()> + Send + 'static,
) -> DuplexStream {
    let (host_end, mut board_end) = tokio::io::duplex(1 << 16);
    tokio::spawn(async move {
        // What the board said while no host was there to read it.
        board.lock().take_output();
        tokio::select! {
            // Ends when the host drops its end of the pipe.
            _ = run_board(&board, &mut board_end, |_| None) => {}
            () = pulled => {}
        }
    });
    host_end
}

fn ticks() -> tokio::time::Interval {
    let mut pace = interval(PACE);
    pace.set_missed_tick_behavior(MissedTickBehavior::Skip);
    pace
}

/// Runs the board on `wire` until that ends. `baud` is the speed that the host has given its end, where it has one.
async fn run_board<B: Served, W: AsyncRead + AsyncWrite + Unpin>(
    board: &Shared<B>,
    wire: &mut W,
    baud: impl Fn(&W) -> Option<u32>,
) -> io::Result<()> {
    let mut pace = ticks();
    let mut input = [0; 1024];
    loop {
        tokio::select! {
            read = wire.read(&mut input) => {
                let length = read?;
                if length == 0 {
                    return Ok(());
                }
                let mut board = board.lock();
                board.run_to_now();
                if let Some(baud) = baud(wire) {
                    board.hear_at(baud);
                }
                board.receive(input.get(..length).unwrap_or_default());
            }
            _ = pace.tick() => board.lock().run_to_now(),
        }
        let output = board.lock().take_output();
        board.lock().settle().map_err(io::Error::other)?;
        write_or_drop(wire, &output).await?;
    }
}

/// Writes as much as the wire takes at once and drops the rest, as a UART does not wait for its reader.
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
