//! Carries out the orders of the page that drives, as the verbs of the command line do: armed under a lease, by the board's planner, and
//! disarmed afterwards.

use std::cell::Cell;
use std::convert::Infallible;
use std::future::pending;
use std::sync::Arc;
use std::time::Duration;

use tokio::sync::mpsc::Receiver;
use tokio::time::{MissedTickBehavior, interval};
use vergence_board::{Board, BoardError, describe_fault};
use vergence_protocol::{Request, Trigger};

use crate::board_log::read_recorder;
use crate::hub::{Given, Hub, Task, Told};
use crate::log::Level;
use crate::message::Order;

/// How often the flight recorder is read while nothing moves.
const RECORDER: Duration = Duration::from_secs(1);

/// What carries the orders of a panel out.
pub struct Driver {
    hub: Arc<Hub>,
    orders: Receiver<Given>,
    /// The event of the flight recorder that comes next.
    next_event: u32,
}

impl Driver {
    pub(crate) fn new(hub: Arc<Hub>, orders: Receiver<Given>) -> Self {
        Self { hub, orders, next_event: 0 }
    }

    /// Follows `board`, and carries orders out until the link ends. Once all axes have their reference, the camera
    /// trigger does what `trigger` says.
    ///
    /// A stop, an order that replaces another, and a page that drove and is gone or silent end a motion: the stages brake, and the board is
    /// disarmed. A fault ends it too; it stays latched until a page clears it.
    pub async fn drive(&mut self, board: &mut Board, trigger: Option<Trigger>) -> BoardError {
        match self.follow(board, trigger).await {
            Ok(never) => match never {},
            Err(error) => error,
        }
    }

    async fn follow(&mut self, board: &mut Board, mut trigger: Option<Trigger>) -> Result<Infallible, BoardError> {
        let mut recorder = interval(RECORDER);
        recorder.set_missed_tick_behavior(MissedTickBehavior::Skip);
        loop {
            if board.is_referenced() {
                if let Some(trigger) = trigger.take() {
                    board.ask(Request::SetTrigger(trigger)).await?;
                }
                self.hub.referenced.send_if_modified(|known| !std::mem::replace(known, true));
            }
            tokio::select! {
                Some(given) = self.orders.recv() => self.carry_out(board, given).await?,
                pose = board.next_pose() => {
                    pose?;
                }
                _ = recorder.tick() => read_recorder(&self.hub, board, &mut self.next_event).await?,
            }
        }
    }

    /// Refuses the next order: there is no board, and what is ordered now must not move it when it is back.
    pub(crate) async fn refuse(&mut self) {
        // The hub keeps the sender.
        let Some(Given { told, .. }) = self.orders.recv().await else { return pending().await };
        let said = "there is no link to the board: the order is refused, and not kept for later";
        self.hub.note(Level::Warning, said);
        tell(told, Err(said.to_owned()));
    }

    /// Carries out an order, and those that replace it.
    async fn carry_out(&mut self, board: &mut Board, given: Given) -> Result<(), BoardError> {
        let mut next = Some(given);
        while let Some(Given { order, halts, told }) = next.take() {
            if *self.hub.halts.borrow() != halts {
                let said = "an order was taken back by the stop that followed it";
                self.hub.note(Level::Note, said);
                tell(told, Err(said.to_owned()));
                continue;
            }
            let outcome = match order {
                Order::Clear => self.clear(board).await,
                Order::Home => self.move_by(board, &Order::Home, halts, &mut next).await,
                Order::Go { .. } => self.move_by(board, &order, halts, &mut next).await,
            };
            self.hub.set_task(Task::default());
            match outcome {
                Ok(said) => {
                    self.hub.note(Level::Note, &said);
                    tell(told, Ok(said));
                }
                Err(error @ (BoardError::Link(_) | BoardError::Open(_))) => return Err(error),
                Err(BoardError::Interrupted) => {
                    let said = "the stages have braked, and the board is disarmed";
                    self.hub.note(Level::Note, said);
                    tell(told, Err(format!("stopped: {said}")));
                }
                Err(error) => {
                    self.hub.note(Level::Error, &error.to_string());
                    tell(told, Err(error.to_string()));
                }
            }
        }
        Ok(())
    }

    /// Moves until it is done, stopped, or replaced by the order that is then in `next`.
    async fn move_by(
        &mut self,
        board: &mut Board,
        order: &Order,
        halts: u64,
        next: &mut Option<Given>,
    ) -> Result<String, BoardError> {
        let (text, targets) = match order {
            Order::Go { to, targets, .. } => (format!("to {to}"), Some(targets.clone())),
            _ => ("homing".to_owned(), None),
        };
        self.hub.set_task(Task { text: Some(text.clone()), targets });
        self.hub.note(Level::Note, &text);
        let replaced = Cell::new(None);
        let mut stops = self.hub.halts.subscribe();
        let orders = &mut self.orders;
        let interruption = async {
            tokio::select! {
                // The hub keeps the sender: it is not closed.
                _ = stops.wait_for(|count| *count != halts) => {}
                Some(given) = orders.recv() => replaced.set(Some(given)),
            }
        };
        let outcome = board.armed(interruption, async |board| match order {
            Order::Go { mode, targets, .. } => board.move_to(*mode, targets).await,
            _ => board.home().await,
        });
        let outcome = outcome.await;
        *next = replaced.take();
        outcome.map(|()| format!("{text}: done"))
    }

    async fn clear(&self, board: &mut Board) -> Result<String, BoardError> {
        // The latest pose names the fault.
        board.next_pose().await?;
        Ok(match board.clear().await? {
            Some(fault) => format!("cleared: {}", describe_fault(board.rig(), &fault)),
            None => "there was nothing to clear".to_owned(),
        })
    }
}

/// Tells who gave an order what became of it.
fn tell(told: Option<Told>, outcome: Result<String, String>) {
    // Whoever is gone does not want to know any more.
    let _ = told.map(|told| told.send(outcome));
}
