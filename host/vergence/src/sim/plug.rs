//! The cable to a simulated board in this process, which can be unplugged for a while.

use std::future::pending;
use std::time::Duration;

use tokio::time::{Instant, sleep_until};
use vergence_board::{Board, BoardError, Client, Continuity, LinkError, OpenWire, fresh_session, spawn_until};
use vergence_rig::Rig;

use super::SharedRig;

/// A simulated board, and when its cable is unplugged.
#[derive(Clone)]
pub struct Plug {
    board: SharedRig,
    since: Instant,
    unplugged: Vec<[Duration; 2]>,
}

impl Plug {
    /// The cable of `board`, which is unplugged at these times, counted from now.
    #[must_use]
    pub fn new(board: SharedRig, unplugged: Vec<[Duration; 2]>) -> Self {
        Self { board, since: Instant::now(), unplugged }
    }

    /// Connects; `drawn` is what the host believes of the rig.
    ///
    /// # Errors
    /// As [`Board::new`]; an unplugged cable.
    pub async fn connect(&self, drawn: Rig, lease_ms: u16, continuity: Continuity) -> Result<Board, BoardError> {
        let age = self.since.elapsed();
        if self.unplugged.iter().any(|[from, until]| (*from..*until).contains(&age)) {
            return Err(LinkError::Closed("the simulated cable is unplugged".into()).into());
        }
        let next = self.unplugged.iter().map(|[from, _]| *from).filter(|from| *from > age).min();
        let since = self.since;
        let pulled = async move {
            match next {
                Some(from) => sleep_until(since + from).await,
                None => pending().await,
            }
        };
        let wire = OpenWire::in_process(spawn_until(self.board.clone(), pulled));
        Board::new(Client::connect(wire, fresh_session()?, continuity).await?, drawn, lease_ms).await
    }
}
