//! Options for where the stages go while the live loop measures.

use std::io::BufReader;
use std::time::Duration;

use vergence_board::Board;
use vergence_live::{Tour, homing_orders};
use vergence_rig::Rig;

use crate::cmd::stage_pose::named_mode;
use crate::failure::Failure;
use crate::interrupt::armed;

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

impl Options {
    /// The modes of `rig` that the options name.
    ///
    /// # Errors
    /// A mode that the rig does not have.
    pub fn tour(&self, rig: &Rig) -> Result<Tour, Failure> {
        let modes = self.mode.iter().map(|name| named_mode(rig, name).cloned()).collect::<Result<_, _>>()?;
        Ok(Tour { modes, stay: self.stay })
    }

    /// Finds the reference, where that is asked for.
    ///
    /// # Errors
    /// Those of the board.
    pub async fn home(&self, board: &mut Board) -> Result<(), Failure> {
        if self.home { armed(board, async |board| Ok(board.home().await?)).await } else { Ok(()) }
    }
}

/// Waits for a person who orders the axes to be homed. Standard input is read only then: a job in the background must not read it.
pub fn order() -> impl AsyncFnMut() {
    let mut orders = None;
    async move || {
        let orders = orders.get_or_insert_with(|| homing_orders(BufReader::new(std::io::stdin())));
        if orders.recv().await.is_none() {
            std::future::pending::<()>().await;
        }
    }
}
