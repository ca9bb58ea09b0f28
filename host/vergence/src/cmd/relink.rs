//! What verbs that measure or record do when the link to the board ends: they go on with the last pose, and reach the board again.

use tokio::sync::mpsc::Receiver;
use vergence_board::{Board, Continuity, PulseChain};
use vergence_protocol::{Request, Trigger, TriggerMark};

use crate::cli::CommonOptions;
use crate::cmd::connect::connect_again;
use crate::cmd::reconnect::{Persistence, reconnect_by};
use crate::cmd::taking_options::LiveRig;
use crate::console::{Console, shown_on};
use crate::failure::Failure;
use crate::sim::Plug;

/// How a board is reached again.
pub struct Relink {
    common: CommonOptions,
    known: vergence_rig::Rig,
    plug: Option<Plug>,
    continuity: Continuity,
    trigger: Option<Trigger>,
    pulses: PulseChain,
}

impl Relink {
    /// Of a `board` that fires no cameras.
    pub fn of_board(board: &Board, common: &CommonOptions) -> Self {
        let (continuity, known, pulses) = (board.client().continuity(), board.rig().clone(), PulseChain::begin(None).0);
        Self { common: common.clone(), known, plug: None, continuity, trigger: None, pulses }
    }

    /// Of the board of `rig`, where `persistence` wants it; with it the pulses of this link, and of all that follow it.
    pub fn of(
        persistence: Persistence,
        rig: &mut LiveRig,
        common: &CommonOptions,
    ) -> (Option<Self>, Option<Receiver<TriggerMark>>) {
        let first = rig.take_marks();
        let Some(board) = rig.board.as_ref().filter(|_| persistence.persists()) else { return (None, first) };
        let (chain, pulses) = PulseChain::begin(first);
        let (plug, trigger) = (rig.plug.clone(), rig.trigger);
        (Some(Self { plug, trigger, pulses: chain, ..Self::of_board(board, common) }), pulses)
    }

    /// Tries until the board is back, and has it fire the cameras as before. Nothing is armed, and nothing moves.
    ///
    /// # Errors
    /// A board that came back with another protocol or rig.
    pub async fn reach(&self, lost: Failure, console: Console) -> Result<Board, Failure> {
        let board = reconnect_by(async || self.connect(console).await, console, lost).await?;
        if !board.is_referenced() {
            console.warn("its axes have no reference: home them, by a line 'home' or on the page");
        }
        Ok(board)
    }

    async fn connect(&self, console: Console) -> Result<Board, Failure> {
        let continuity = self.continuity.clone();
        let mut board = match &self.plug {
            Some(plug) => plug.connect(self.known.clone(), self.common.lease, continuity).await?,
            None => connect_again(&self.common, continuity).await?,
        };
        board.compare_clocks().await?;
        if let Some(trigger) = self.trigger {
            self.pulses.add(board.client_mut().take_marks());
            board.ask(Request::SetTrigger(trigger)).await?;
        }
        Ok(board.observed(shown_on(console.progress("live"))))
    }
}
