//! What `vergence run` does when the link to the board ends: it goes on with the last pose, and reaches the board again.

use tokio::sync::mpsc::{Receiver, Sender, channel};
use vergence_board::{Board, Continuity};
use vergence_protocol::{Request, Trigger, TriggerMark};
use vergence_rig::Rig;

use crate::cli::CommonOptions;
use crate::cmd::connect::connect_again;
use crate::cmd::reconnect::reconnect_by;
use crate::cmd::taking_options::LiveRig;
use crate::console::{Console, shown_on};
use crate::failure::Failure;
use crate::sim::Plug;

/// Pulses that may wait; the loop takes them at once.
const MARKS_KEPT: usize = 2_048;

/// How the board of a live rig is reached again.
pub struct Relink {
    common: CommonOptions,
    known: Rig,
    plug: Option<Plug>,
    continuity: Continuity,
    trigger: Option<Trigger>,
    /// The pulses of each link in turn.
    marks: Sender<TriggerMark>,
}

impl Relink {
    /// Of the board of `rig`, which is connected; with it the pulses of this link and of all that follow it. `None` of a rig without a board.
    pub fn of(rig: &mut LiveRig, common: &CommonOptions) -> Option<(Self, Option<Receiver<TriggerMark>>)> {
        let continuity = rig.board.as_ref()?.client().continuity();
        let (marks, taken) = channel(MARKS_KEPT);
        let (common, known, plug, trigger) = (common.clone(), rig.known.clone(), rig.plug.clone(), rig.trigger);
        let relink = Self { common, known, plug, continuity, trigger, marks };
        let pulses = rig.take_marks();
        let are_pulsed = pulses.is_some();
        pulses.into_iter().for_each(|pulses| relink.forward(pulses));
        Some((relink, are_pulsed.then_some(taken)))
    }

    /// Tries until the board is back, and has it fire the cameras as before. Nothing is armed, and nothing moves.
    ///
    /// # Errors
    /// A board that came back with another protocol or rig.
    pub async fn reach(&self, lost: Failure, console: Console) -> Result<Board, Failure> {
        let board = reconnect_by(async || self.connect(console).await, console, lost).await?;
        if !board.is_referenced() {
            console.warn("its axes have no reference: a line 'home' homes them");
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
            self.forward(board.client_mut().take_marks());
            board.ask(Request::SetTrigger(trigger)).await?;
        }
        Ok(board.observed(shown_on(console.progress("live"))))
    }

    /// Passes the pulses of a link on, until it ends.
    fn forward(&self, mut pulses: Receiver<TriggerMark>) {
        let marks = self.marks.clone();
        tokio::spawn(async move {
            while let Some(mark) = pulses.recv().await {
                if marks.send(mark).await.is_err() {
                    return;
                }
            }
        });
    }
}
