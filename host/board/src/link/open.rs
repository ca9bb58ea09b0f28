//! Opening a port: a serial device, a TCP address, or a simulated board in this process.

use std::path::{Path, PathBuf};
use std::str::FromStr;
use std::time::Duration;

use serialport::SerialPort;
use tokio::io::{AsyncRead, AsyncWrite};
use tokio::net::TcpStream;
use tokio::time::{Instant, sleep};
use tokio_serial::SerialPortBuilderExt;

use super::error::OpenError;
use super::port_lock::{PortLock, ReaderMark, Wish};

/// The place where a board can be reached.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Port {
    /// A serial device, such as `/dev/ttyACM0`.
    Serial(PathBuf),
    /// A TCP address, `tcp:HOST:PORT`.
    Tcp(String),
    /// A simulated board in this process: `sim` for the controller without a chip, `sim:FIRMWARE` for this firmware, an ELF file or a signed
    /// image, on a simulated chip.
    Simulated(Option<PathBuf>),
}

impl FromStr for Port {
    type Err = std::convert::Infallible;
    fn from_str(text: &str) -> Result<Self, Self::Err> {
        Ok(match text.strip_prefix("tcp:") {
            Some(address) => Self::Tcp(address.trim_start_matches("//").to_owned()),
            None if text == "sim" => Self::Simulated(None),
            None => match text.strip_prefix("sim:") {
                Some(firmware) => Self::Simulated(Some(firmware.into())),
                None => Self::Serial(text.into()),
            },
        })
    }
}

impl std::fmt::Display for Port {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Self::Serial(path) => write!(f, "{}", path.display()),
            Self::Tcp(address) => write!(f, "tcp:{address}"),
            Self::Simulated(None) => f.write_str("sim"),
            Self::Simulated(Some(firmware)) => write!(f, "sim:{}", firmware.display()),
        }
    }
}

/// A byte stream in both directions.
pub trait Wire: AsyncRead + AsyncWrite + Send + Unpin {}
impl<T: AsyncRead + AsyncWrite + Send + Unpin> Wire for T {}

/// An open byte stream to a board.
pub struct OpenWire {
    /// The stream.
    pub stream: Box<dyn Wire>,
    /// The lock on a serial port, held as long as the stream is used; `None` where another vergence holds the port, and on
    /// wires that need no lock.
    pub lock: Option<PortLock>,
    /// Bits per second of a serial line; `None` where bytes take no time.
    pub baud: Option<u32>,
    /// How long the board at the other end may be silent.
    pub patience: Patience,
}

impl OpenWire {
    /// A wire inside this process.
    #[must_use]
    pub fn in_process(stream: impl Wire + 'static) -> Self {
        Self { stream: Box::new(stream), lock: None, baud: None, patience: Patience::IN_PROCESS }
    }
}

/// How long a board may be silent until its link counts as lost.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Patience {
    /// Longest wait for the next pose.
    pub pose: Duration,
    /// Longest wait for the reply to a request, retransmissions included, and for the answer to the first message.
    pub reply: Duration,
}

impl Patience {
    /// Of a board that runs by itself.
    pub const PORT: Self = Self { pose: Duration::from_secs(1), reply: Duration::from_secs(2) };
    /// Of a simulated board in this process: it runs only when a busy computer lets it, and cannot be unplugged.
    pub const IN_PROCESS: Self = Self { pose: Duration::from_secs(10), reply: Duration::from_secs(10) };
}

/// Opens a serial device at `baud` bits per second, or a TCP address. A vergence that only reads the device makes way. With
/// `share`, a device that another vergence holds is opened without a lock.
///
/// # Errors
/// [`OpenError`], which names the port and says what to do.
pub async fn open(port: &Port, baud: u32, share: bool) -> Result<OpenWire, OpenError> {
    match port {
        Port::Serial(path) => open_serial(path, baud, share).await,
        Port::Tcp(address) => {
            let stream = TcpStream::connect(address)
                .await
                .map_err(|error| OpenError::Tcp { address: address.clone(), problem: error.to_string() })?;
            // Nagle's algorithm would hold back twelve-byte heartbeats.
            stream
                .set_nodelay(true)
                .map_err(|error| OpenError::TcpOption { address: address.clone(), problem: error.to_string() })?;
            Ok(OpenWire { stream: Box::new(stream), lock: None, baud: None, patience: Patience::PORT })
        }
        Port::Simulated(_) => Err(OpenError::Simulated),
    }
}

async fn open_serial(path: &Path, baud: u32, share: bool) -> Result<OpenWire, OpenError> {
    let fail = |error: &dyn std::fmt::Display| OpenError::Serial { path: path.into(), problem: error.to_string() };
    let mut lock = PortLock::take(path).map_err(|error| fail(&error))?;
    if lock.is_none() && !share && ReaderMark::is_set(path) {
        lock = take_from_reader(path).await;
    }
    if lock.is_none() && !share {
        return Err(OpenError::InUse(path.into()));
    }
    let name = path.to_string_lossy();
    // The lock above keeps others out; the kernel's exclusive mode would keep 'vergence stop' out too.
    let port = tokio_serial::new(name, baud).exclusive(false);
    let serial = port.open_native_async().map_err(|error| fail(&error))?;
    // Bytes that an earlier session left unread belong to that session.
    serial.clear(serialport::ClearBuffer::Input).map_err(|error| fail(&error))?;
    Ok(OpenWire { stream: Box::new(serial), lock, baud: Some(baud), patience: Patience::PORT })
}

/// Longest wait for a reader to make way.
const READER_PATIENCE: Duration = Duration::from_secs(2);

/// Asks the reader of a port to make way, and takes the port once it has.
async fn take_from_reader(path: &Path) -> Option<PortLock> {
    const LOOK: Duration = Duration::from_millis(20);
    let deadline = Instant::now() + READER_PATIENCE;
    let mut wish = None;
    while Instant::now() < deadline {
        wish = wish.or_else(|| Wish::express(path));
        if let Ok(Some(lock)) = PortLock::take(path) {
            return Some(lock);
        }
        sleep(LOOK).await;
    }
    None
}
