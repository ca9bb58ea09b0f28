//! One vergence at a time on a serial port: an advisory lock on a file named after the device.
//!
//! Not on the device itself: `vergence stop` must be able to open a port that another vergence holds.

use std::fs::{File, TryLockError};
use std::io;
use std::path::Path;

/// Held as long as the port is used; the system frees it with the process.
#[derive(Debug)]
pub struct PortLock {
    _file: File,
}

impl PortLock {
    /// Takes the port; `None` where another vergence has it.
    ///
    /// # Errors
    /// The operating system's, where the file cannot be made or locked.
    pub fn take(port: &Path) -> io::Result<Option<Self>> {
        // Two names of one device are one device.
        let device = port.canonicalize()?;
        let name = device.to_string_lossy().replace('/', "-");
        let path = std::env::temp_dir().join(format!("vergence{name}.lock"));
        // Another user's file can be read, and a lock needs no more.
        let file = File::open(&path).or_else(|_| File::create(&path))?;
        match file.try_lock() {
            Ok(()) => Ok(Some(Self { _file: file })),
            Err(TryLockError::WouldBlock) => Ok(None),
            Err(TryLockError::Error(error)) => Err(error),
        }
    }
}
