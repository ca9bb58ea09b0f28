//! Motion: arm under a lease, home, move, stop, and clear what was latched.

use std::time::Duration;

use vergence_protocol::{
    AxisMask, ControllerState, FaultRecord, Jog, Mode, Move, MoveId, MovePhase, Permille, Request, StopKind,
};
use vergence_rig::AxisPosition;

use super::Board;
use super::words::check_range;
use crate::failure::Failure;
use crate::interrupt::interrupted;

impl Board {
    /// Arms, does `work` under a live lease, and disarms whatever became of it. Ctrl-C stops the stages first.
    ///
    /// # Errors
    /// Those of `work`; a refusal to arm; an interruption.
    pub async fn armed<T>(&mut self, work: impl AsyncFnOnce(&mut Self) -> Result<T, Failure>) -> Result<T, Failure> {
        self.client.hold_lease(self.lease_ms).await?;
        self.ask(Request::Arm { session: self.client.session() }).await?;
        let outcome = tokio::select! {
            outcome = async { self.take_hold().await?; work(self).await } => outcome,
            () = interrupted() => Err(Failure::device("interrupted: the stages were told to stop")),
        };
        let disarmed = self.release().await;
        // A latched fault cannot be disarmed; the first failure is the one to tell.
        let value = outcome?;
        disarmed.map(|()| value)
    }

    /// Waits for a pose from after the arming: from then on nobody else can move the board, and its move is the one before
    /// our next.
    async fn take_hold(&mut self) -> Result<(), Failure> {
        self.wait_until(|pose| pose.state == ControllerState::Ready).await?;
        self.latest_move = self.pose.move_id;
        Ok(())
    }

    /// Disarms and waits until the board is idle; in motion it brakes first.
    ///
    /// # Errors
    /// A refusal, or a link that ended.
    pub async fn disarm(&mut self) -> Result<(), Failure> {
        self.ask(Request::Disarm).await?;
        self.wait_until(|pose| pose.state == ControllerState::Idle).await
    }

    /// Disarms where a motion was given up in the middle: it brakes first, and no lease is held any more.
    ///
    /// # Errors
    /// A refusal, or a link that ended.
    pub async fn release(&mut self) -> Result<(), Failure> {
        let disarmed = self.disarm().await;
        self.client.hold_lease(0).await?;
        disarmed
    }

    /// Finds the reference of all axes. The board must be armed.
    ///
    /// # Errors
    /// The fault that ended it, or a refusal.
    pub async fn home(&mut self) -> Result<(), Failure> {
        let axes = AxisMask::first(self.rig.axes.len());
        self.ask(Request::Home { axes }).await?;
        // A pose that was already on its way still shows the old reference.
        self.wait_until(|pose| pose.state == ControllerState::Homing).await?;
        self.wait_until(|pose| pose.state != ControllerState::Homing && pose.referenced == axes).await
    }

    /// Moves all axes and waits until the encoders confirm it. The board must be armed.
    ///
    /// # Errors
    /// A target out of range, the fault that ended the move, a refusal, or a stop.
    pub async fn move_to(&mut self, mode: Mode, targets: &[AxisPosition]) -> Result<(), Failure> {
        check_range(&self.rig, targets)?;
        let (id, targets) = (self.next_move_id(), self.rig.wire_targets(targets));
        self.ask(Request::MoveTo(Move { id, mode, targets, speed: Permille::FULL })).await?;
        self.wait_for_move(id).await
    }

    /// Moves all axes by a distance from where they stand, and waits until the encoders confirm it. Works without
    /// reference, at homing speed. The board must be armed.
    ///
    /// # Errors
    /// The fault that ended the move, a refusal, or a stop.
    pub async fn move_by(&mut self, distances: &[AxisPosition]) -> Result<(), Failure> {
        let (id, by) = (self.next_move_id(), self.rig.wire_targets(distances));
        self.ask(Request::Jog(Jog { id, by, speed: Permille::FULL })).await?;
        self.wait_for_move(id).await
    }

    /// Another than the board's last one: a pose on its way while the move is ordered still tells of that. Zero means "no
    /// move yet".
    fn next_move_id(&mut self) -> MoveId {
        self.latest_move = MoveId(self.latest_move.0.wrapping_add(1).max(1));
        self.latest_move
    }

    async fn wait_for_move(&mut self, id: MoveId) -> Result<(), Failure> {
        self.wait_until(|pose| pose.move_id == id && matches!(pose.phase, MovePhase::Settled | MovePhase::Stopped))
            .await?;
        if self.pose.phase == MovePhase::Stopped {
            return Err(Failure::device("the move was stopped by another command: the stages stand where they are"));
        }
        Ok(())
    }

    /// Stops every motion and waits until all is at rest.
    ///
    /// # Errors
    /// Where the link ended.
    pub async fn stop(&mut self) -> Result<(), Failure> {
        self.ask(Request::Stop { kind: StopKind::Decelerate }).await?;
        let moving = [ControllerState::Moving, ControllerState::Homing, ControllerState::Stopping];
        self.wait_until(|pose| !moving.contains(&pose.state)).await
    }

    /// Stays armed for `duration`, or for ever, as long as nothing goes wrong.
    ///
    /// # Errors
    /// The fault that ended it, or a link that ended.
    pub async fn hold(&mut self, duration: Option<Duration>) -> Result<(), Failure> {
        let watched = self.wait_for(duration, |_| false).await;
        watched.unwrap_or(Ok(()))
    }

    /// Clears the latched fault and returns it; `None` where nothing is latched.
    ///
    /// # Errors
    /// A refusal, such as a cause that persists, or a link that ended.
    pub async fn clear(&mut self) -> Result<Option<FaultRecord>, Failure> {
        let Some(fault) = self.pose.fault else { return Ok(None) };
        self.ask(Request::ClearFault { seen: fault.seq }).await?;
        self.wait_until(|pose| pose.fault.is_none()).await?;
        Ok(Some(fault))
    }
}
