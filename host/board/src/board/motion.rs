//! Motion: arming under a lease, homing, moves, stops, and clearing latched faults.

use std::time::Duration;

use vergence_protocol::{
    AxisMask, ControllerState, FaultRecord, Jog, Mode, Move, MoveId, MovePhase, Permille, Request, StopKind,
};
use vergence_rig::AxisPosition;

use super::Board;
use super::ways::straight_ways;
use super::words::check_range;
use crate::error::BoardError;

impl Board {
    /// Arms, does `work` under a live lease, and disarms whatever its outcome. When `interruption` completes first, `work`
    /// is dropped and disarming brakes the stages.
    ///
    /// # Errors
    /// Those of `work`; a refusal to arm; [`BoardError::Interrupted`].
    pub async fn armed<T, E: From<BoardError>>(
        &mut self,
        interruption: impl Future<Output = ()>,
        work: impl AsyncFnOnce(&mut Self) -> Result<T, E>,
    ) -> Result<T, E> {
        self.begin_arming().await?;
        let outcome = tokio::select! {
            outcome = async { self.take_hold().await?; work(self).await } => Some(outcome),
            () = interruption => None,
        };
        let disarmed = self.release().await;
        let Some(outcome) = outcome else {
            disarmed?;
            return Err(BoardError::Interrupted.into());
        };
        // Where both failed, such as with a latched fault, the first error names the cause.
        let value = outcome?;
        disarmed?;
        Ok(value)
    }

    /// Arms under a live lease, until [`Self::release`]. Whoever may be interrupted uses [`Self::armed`], which always disarms.
    ///
    /// # Errors
    /// [`BoardError`]: a refusal to arm, or a link that ended.
    pub async fn arm(&mut self) -> Result<(), BoardError> {
        self.begin_arming().await?;
        self.take_hold().await
    }

    async fn begin_arming(&mut self) -> Result<(), BoardError> {
        self.client.hold_lease(self.lease_ms).await?;
        self.ask(Request::Arm { session: self.client.session() }).await
    }

    /// Waits for a pose from after the arming. From then on nobody else can move the board, so its last move id is known.
    async fn take_hold(&mut self) -> Result<(), BoardError> {
        self.wait_until(|pose| pose.state == ControllerState::Ready).await?;
        self.latest_move = self.pose.move_id;
        Ok(())
    }

    /// Disarms and waits until the board is idle; a board in motion brakes first.
    ///
    /// # Errors
    /// [`BoardError`]: a refusal, or a link that ended.
    pub async fn disarm(&mut self) -> Result<(), BoardError> {
        self.ask(Request::Disarm).await?;
        self.wait_until(|pose| pose.state == ControllerState::Idle).await
    }

    /// Disarms and stops the heartbeats that keep the lease; a board in motion brakes first.
    ///
    /// # Errors
    /// [`BoardError`]: a refusal, or a link that ended.
    pub async fn release(&mut self) -> Result<(), BoardError> {
        let disarmed = self.disarm().await;
        self.client.hold_lease(0).await?;
        disarmed
    }

    /// Homes all axes. The board must be armed.
    ///
    /// # Errors
    /// [`BoardError`]: the fault that ended the homing, or a refusal.
    pub async fn home(&mut self) -> Result<(), BoardError> {
        let axes = AxisMask::first(self.rig.axes.len());
        self.ask(Request::Home { axes }).await?;
        // A pose sent before the request may still show the old reference.
        self.wait_until(|pose| pose.state == ControllerState::Homing).await?;
        self.wait_until(|pose| pose.state != ControllerState::Homing && pose.referenced == axes).await
    }

    /// Moves all axes to `targets` and waits until the encoders confirm them. A trunk goes by a path along which its loop closes and
    /// nothing touches. The board must be armed.
    ///
    /// # Errors
    /// [`BoardError`]: a target out of range or to which no path leads, the fault that ended the move, a refusal, or a stop.
    pub async fn move_to(&mut self, mode: Mode, targets: &[AxisPosition]) -> Result<(), BoardError> {
        check_range(&self.rig, targets)?;
        let ways = straight_ways(&self.rig, &self.axes, &self.standing(), targets)?;
        let last = ways.len().saturating_sub(1);
        for (number, way) in ways.iter().enumerate() {
            let mode = if number == last { mode } else { Mode(0) };
            let (id, targets) = (self.next_move_id(), self.rig.wire_targets(&way.targets));
            self.ask(Request::MoveTo(Move { id, mode, targets, speed: way.speed })).await?;
            self.wait_for_move(id).await?;
        }
        Ok(())
    }

    /// Moves all axes by `distances` from where they stand, and waits until the encoders confirm it. Works without reference,
    /// at homing speed. The board must be armed.
    ///
    /// # Errors
    /// [`BoardError`]: the fault that ended the move, a refusal, or a stop.
    pub async fn move_by(&mut self, distances: &[AxisPosition]) -> Result<(), BoardError> {
        let (id, by) = (self.next_move_id(), self.rig.wire_distances(distances));
        self.ask(Request::Jog(Jog { id, by, speed: Permille::FULL })).await?;
        self.wait_for_move(id).await
    }

    /// A move id other than the board's last one, because a pose sent before the request still names that one. Never zero,
    /// which means "no move yet".
    fn next_move_id(&mut self) -> MoveId {
        self.latest_move = MoveId(self.latest_move.0.wrapping_add(1).max(1));
        self.latest_move
    }

    async fn wait_for_move(&mut self, id: MoveId) -> Result<(), BoardError> {
        self.wait_until(|pose| pose.move_id == id && matches!(pose.phase, MovePhase::Settled | MovePhase::Stopped))
            .await?;
        if self.pose.phase == MovePhase::Stopped {
            return Err(BoardError::Stopped);
        }
        Ok(())
    }

    /// Stops every motion and waits until the board is at rest.
    ///
    /// # Errors
    /// [`BoardError`] where the link ended.
    pub async fn stop(&mut self) -> Result<(), BoardError> {
        self.ask(Request::Stop { kind: StopKind::Decelerate }).await?;
        let moving = [ControllerState::Moving, ControllerState::Homing, ControllerState::Stopping];
        self.wait_until(|pose| !moving.contains(&pose.state)).await
    }

    /// Stays armed for `duration`; for ever where it is `None`.
    ///
    /// # Errors
    /// [`BoardError`]: the fault that ended it, or a link that ended.
    pub async fn hold(&mut self, duration: Option<Duration>) -> Result<(), BoardError> {
        let watched = self.wait_for(duration, |_| false).await;
        watched.unwrap_or(Ok(()))
    }

    /// Clears the latched fault and returns it; `None` where nothing is latched.
    ///
    /// # Errors
    /// [`BoardError`]: a refusal, such as a cause that persists, or a link that ended.
    pub async fn clear(&mut self) -> Result<Option<FaultRecord>, BoardError> {
        let Some(fault) = self.pose.fault else { return Ok(None) };
        self.ask(Request::ClearFault { seen: fault.seq }).await?;
        self.wait_until(|pose| pose.fault.is_none()).await?;
        Ok(Some(fault))
    }
}
