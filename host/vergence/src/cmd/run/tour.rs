//! Where the stages go while the live loop measures.

use std::future::pending;
use std::time::Duration;

use vergence_rig::{Mode, Rig};

use crate::board::Board;
use crate::cmd::move_to::named_mode;
use crate::failure::Failure;

/// What the stages do meanwhile.
#[derive(Debug, clap::Args)]
pub struct Options {
    /// Find the reference of all axes first.
    #[arg(long)]
    home: bool,
    /// Go to this mode while measuring; several, one after the other. Without it nothing moves.
    #[arg(long, value_name = "NAME")]
    mode: Vec<String>,
    /// Stay so long in each mode before the next.
    #[arg(long, value_name = "TIME", default_value = "2s", value_parser = humantime::parse_duration)]
    stay: Duration,
}

/// The same, checked.
pub struct Tour {
    home: bool,
    modes: Vec<Mode>,
    stay: Duration,
}

impl Options {
    /// The tour in `rig`.
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
        if self.home { board.armed(async |board| board.home().await).await } else { Ok(()) }
    }

    /// Goes from mode to mode, and then stays disarmed in the last one for ever. It only ends with what went wrong.
    pub async fn drive(&self, board: Option<&mut Board>) -> Failure {
        let Some(board) = board.filter(|_| self.moves()) else { return pending().await };
        let driven = board.armed(async |board| {
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
