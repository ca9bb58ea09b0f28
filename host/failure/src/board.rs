//! Exit codes of errors from the link and the board.

use std::fmt;

use vergence_board::servos::ServoError;
use vergence_board::{
    BoardError, KeyError, LinkError, ListenError, OpenError, ProbeError, ServeError, SettingsFileError, UpdateError,
};
use vergence_protocol::Refusal;
use vergence_protocol::management::Outcome;

use crate::Failure;

impl From<LinkError> for Failure {
    fn from(error: LinkError) -> Self {
        match error {
            LinkError::Unsendable(_) => Self::device(error.to_string()),
            _ => Self::link(error.to_string()),
        }
    }
}

impl From<OpenError> for Failure {
    fn from(error: OpenError) -> Self {
        match error {
            OpenError::Simulated | OpenError::SeveralDevices(_) => Self::usage(error.to_string()),
            _ => Self::device(error.to_string()),
        }
    }
}

impl From<BoardError> for Failure {
    fn from(error: BoardError) -> Self {
        let message = error.to_string();
        match error {
            BoardError::Link(error) => error.into(),
            BoardError::Open(error) => error.into(),
            BoardError::Incompatible { .. } | BoardError::OtherAnswer(_) | BoardError::NoAxis(_) => {
                Self::protocol(message)
            }
            BoardError::AxisCount { .. } | BoardError::OtherAxis(_) | BoardError::OutOfRange { .. } => {
                Self::usage(message)
            }
            BoardError::Refused { refusal, .. } => match refusal {
                Refusal::ReadOnly => Self::protocol(message),
                Refusal::OutsideLimits { .. } | Refusal::Invalid | Refusal::BadSetting | Refusal::NoSetting => {
                    Self::usage(message)
                }
                _ => Self::device(message),
            },
            BoardError::Interrupted => Self::interrupted(message),
            _ => Self::device(message),
        }
    }
}

impl From<UpdateError> for Failure {
    fn from(error: UpdateError) -> Self {
        let message = error.to_string();
        match error {
            UpdateError::Link(_) | UpdateError::GoOnLater(_) => Self::link(message),
            UpdateError::Refused(
                Outcome::WrongHardware | Outcome::WrongLength | Outcome::TooOld | Outcome::WrongSignature,
            )
            | UpdateError::WrongHardware { .. }
            | UpdateError::TooOld { .. }
            | UpdateError::TooLong { .. }
            | UpdateError::Length => Self::usage(message),
            _ => Self::device(message),
        }
    }
}

impl From<KeyError> for Failure {
    fn from(error: KeyError) -> Self {
        match error {
            KeyError::Random(_) => Self::device(error.to_string()),
            _ => Self::usage(error.to_string()),
        }
    }
}

impl From<ServoError> for Failure {
    fn from(error: ServoError) -> Self {
        match error {
            ServoError::NoId(_) | ServoError::NoBaud(_) => Self::usage(error.to_string()),
            ServoError::Taken(_) | ServoError::Torque(_) | ServoError::Garbled(_) => Self::check(error.to_string()),
            _ => Self::device(error.to_string()),
        }
    }
}

impl From<ProbeError> for Failure {
    fn from(error: ProbeError) -> Self {
        Self::device(error.to_string())
    }
}

impl From<SettingsFileError> for Failure {
    fn from(error: SettingsFileError) -> Self {
        match error {
            SettingsFileError::Board(error) => error.into(),
            _ => Self::usage(error.to_string()),
        }
    }
}

impl From<ListenError> for Failure {
    fn from(error: ListenError) -> Self {
        Self::device(error.to_string())
    }
}

impl<E: Into<Failure> + fmt::Display> From<ServeError<E>> for Failure {
    fn from(error: ServeError<E>) -> Self {
        match error {
            ServeError::Board(error) => error.into(),
            _ => Self::device(error.to_string()),
        }
    }
}
