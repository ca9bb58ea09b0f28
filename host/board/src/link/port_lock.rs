//! Advisory locks, so that one vergence at a time uses a serial port, and readers make way for a driver.
//!
//! The locks are on files named after the device, not on the device itself: `vergence stop` must be able to open a port that
//! another vergence holds.

use std::fs::{File, TryLockError};
use std::io;
use std::path::{Path, PathBuf};

/// The lock of one serial port. It is freed when this value is dropped or the process ends.
#[derive(Debug)]
pub struct PortLock {
    _file: File,
    socket: PathBuf,
}

impl PortLock {
    /// Locks the serial device `port`; `None` where another vergence holds it.
    ///
    /// # Errors
    /// The operating system's error where the lock file cannot be made or locked.
    pub fn take(port: &Path) -> io::Result<Option<Self>> {
        let socket = Self::socket_of(port)?;
        Ok(lock(port, "lock")?.map(|_file| Self { _file, socket }))
    }

    /// The socket at which the holder of this lock passes on what the board reports.
    pub(super) fn socket(&self) -> PathBuf {
        self.socket.clone()
    }

    /// The socket beside the lock of `port`.
    pub(super) fn socket_of(port: &Path) -> io::Result<PathBuf> {
        beside(port, "sock")
    }
}

/// Marks a holder of a port that only reads and makes way for a driver.
#[derive(Debug)]
pub struct ReaderMark {
    _file: File,
}

impl ReaderMark {
    /// Marks this process as a reader of `port`; `None` where another one is marked, or the file cannot be made.
    #[must_use]
    pub fn set(port: &Path) -> Option<Self> {
        lock(port, "reader").ok().flatten().map(|_file| Self { _file })
    }

    /// Whether the holder of `port` only reads.
    pub(super) fn is_set(port: &Path) -> bool {
        matches!(lock(port, "reader"), Ok(None))
    }
}

/// The wish of a driver that the reader of a port makes way.
#[derive(Debug)]
pub(super) struct Wish {
    _file: File,
}

impl Wish {
    /// Asks the reader of `port` to make way, as long as the value lives.
    pub(super) fn express(port: &Path) -> Option<Self> {
        lock(port, "wish").ok().flatten().map(|_file| Self { _file })
    }
}

/// Whether a process holds the lock of the serial device `port`.
#[must_use]
pub fn is_held(port: &Path) -> bool {
    matches!(lock(port, "lock"), Ok(None))
}

/// Whether a driver wants a port of which this process is the reader.
#[must_use]
pub fn is_wanted(port: &Path) -> bool {
    matches!(lock(port, "wish"), Ok(None))
}

/// The path of a file beside the lock of a serial device.
fn beside(port: &Path, extension: &str) -> io::Result<PathBuf> {
    // A device may have several names, such as links under /dev/serial/by-id.
    let device = port.canonicalize()?;
    let name = device.to_string_lossy().replace('/', "-");
    Ok(std::env::temp_dir().join(format!("vergence{name}.{extension}")))
}

/// Locks a file beside the device; `None` where another process has it.
fn lock(port: &Path, extension: &str) -> io::Result<Option<File>> {
    let path = beside(port, extension)?;
    // A lock file of another user can only be opened for reading, which is enough to lock it.
    let file = File::open(&path).or_else(|_| File::create(&path))?;
    match file.try_lock() {
        Ok(()) => Ok(Some(file)),
        Err(TryLockError::WouldBlock) => Ok(None),
        Err(TryLockError::Error(error)) => Err(error),
    }
}
