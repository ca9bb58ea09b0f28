//! The cable to a simulated board in this process, which can be unplugged for a while.

use std::future::pending;
use std::sync::Arc;
use std::time::Duration;

use tokio::sync::watch;
use tokio::time::{Instant, sleep_until};
use vergence_rig::Rig;

use super::{Served, Shared, spawn_until};
use crate::board::Board;
use crate::error::BoardError;
use crate::link::{Client, Continuity, LinkError, OpenWire, fresh_session};

/// A simulated board, and when its cable is unplugged. Clones are the same cable.
pub struct Plug<B> {
    board: Shared<B>,
    unplugged: Vec<[Duration; 2]>,
    /// From when on the times count; `None` before that.
    begun: Arc<watch::Sender<Option<Instant>>>,
}

impl<B> Clone for Plug<B> {
    fn clone(&self) -> Self {
        let Self { board, unplugged, begun } = self;
        Self { board: board.clone(), unplugged: unplugged.clone(), begun: Arc::clone(begun) }
    }
}

impl<B: Served + Send + 'static> Plug<B> {
    /// The cable of `board`, which is unplugged at these times after [`Self::begin`].
    #[must_use]
    pub fn new(board: Shared<B>, unplugged: Vec<[Duration; 2]>) -> Self {
        Self { board, unplugged, begun: Arc::new(watch::Sender::new(None)) }
    }

    /// The times count from now on.
    pub fn begin(&self) {
        self.begun.send_replace(Some(Instant::now()));
    }

    /// Connects; `drawn` is what the host believes of the rig.
    ///
    /// # Errors
    /// As [`Board::new`]; an unplugged cable.
    pub async fn connect(&self, drawn: Rig, lease_ms: u16, continuity: Continuity) -> Result<Board, BoardError> {
        let age = self.begun.borrow().map_or(Duration::ZERO, |begun| begun.elapsed());
        if self.unplugged.iter().any(|[from, until]| (*from..*until).contains(&age)) {
            return Err(LinkError::Closed("the simulated cable is unplugged".into()).into());
        }
        let next = self.unplugged.iter().map(|[from, _]| *from).filter(|from| *from > age).min();
        let wire = OpenWire::in_process(spawn_until(self.board.clone(), pulled(self.begun.subscribe(), next)));
        Board::new(Client::connect(wire, fresh_session()?, continuity).await?, drawn, lease_ms).await
    }
}

/// Completes at the time `from` after the beginning; never without one.
async fn pulled(mut begun: watch::Receiver<Option<Instant>>, from: Option<Duration>) {
    let begun = begun.wait_for(Option::is_some).await.ok().and_then(|begun| *begun);
    match begun.zip(from) {
        Some((begun, from)) => sleep_until(begun + from).await,
        None => pending().await,
    }
}
