//! Exit codes of errors from the panel.

use vergence_panel::PanelError;

use crate::Failure;

impl From<PanelError> for Failure {
    fn from(error: PanelError) -> Self {
        match error {
            PanelError::Listen { .. } => Self::usage(error.to_string()),
            _ => Self::device(error.to_string()),
        }
    }
}
