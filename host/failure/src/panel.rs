//! Exit codes of errors from the panel.

use vergence_panel::PanelError;

use crate::Failure;

impl From<PanelError> for Failure {
    fn from(error: PanelError) -> Self {
        match error {
            PanelError::Listen { .. } | PanelError::OtherComputers(_) | PanelError::OnlyHere(_) => {
                Self::usage(error.to_string())
            }
            PanelError::Board(error) => error.into(),
            PanelError::Live(error) => error.into(),
            PanelError::Recording(error) => error.into(),
            _ => Self::device(error.to_string()),
        }
    }
}
