//! Why a port cannot be opened, and why a link ends.

use std::path::PathBuf;
use std::time::Duration;

use super::open::Port;

/// Why a link ended, or a request got no answer.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum LinkError {
    /// The other end closed the link, or the cable was pulled.
    #[error(
        "the link closed ({0}): check the cable or the simulator, then try again; nothing moves until you ask again"
    )]
    Closed(String),
    /// Nothing arrived.
    #[error("no answer within {0:?}: is this the port of a vergence board, and is the board powered?")]
    Silent(Duration),
    /// Nothing arrived through a TCP connection, behind which a simulator serves one host at a time.
    #[error(
        "connected, but no answer within {0:?}: the port is in use by another vergence, or this is no vergence board; let \
         the other one finish first"
    )]
    Taken(Duration),
    /// Bytes arrived, but no valid message.
    #[error("{0} bytes arrived but no valid message: another device, or another baud rate, is on this port")]
    Noise(u32),
    /// The board restarted, or another host took the session.
    #[error("the board began anew or another host took it over: run 'vergence status'")]
    SessionLost,
    /// The request cannot be sent now.
    #[error("the request cannot be sent: {0}")]
    Unsendable(String),
}

impl LinkError {
    /// This error where it came from `port`: what answers nothing behind TCP is taken.
    pub(super) fn behind(self, port: &Port) -> Self {
        match (port, self) {
            (Port::Tcp(_), Self::Silent(patience)) => Self::Taken(patience),
            (_, error) => error,
        }
    }
}

/// Why a port cannot be opened.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum OpenError {
    /// The serial device cannot be opened.
    #[error(
        "cannot open {}: {problem}; run 'vergence devices' to see the ports, and check that you may read and write it",
        path.display()
    )]
    Serial {
        /// The device.
        path: PathBuf,
        /// What the operating system said.
        problem: String,
    },
    /// Another vergence holds the serial device.
    #[error("{} is in use by another vergence: let it finish first", .0.display())]
    InUse(PathBuf),
    /// Nobody listens at the TCP address.
    #[error("cannot reach tcp:{address}: {problem}; is 'vergence sim --tcp {address}' running?")]
    Tcp {
        /// Host and port.
        address: String,
        /// What the operating system said.
        problem: String,
    },
    /// The TCP stream was opened but cannot be set up.
    #[error("tcp:{address}: {problem}")]
    TcpOption {
        /// Host and port.
        address: String,
        /// What the operating system said.
        problem: String,
    },
    /// A stop cannot be sent.
    #[error("the stop cannot be sent: {0}")]
    NoStop(String),
    /// The port was opened, and its board does not answer or cannot be written to.
    #[error("{port}: {why}")]
    Unanswered {
        /// The port.
        port: Port,
        /// Why the link did not begin, and what to do.
        why: String,
    },
    /// A simulated board lives in this process and has no port.
    #[error("a simulated board is not opened but started")]
    Simulated,
    /// The operating system does not list the serial ports.
    #[error("cannot list the serial ports: {0}")]
    List(String),
    /// No port is named, and none looks like a board; these others are there.
    #[error("no serial device found on USB{}: connect the board, or {CHOICE}", not_tried(.0))]
    NoDevice(Vec<String>),
    /// No port is named, and several look like a board.
    #[error("several serial devices found ({}): {CHOICE}", .0.join(", "))]
    SeveralDevices(Vec<String>),
    /// No random numbers for a session id.
    #[error("the operating system gives no random numbers: {0}")]
    Random(String),
}

/// What to do where the port is not clear.
const CHOICE: &str = "name one with --port, or run a simulated board with 'vergence sim --pty'";

fn not_tried(others: &[String]) -> String {
    match others {
        [] => String::new(),
        others => format!(" ({} is not tried unless named)", others.join(", ")),
    }
}
