//! Where the stages go while the live loop measures.

use std::future::pending;
use std::time::Duration;

use vergence_board::{Board, BoardError};
use vergence_rig::Mode;

/// Modes that the rig visits in turn, while the live loop measures.
#[derive(Clone, Debug)]
pub struct Tour {
    /// The modes; without any, nothing moves.
    pub modes: Vec<Mode>,
    /// Time in each mode before the next.
    pub stay: Duration,
}

impl Tour {
    /// Whether it moves anything.
    #[must_use]
    pub fn moves(&self) -> bool {
        !self.modes.is_empty()
    }

    /// Goes from mode to mode, and then stays disarmed in the last one for ever. It ends only with an error; `interruption`
    /// is one.
    pub async fn drive(&self, board: Option<&mut Board>, interruption: impl Future<Output = ()>) -> BoardError {
        let Some(board) = board.filter(|_| self.moves()) else { return pending().await };
        let driven = board.armed(interruption, async |board| -> Result<(), BoardError> {
            for mode in &self.modes {
                board.move_to(mode.number, &mode.targets).await?;
                board.hold(Some(self.stay)).await?;
            }
            Ok(())
        });
        match driven.await {
            Err(error) => error,
            Ok(()) => pending().await,
        }
    }
}
