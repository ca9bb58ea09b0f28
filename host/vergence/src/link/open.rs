//! Opening a port: a serial device, a TCP address, or a simulated board in this process.

use std::path::{Path, PathBuf};
use std::str::FromStr;

use serialport::SerialPort;
use tokio::io::{AsyncRead, AsyncWrite};
use tokio::net::TcpStream;
use tokio_serial::SerialPortBuilderExt;

use super::port_lock::PortLock;
use crate::failure::Failure;

/// Where a board is.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Port {
    /// A serial device, such as `/dev/ttyACM0`.
    Serial(PathBuf),
    /// A TCP address, `tcp:HOST:PORT`.
    Tcp(String),
    /// A simulated board in this process, `sim`.
    Simulated,
}

impl FromStr for Port {
    type Err = std::convert::Infallible;
    fn from_str(text: &str) -> Result<Self, Self::Err> {
        Ok(match text.strip_prefix("tcp:") {
            Some(address) => Self::Tcp(address.trim_start_matches("//").to_owned()),
            None if text == "sim" => Self::Simulated,
            None => Self::Serial(text.into()),
        })
    }
}

impl std::fmt::Display for Port {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Self::Serial(path) => write!(f, "{}", path.display()),
            Self::Tcp(address) => write!(f, "tcp:{address}"),
            Self::Simulated => f.write_str("sim"),
        }
    }
}

/// A byte stream in both directions.
pub trait Wire: AsyncRead + AsyncWrite + Send + Unpin {}
impl<T: AsyncRead + AsyncWrite + Send + Unpin> Wire for T {}

/// An open stream, and the lock that goes with it.
pub struct OpenWire {
    /// The stream.
    pub stream: Box<dyn Wire>,
    /// Kept while the stream is used; a port taken without it is shared with another vergence.
    pub lock: Option<PortLock>,
    /// Bits per second of a serial line; bytes take no time on other wires.
    pub baud: Option<u32>,
}

impl OpenWire {
    /// A wire inside this process.
    #[must_use]
    pub fn in_process(stream: impl Wire + 'static) -> Self {
        Self { stream: Box::new(stream), lock: None, baud: None }
    }
}

/// Opens a serial device or TCP address. With `share`, a port that another vergence holds is opened all the same.
///
/// # Errors
/// Says which port and what to do.
pub async fn open(port: &Port, baud: u32, share: bool) -> Result<OpenWire, Failure> {
    match port {
        Port::Serial(path) => open_serial(path, baud, share),
        Port::Tcp(address) => {
            let stream = TcpStream::connect(address).await.map_err(|error| {
                Failure::device(format!(
                    "cannot reach tcp:{address}: {error}; is 'vergence sim --tcp {address}' running?"
                ))
            })?;
            // Twelve-byte heartbeats must not wait for company.
            stream.set_nodelay(true).map_err(|error| Failure::device(format!("tcp:{address}: {error}")))?;
            Ok(OpenWire { stream: Box::new(stream), lock: None, baud: None })
        }
        Port::Simulated => Err(Failure::usage("a simulated board is not opened but started")),
    }
}

fn open_serial(path: &Path, baud: u32, share: bool) -> Result<OpenWire, Failure> {
    let fail = |error: &dyn std::fmt::Display| {
        Failure::device(format!(
            "cannot open {}: {error}; run 'vergence devices' to see the ports, and check that you may read and write it",
            path.display()
        ))
    };
    let lock = PortLock::take(path).map_err(|error| fail(&error))?;
    if lock.is_none() && !share {
        return Err(Failure::device(format!("{} is in use by another vergence: let it finish first", path.display())));
    }
    let name = path.to_string_lossy();
    // Our lock does this job; the kernel's exclusive mode would keep 'vergence stop' out.
    let port = tokio_serial::new(name, baud).exclusive(false);
    let serial = port.open_native_async().map_err(|error| fail(&error))?;
    // What an earlier session left unread is not ours.
    serial.clear(serialport::ClearBuffer::Input).map_err(|error| fail(&error))?;
    Ok(OpenWire { stream: Box::new(serial), lock, baud: Some(baud) })
}
