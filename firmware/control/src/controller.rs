//! The state machine: what may move, when, and what stops it.
//!
//! ```text
//! Boot --> SelfTest --> Idle (or Trial)                 Idle --begin_update--> Updating --end_update--> Idle
//! Idle --Arm--> Ready --Home--> Homing --> Ready        Ready --Disarm--> Idle (reference kept)
//! Ready --MoveTo, Jog--> Moving --settled--> Ready      Moving --MoveTo--> Moving (another target)
//! Moving, Homing --Stop--> Stopping --> Ready           Trial --confirm_trial--> Idle
//! armed --lease expired--> LinkLost (brakes, latched)   any --fault--> Fault (latched)
//! LinkLost, Fault --ClearFault--> Idle                  Boot, SelfTest, LinkLost, Fault, drivers off <--> Updating
//! ```

mod requests;
mod tick;
mod update;

use heapless::Deque;
use vergence_protocol::{
    AxisInfo, AxisList, AxisMask, ControllerState, Counts, FaultCode, FaultRecord, Micro, Microseconds, Mode, MoveId,
    MovePhase, PoseReport, SessionId,
};

use crate::axis::Axis;
use crate::homing_sequence::HomingSequence;
use crate::io::RigIo;
use crate::latch::FaultLatch;
use crate::lease::Lease;
use crate::self_test::SelfTest;
use crate::settings::{AxisSettings, SettingsError};
use crate::trajectory::Fine;

/// What the host should hear of at once.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Event {
    /// A move changed its phase.
    MoveState {
        /// Which move.
        id: MoveId,
        /// Where it is.
        phase: MovePhase,
    },
    /// A fault was latched.
    Fault(FaultRecord),
}

/// The latest move.
#[derive(Clone, Debug)]
struct ActiveMove {
    id: MoveId,
    mode: Mode,
    targets: AxisList<Micro>,
    phase: MovePhase,
    /// Since when all encoders are inside the tolerance.
    inside_since: Option<Microseconds>,
    settle_by: Microseconds,
}

/// The controller of N axes.
#[derive(Debug)]
pub struct Controller {
    axes: AxisList<Axis>,
    state: ControllerState,
    drivers_on: bool,
    lease: Lease,
    /// Who armed the board.
    holder: Option<SessionId>,
    latch: FaultLatch,
    homing: HomingSequence,
    self_test: SelfTest,
    /// Whether the firmware is on trial.
    on_trial: bool,
    /// Where an update that is given up leads back to.
    before_update: ControllerState,
    /// When the next control tick is due.
    next_tick: Microseconds,
    active: ActiveMove,
    disarm_at_rest: bool,
    events: Deque<Event, 8>,
}

impl Controller {
    /// A controller that has just started, without reference.
    ///
    /// # Errors
    /// [`SettingsError`] where an axis cannot work with its settings.
    pub fn new(settings: &[AxisSettings]) -> Result<Self, SettingsError> {
        let mut axes = AxisList::new();
        for (index, &axis) in settings.iter().enumerate() {
            axis.validate(index)?;
            axes.push(Axis::new(index, axis)).map_err(|_| SettingsError::AxisCount)?;
        }
        if axes.is_empty() {
            return Err(SettingsError::AxisCount);
        }
        let active = ActiveMove {
            id: MoveId(0),
            mode: Mode(0),
            targets: AxisList::new(),
            phase: MovePhase::None,
            inside_since: None,
            settle_by: Microseconds(0),
        };
        Ok(Self {
            axes,
            state: ControllerState::Boot,
            drivers_on: false,
            lease: Lease::default(),
            holder: None,
            latch: FaultLatch::default(),
            homing: HomingSequence::default(),
            self_test: SelfTest::default(),
            on_trial: false,
            before_update: ControllerState::Idle,
            next_tick: Microseconds(0),
            active,
            disarm_at_rest: false,
            events: Deque::new(),
        })
    }

    /// How many axes there are.
    #[must_use]
    pub fn axis_count(&self) -> usize {
        self.axes.len()
    }

    /// What the host is told of an axis.
    #[must_use]
    pub fn axis_info(&self, axis: usize) -> Option<AxisInfo> {
        self.axes.get(axis).map(|axis| axis.settings.info())
    }

    /// Where an axis was last told to be: at the end of the tick after the running one, as far as is ordered.
    #[must_use]
    pub fn command(&self, axis: usize) -> Option<Fine> {
        self.axes.get(axis).map(Axis::command)
    }

    /// Replaces the settings of all axes. An axis whose zero would be elsewhere loses its reference. To be called only
    /// while disarmed.
    ///
    /// # Errors
    /// [`SettingsError`]; nothing was changed.
    pub fn replace_settings(&mut self, settings: &[AxisSettings]) -> Result<(), SettingsError> {
        if settings.len() != self.axes.len() {
            return Err(SettingsError::AxisCount);
        }
        settings.iter().enumerate().try_for_each(|(index, axis)| axis.validate(index))?;
        for (axis, new) in self.axes.iter_mut().zip(settings) {
            if !axis.settings.keeps_reference(new) {
                axis.forget_reference();
            }
            axis.settings = *new;
        }
        Ok(())
    }

    /// Raw encoder counts of all axes as in a Pose.
    #[must_use]
    pub fn counts_from(&self, raw: &[i32]) -> AxisList<Counts> {
        self.axes.iter().zip(raw).map(|(axis, &raw)| axis.counts_from(raw)).collect()
    }

    /// What the controller is doing.
    #[must_use]
    pub fn state(&self) -> ControllerState {
        self.state
    }

    /// Whether the motors are held or driven.
    #[must_use]
    pub fn drivers_on(&self) -> bool {
        self.drivers_on
    }

    /// Whether a tick would find nothing to do until somebody asks for something.
    #[must_use]
    pub fn is_at_rest(&self) -> bool {
        !self.drivers_on && !matches!(self.state, ControllerState::Boot | ControllerState::SelfTest)
    }

    /// Whether a fault is latched.
    #[must_use]
    pub fn has_fault(&self) -> bool {
        self.latch.record().is_some()
    }

    /// The oldest event not yet taken.
    pub fn take_event(&mut self) -> Option<Event> {
        self.events.pop_front()
    }

    /// Telemetry at `now`.
    #[must_use]
    pub fn pose(&self, now: Microseconds, seq: u16, io: &impl RigIo) -> PoseReport {
        let mut referenced = AxisMask::default();
        for (index, _) in self.axes.iter().enumerate().filter(|(_, axis)| axis.is_referenced()) {
            referenced = referenced.with(index);
        }
        PoseReport {
            at: now,
            seq,
            counts: self.axes.iter().map(|axis| axis.counts(io)).collect(),
            referenced,
            state: self.state,
            mode: self.mode_reached(io),
            move_id: self.active.id,
            phase: self.active.phase,
            fault: self.latch.record(),
        }
    }

    /// The mode of the latest move, claimed only while the encoders confirm it.
    fn mode_reached(&self, io: &impl RigIo) -> Mode {
        let referenced = self.axes.iter().all(Axis::is_referenced);
        let there = referenced && self.active.phase == MovePhase::Settled && self.inside_tolerance(io);
        if there { self.active.mode } else { Mode(0) }
    }

    fn inside_tolerance(&self, io: &impl RigIo) -> bool {
        self.axes.iter().zip(&self.active.targets).all(|(axis, &target)| axis.is_at(target, io))
    }

    fn any_moving(&self) -> bool {
        self.axes.iter().any(Axis::is_moving)
    }

    fn is_latched(&self) -> bool {
        matches!(self.state, ControllerState::LinkLost | ControllerState::Fault)
    }

    /// Takes a heartbeat of `session`. Once latched nobody holds the board: who clears the fault can arm at once.
    pub fn heartbeat(&mut self, now: Microseconds, session: SessionId, lease_ms: u16) {
        let holder = self.holder.filter(|_| !self.is_latched());
        self.lease.renew(now, session, lease_ms, holder);
    }

    fn go_idle(&mut self, io: &mut impl RigIo) {
        self.cut_drivers(io);
        self.holder = None;
        self.disarm_at_rest = false;
        self.state = self.at_rest();
    }

    fn cut_drivers(&mut self, io: &mut impl RigIo) {
        self.drivers_on = false;
        io.set_drivers(false);
        for axis in &mut self.axes {
            axis.abandon();
        }
    }

    /// Brings every axis to rest within its limits.
    fn brake(&mut self) {
        self.abort_motion();
        self.axes.iter_mut().for_each(Axis::stop);
    }

    /// Gives up the running move.
    fn abort_motion(&mut self) {
        if matches!(self.active.phase, MovePhase::Running | MovePhase::Settling) {
            self.active.phase = MovePhase::Stopped;
            self.tell_phase();
        }
    }

    fn raise(&mut self, now: Microseconds, code: FaultCode, axis: Option<usize>, detail: i32) {
        if self.latch.raise(code, now, axis, detail)
            && let Some(record) = self.latch.record()
        {
            self.tell(Event::Fault(record));
        }
    }

    fn tell_phase(&mut self) {
        self.tell(Event::MoveState { id: self.active.id, phase: self.active.phase });
    }

    /// Events are a convenience: every Pose repeats what they say, so the oldest may be dropped.
    fn tell(&mut self, event: Event) {
        if self.events.is_full() {
            self.events.pop_front();
        }
        let _ = self.events.push_back(event);
    }
}
