//! Where the stages go while the live loop measures.

use std::future::pending;
use std::pin::{Pin, pin};
use std::time::Duration;

use vergence_board::{Board, BoardError, LinkError};
use vergence_rig::Mode;

use crate::orders::HOME;

/// Modes that the rig visits in turn, while the live loop measures.
#[derive(Clone, Debug, Default)]
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
    /// is one, and so is a link that ended, also after the last mode. A fault that leaves an axis without its encoder is none: `warn` hears of it, and each time that `order` returns the fault
    /// is cleared and the axes are homed, after which the tour goes on.
    pub async fn drive(
        &self,
        board: Option<&mut Board>,
        interruption: impl Future<Output = ()>,
        mut order: impl AsyncFnMut(),
        mut warn: impl FnMut(String),
    ) -> BoardError {
        let Some(board) = board else { return pending().await };
        let mut interruption = pin!(interruption);
        if !self.moves() {
            return stay(board, interruption, order).await;
        }
        let (mut remaining, mut is_lost) = (&self.modes[..], false);
        loop {
            let driven = board.armed(interruption.as_mut(), async |board| -> Result<(), BoardError> {
                if is_lost {
                    board.home().await?;
                }
                while let Some((mode, later)) = remaining.split_first() {
                    board.move_to(mode.number, &mode.targets).await?;
                    board.hold(Some(self.stay)).await?;
                    remaining = later;
                }
                Ok(())
            });
            let outcome = driven.await;
            match outcome {
                Ok(()) => return watch(board).await,
                Err(BoardError::Fault(said)) if !board.client().knowledge().lost_axes().is_empty() => {
                    is_lost = true;
                    warn(format!(
                        "{said}. Nothing moves, and the images tell where it stands; a line '{HOME}' clears the fault and homes"
                    ));
                }
                Err(error) => return error,
            }
            loop {
                order().await;
                match cleared(board).await {
                    Ok(()) => break,
                    Err(refusal @ BoardError::Refused { .. }) => warn(refusal.to_string()),
                    Err(error) => return error,
                }
            }
        }
    }
}

/// Stays where the axes are. Where they have no reference, they are homed each time that `order` returns.
async fn stay(
    board: &mut Board,
    mut interruption: Pin<&mut impl Future<Output = ()>>,
    mut order: impl AsyncFnMut(),
) -> BoardError {
    loop {
        let may_home = !board.is_referenced();
        tokio::select! {
            error = watch(board) => return error,
            () = order(), if may_home => {}
        }
        let homed: Result<(), BoardError> = board.armed(interruption.as_mut(), async |board| board.home().await).await;
        if let Err(error) = homed {
            return error;
        }
    }
}

/// Waits for the end of the link. A board that is silent for a while is still there.
async fn watch(board: &mut Board) -> BoardError {
    loop {
        match board.next_pose().await {
            Ok(_) | Err(BoardError::Link(LinkError::Silent(_))) => {}
            Err(error) => return error,
        }
    }
}

/// Clears the latched fault, as the latest pose names it.
async fn cleared(board: &mut Board) -> Result<(), BoardError> {
    board.next_pose().await?;
    board.clear().await.map(drop)
}
