//! Where the stages go while the live loop measures.

use std::future::pending;
use std::time::Duration;

use vergence_board::Board;
use vergence_rig::{Mode, Rig};

use crate::cmd::stage_pose::named_mode;
use crate::failure::Failure;
use crate::interrupt::{armed, interrupted};

/// Where the stages go meanwhile.
#[derive(Debug, clap::Args)]
pub struct Options {
    /// Finds the reference of all axes first.
    #[arg(long)]
    home: bool,
    /// The mode to move to while measuring; several are visited in turn. Without it nothing moves.
    #[arg(long, value_name = "NAME")]
    mode: Vec<String>,
    /// Time in each mode before the next.
    #[arg(long, value_name = "TIME", default_value = "2s", value_parser = humantime::parse_duration)]
    stay: Duration,
}

/// Checked options: the modes are those of a rig.
pub struct Tour {
    home: bool,
    modes: Vec<Mode>,
    stay: Duration,
}

impl Options {
    /// The modes of `rig` that the options name.
    ///
    /// # Errors
    /// A mode that the rig does not have.
    pub fn read(&self, rig: &Rig) -> Result<Tour, Failure> {
        let modes = self.mode.iter().map(|name| named_mode(rig, name).cloned()).collect::<Result<_, _>>()?;
        Ok(Tour { home: self.home, modes, stay: self.stay })
    }
}

impl Tour {
    /// Whether it moves anything while the loop measures.
    pub fn moves(&self) -> bool {
        !self.modes.is_empty()
    }

    /// Finds the reference, where that is asked for.
    ///
    /// # Errors
    /// Those of the board.
    pub async fn home(&self, board: &mut Board) -> Result<(), Failure> {
        if self.home { armed(board, async |board| Ok(board.home().await?)).await } else { Ok(()) }
    }

    /// Goes from mode to mode, and then stays disarmed in the last one for ever. It ends only with a failure.
    pub async fn drive(&self, board: Option<&mut Board>) -> Failure {
        let Some(board) = board.filter(|_| self.moves()) else { return pending().await };
        let driven = board.armed(interrupted(), async |board| -> Result<(), Failure> {
            for mode in &self.modes {
                board.move_to(mode.number, &mode.targets).await?;
                board.hold(Some(self.stay)).await?;
            }
            Ok(())
        });
        match driven.await {
            Err(failure) => failure,
            Ok(()) => pending().await,
        }
    }
}
