//! The failures with which a command can end, and their exit codes. One module for each library says which of its errors
//! means which exit code.

mod bench;
mod board;
mod calibration;
mod calibration_input;
mod camera;
mod export;
mod files;
mod live;
mod models;
mod output;
mod panel;
mod peers;
mod plausibility;
mod recording;
mod reproduce;
mod sim;

use std::fmt;
use std::path::Path;

/// Why a command did not do what it was asked. The text is a sentence: what, where, and what to do.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Failure {
    kind: FailureKind,
    message: String,
}

/// The exit codes; zero is success, and a closed output pipe is success too.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum FailureKind {
    /// 1: the work was done and its result does not pass.
    CheckFailed,
    /// 2: the command line or an input file is wrong.
    Usage,
    /// 3: the device is missing, silent, or refused.
    Device,
    /// 3: the link to the device ended; it may come back.
    Link,
    /// 3: somebody ended the command before its work was done.
    Interrupted,
    /// 4: the device speaks another protocol version.
    Protocol,
    /// 0: whoever read our output has seen enough.
    OutputClosed,
}

impl FailureKind {
    /// The process exit code.
    #[must_use]
    pub const fn exit_code(self) -> u8 {
        match self {
            Self::OutputClosed => 0,
            Self::CheckFailed => 1,
            Self::Usage => 2,
            Self::Device | Self::Link | Self::Interrupted => 3,
            Self::Protocol => 4,
        }
    }

    /// The name of the kind in JSON.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::OutputClosed => "output-closed",
            Self::CheckFailed => "check-failed",
            Self::Usage => "usage",
            Self::Interrupted => "interrupted",
            Self::Device => "device",
            Self::Link => "link",
            Self::Protocol => "protocol",
        }
    }
}

impl Failure {
    /// A result that does not pass: exit code 1.
    pub fn check(message: impl Into<String>) -> Self {
        Self { kind: FailureKind::CheckFailed, message: message.into() }
    }

    /// Wrong input: exit code 2.
    pub fn usage(message: impl Into<String>) -> Self {
        Self { kind: FailureKind::Usage, message: message.into() }
    }

    /// A device that cannot or will not: exit code 3.
    pub fn device(message: impl Into<String>) -> Self {
        Self { kind: FailureKind::Device, message: message.into() }
    }

    /// A link that ended: exit code 3.
    pub fn link(message: impl Into<String>) -> Self {
        Self { kind: FailureKind::Link, message: message.into() }
    }

    /// Work that was interrupted: exit code 3. The message says what is left and how to go on.
    pub fn interrupted(message: impl Into<String>) -> Self {
        Self { kind: FailureKind::Interrupted, message: message.into() }
    }

    /// Another protocol version: exit code 4.
    pub fn protocol(message: impl Into<String>) -> Self {
        Self { kind: FailureKind::Protocol, message: message.into() }
    }

    /// An input file that cannot be used.
    pub fn input(path: &Path, problem: impl fmt::Display) -> Self {
        Self::usage(format!("{}: {problem}", path.display()))
    }

    /// An output file that cannot be written.
    pub fn output(path: &Path, problem: impl fmt::Display) -> Self {
        Self::usage(format!("cannot write {}: {problem}", path.display()))
    }

    /// Standard output cannot be written: a closed pipe is no failure.
    #[must_use]
    pub fn stdout(error: &std::io::Error) -> Self {
        let kind = match error.kind() {
            std::io::ErrorKind::BrokenPipe => FailureKind::OutputClosed,
            _ => FailureKind::CheckFailed,
        };
        Self { kind, message: format!("cannot write to standard output: {error}") }
    }

    /// The same with `more` to say.
    #[must_use]
    pub fn and(self, more: &str) -> Self {
        Self { message: self.message + more, ..self }
    }

    /// Which exit code it means.
    #[must_use]
    pub const fn kind(&self) -> FailureKind {
        self.kind
    }
}

impl fmt::Display for Failure {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.message)
    }
}

impl std::error::Error for Failure {}
