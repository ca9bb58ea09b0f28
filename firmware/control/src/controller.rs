//! The controller's state machine: what may move, when, and what stops motion.
//!
//! ```text
//! Boot --> SelfTest --> Idle (or Trial)                 Idle --begin_update--> Updating --end_update--> Idle
//! Idle --Arm--> Ready --Home--> Homing --> Ready        Ready --Disarm--> Idle (reference kept)
//! Ready --MoveTo, Jog--> Moving --settled--> Ready      Moving --MoveTo--> Moving (another target)
//! Moving, Homing --Stop--> Stopping --> Ready           Trial --confirm_trial--> Idle
//! armed --lease expired--> LinkLost (brakes, latched)   any --fault--> Fault (latched)
//! LinkLost, Fault --ClearFault--> Idle                  Boot, SelfTest, LinkLost, Fault, drivers off <--> Updating
//! ```

mod planning;
mod requests;
mod settling;
mod tick;
mod update;

use heapless::Deque;
use vergence_protocol::{
    AxisInfo, AxisList, AxisMask, ControllerState, Counts, EncoderState, FaultCode, FaultRecord, Micro, Microseconds,
    Mode, MoveId, MovePhase, PoseReport, SessionId,
};

use self::planning::Planning;
pub use self::planning::plan_ticks;
use crate::axis::Axis;
use crate::holding::Holding;
use crate::homing_sequence::HomingSequence;
use crate::io::RigIo;
use crate::latch::FaultLatch;
use crate::lease::Lease;
use crate::self_test::SelfTest;
use crate::settings::{AxisSettings, SettingsError};
use crate::trajectory::Fine;

/// An event that the host should learn of at once.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Event {
    /// A move entered a phase.
    MoveState {
        /// Number of the move.
        id: MoveId,
        /// The phase entered.
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
    /// Share of full speed.
    share: f32,
    phase: MovePhase,
    /// Time since which all encoders have been inside the tolerance.
    inside_since: Option<Microseconds>,
    /// Since when the axes rest.
    rests_since: Option<Microseconds>,
    /// Number of short moves that corrected the end.
    corrections: u8,
}

/// The controller of up to [`vergence_protocol::MAX_AXES`] axes. Time and the board behind [`RigIo`] are arguments.
#[derive(Debug)]
pub struct Controller {
    axes: AxisList<Axis>,
    state: ControllerState,
    drivers_on: bool,
    lease: Lease,
    /// The session that armed the board.
    holder: Option<SessionId>,
    latch: FaultLatch,
    homing: HomingSequence,
    holding: Holding,
    self_test: SelfTest,
    /// Whether the saved settings are not in effect and nobody knows yet.
    settings_lost: bool,
    /// Whether the firmware is on trial.
    on_trial: bool,
    /// State to return to when an update is given up.
    before_update: ControllerState,
    /// Time of the next control tick.
    next_tick: Microseconds,
    active: ActiveMove,
    /// The plan for the latest move, until it begins.
    planning: Option<Planning>,
    /// Number of the latest plan.
    plans: u32,
    disarm_at_rest: bool,
    events: Deque<Event, 8>,
}

impl Controller {
    /// A controller that has just started; no axis has a reference.
    ///
    /// # Errors
    /// [`SettingsError`] if an axis cannot work with its settings, or the number of axes is zero or too large.
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
            share: 1.0,
            phase: MovePhase::None,
            inside_since: None,
            rests_since: None,
            corrections: 0,
        };
        Ok(Self {
            axes,
            state: ControllerState::Boot,
            drivers_on: false,
            lease: Lease::default(),
            holder: None,
            latch: FaultLatch::default(),
            homing: HomingSequence::default(),
            holding: Holding::default(),
            self_test: SelfTest::default(),
            settings_lost: false,
            on_trial: false,
            before_update: ControllerState::Idle,
            next_tick: Microseconds(0),
            active,
            planning: None,
            plans: 0,
            disarm_at_rest: false,
            events: Deque::new(),
        })
    }

    /// Notes that the saved settings are not in effect, so that the self-test ends in a fault. Call it at the start.
    pub fn distrust_settings(&mut self) {
        self.settings_lost = true;
    }

    /// Number of axes.
    #[must_use]
    pub fn axis_count(&self) -> usize {
        self.axes.len()
    }

    /// Limits and scale of an axis; `None` if there is no such axis.
    #[must_use]
    pub fn axis_info(&self, axis: usize) -> Option<AxisInfo> {
        self.axes.get(axis).map(|axis| axis.settings.info())
    }

    /// Commanded position of an axis at the end of the last tick whose steps are ordered; `None` if there is no such axis.
    #[must_use]
    pub fn command(&self, axis: usize) -> Option<Fine> {
        self.axes.get(axis).map(Axis::command)
    }

    /// Replaces the settings of all axes. An axis whose zero would move loses its reference. Call it only while disarmed.
    ///
    /// # Errors
    /// [`SettingsError`] if an axis cannot work with its settings; nothing was changed.
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

    /// Sets the time in microseconds at rest after which the motors get their holding current; 0 for never.
    pub fn hold_after(&mut self, us: u64) {
        self.holding.set_after(us);
    }

    /// What is known of the encoder of an axis beyond its count; nothing if there is no such axis.
    #[must_use]
    pub fn encoder_state(&self, axis: usize, io: &impl RigIo) -> EncoderState {
        self.axes.get(axis).map_or(EncoderState::Plain, |axis| axis.encoder_state(io))
    }

    /// Converts raw encoder counts of all axes to counts as in a pose.
    #[must_use]
    pub fn counts_from(&self, raw: &[i32]) -> AxisList<Counts> {
        self.axes.iter().zip(raw).map(|(axis, &raw)| axis.counts_from(raw)).collect()
    }

    /// State of the controller.
    #[must_use]
    pub fn state(&self) -> ControllerState {
        self.state
    }

    /// Whether the motor drivers are on.
    #[must_use]
    pub fn drivers_on(&self) -> bool {
        self.drivers_on
    }

    /// Whether ticks have nothing to do until a request comes.
    #[must_use]
    pub fn is_at_rest(&self) -> bool {
        !self.drivers_on && !matches!(self.state, ControllerState::Boot | ControllerState::SelfTest)
    }

    /// Whether a fault is latched.
    #[must_use]
    pub fn has_fault(&self) -> bool {
        self.latch.record().is_some()
    }

    /// Takes the oldest event.
    pub fn take_event(&mut self) -> Option<Event> {
        self.events.pop_front()
    }

    /// The pose of the tick of `now`, with number `seq`, and with the time at which the encoders were read.
    #[must_use]
    pub fn pose(&self, now: Microseconds, seq: u16, io: &impl RigIo) -> PoseReport {
        let mut referenced = AxisMask::default();
        for (index, _) in self.axes.iter().enumerate().filter(|(_, axis)| axis.is_referenced()) {
            referenced = referenced.with(index);
        }
        PoseReport {
            at: io.encoders_read_at(now),
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

    /// The mode of the latest move while all encoders are inside the tolerance, else none.
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

    /// Takes a heartbeat of `session`. While a fault is latched no session holds the board, so that the session that
    /// clears the fault can arm at once.
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
        self.planning = None;
        self.drivers_on = false;
        io.set_drivers(false);
        for axis in &mut self.axes {
            axis.abandon();
        }
    }

    /// Gives up the running move and brings every axis to rest within its limits.
    fn brake(&mut self) {
        self.abort_motion();
        self.planning = None;
        self.axes.iter_mut().for_each(Axis::stop);
    }

    /// Marks the running move as stopped.
    fn abort_motion(&mut self) {
        if matches!(self.active.phase, MovePhase::Running | MovePhase::Settling) {
            self.active.phase = MovePhase::Stopped;
            self.queue_phase();
        }
    }

    fn raise(&mut self, now: Microseconds, code: FaultCode, axis: Option<usize>, detail: i32) {
        if self.latch.raise(code, now, axis, detail)
            && let Some(record) = self.latch.record()
        {
            self.queue(Event::Fault(record));
        }
    }

    fn queue_phase(&mut self) {
        self.queue(Event::MoveState { id: self.active.id, phase: self.active.phase });
    }

    /// Queues an event. The oldest may be dropped, because every pose repeats what events say.
    fn queue(&mut self, event: Event) {
        if self.events.is_full() {
            self.events.pop_front();
        }
        let _ = self.events.push_back(event);
    }
}
