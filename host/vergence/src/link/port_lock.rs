//! One vergence at a time on a serial port: an advisory lock on the device file.

use std::fs::{File, TryLockError};
use std::io;
use std::os::unix::fs::OpenOptionsExt;
use std::path::Path;

/// Held as long as the port is used.
#[derive(Debug)]
pub struct PortLock {
    _file: File,
}

impl PortLock {
    /// Takes the port; `None` where another vergence has it.
    ///
    /// # Errors
    /// The operating system's, where the file cannot be opened or locked.
    pub fn take(path: &Path) -> io::Result<Option<Self>> {
        // Neither wait for a carrier nor make the port our controlling terminal.
        const NONBLOCK_NOCTTY: i32 = 0o4000 | 0o400;
        let file = File::options().read(true).custom_flags(NONBLOCK_NOCTTY).open(path)?;
        match file.try_lock() {
            Ok(()) => Ok(Some(Self { _file: file })),
            Err(TryLockError::WouldBlock) => Ok(None),
            Err(TryLockError::Error(error)) => Err(error),
        }
    }
}
