//! The node: the controller with its serial session, telemetry, settings, recorder and trigger. Firmware, native board and
//! tests run this same code.

mod management;
mod requests;

use vergence_protocol::management::{BootState, RebootTo};
use vergence_protocol::{
    BoardEvent, BoardSession, ControllerState, Happening, MAX_FRAME, Microseconds, ResetCause, Trigger,
};

use crate::board_settings::{BoardSettings, Delivered, Machine};
use crate::controller::{Controller, Event};
use crate::io::RigIo;
use crate::line_speed::LineSpeed;
use crate::move_planner::{MovePlanner, PlanRequest};
use crate::recorder::Recorder;
use crate::services::BoardServices;
use crate::settings::{AxisSettings, SettingsError};
use crate::settings_store;
use crate::trigger::CameraTrigger;
use crate::updater::Updater;
use crate::{REST_US, TICK_US};

/// Time in microseconds after the last byte from the host within which every request is done and answered.
const QUIET_US: u64 = 20_000;
/// Shortest notice in microseconds that a board gets of the next tick.
const NOTICE_US: u64 = 20;

/// Identity of a board and its firmware.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct NodeIdentity {
    /// Kind of board, at most 16 bytes.
    pub board: heapless::String<16>,
    /// Id of the hardware, which firmware images must name.
    pub hardware: u32,
    /// Version of the firmware: major, minor, patch.
    pub firmware: [u8; 3],
    /// Oldest firmware version that the board accepts: major, minor, patch.
    pub oldest: [u8; 3],
    /// Build id of the firmware.
    pub build: u64,
    /// Unique id of the chip.
    pub uid: [u8; 12],
    /// Cause of the last start.
    pub reset: ResetCause,
}

/// The controller with all that the host talks to.
///
/// Loop: [`receive`](Self::receive) bytes, call [`poll`](Self::poll) at [`wakes_at`](Self::wakes_at), send the frames of
/// [`transmit`](Self::transmit).
#[derive(Debug)]
pub struct Node {
    session: BoardSession,
    controller: Controller,
    identity: NodeIdentity,
    settings: BoardSettings,
    /// Settings as delivered.
    delivered: Delivered,
    /// The machine that is driven since the start.
    machine: Machine,
    recorder: Recorder,
    trigger: CameraTrigger,
    updater: Updater,
    /// Whether the motor drivers have yet to be told their settings.
    drivers_wait: bool,
    /// Time of the last management request.
    managed_at: Microseconds,
    reboot: Option<RebootTo>,
    line: LineSpeed,
    /// Time of the last byte from the host.
    last_byte_at: Microseconds,
    wakes_at: Microseconds,
    /// State of the controller as last recorded.
    state: ControllerState,
    stream_period: u64,
    next_pose: Microseconds,
    pose_seq: u16,
}

impl Node {
    /// A node with the settings last saved, or with those `delivered` if there are none. Saved settings that this firmware
    /// refuses, or that are to be left aside, are replaced by these too, and a fault keeps the board from moving with them unnoticed. The number `boot` must
    /// differ from that of the last start.
    ///
    /// # Errors
    /// [`SettingsError`] if an axis cannot work with the default settings.
    pub fn new(
        delivered: &Delivered,
        identity: NodeIdentity,
        boot: u32,
        services: &mut impl BoardServices,
    ) -> Result<Self, SettingsError> {
        let are_left = services.leaves_settings();
        let saved = settings_store::load(services.settings_flash(), delivered);
        let are_lost = saved.is_err() || are_left;
        let settings =
            saved.ok().flatten().filter(|_| !are_left).unwrap_or_else(|| delivered.of(delivered.machine).clone());
        let mut controller = Controller::new(&settings.axes)?;
        controller.hold_after(settings.hold_after_us.into());
        if are_lost {
            controller.distrust_settings();
        }
        if services.boot_state() == BootState::Trial {
            controller.set_trial();
        }
        let mut recorder = Recorder::default();
        recorder.record(Microseconds(0), Happening::Started);
        Ok(Self {
            session: BoardSession::new(boot),
            state: controller.state(),
            controller,
            identity,
            line: LineSpeed::new(settings.baud, delivered.of(settings.machine).baud),
            machine: settings.machine,
            settings,
            delivered: delivered.clone(),
            recorder,
            trigger: CameraTrigger::default(),
            updater: Updater::default(),
            drivers_wait: true,
            managed_at: Microseconds(0),
            reboot: None,
            last_byte_at: Microseconds(0),
            wakes_at: Microseconds(0),
            stream_period: 0,
            next_pose: Microseconds(0),
            pose_seq: 0,
        })
    }

    /// The controller.
    #[must_use]
    pub fn controller(&self) -> &Controller {
        &self.controller
    }

    /// The settings in effect.
    #[must_use]
    pub fn settings(&self) -> &BoardSettings {
        &self.settings
    }

    /// The speed of the serial line, in baud. It changes when [`Self::transmit`] has nothing left: the board then lets its
    /// line follow, once the last byte is on the wire.
    #[must_use]
    pub fn baud(&self) -> u32 {
        self.line.present()
    }

    /// Time at which [`Self::poll`] is to be called next. Ask after each call of it and of [`Self::wake`].
    #[must_use]
    pub fn wakes_at(&self) -> Microseconds {
        self.wakes_at
    }

    /// Ends the rest, because bytes came: the next tick is due as if the node had not rested. [`Self::receive`] does this by
    /// itself; a board that needs long to receive may set its timer before.
    pub fn wake(&mut self, now: Microseconds) {
        self.last_byte_at = now;
        self.wakes_at.0 -= self.wakes_at.0.saturating_sub(now.0 + NOTICE_US) / TICK_US * TICK_US;
    }

    /// Takes bytes from the link. Requests that write flash block for some tens of milliseconds; nothing moves meanwhile.
    pub fn receive(&mut self, now: Microseconds, bytes: &[u8], io: &mut impl RigIo, services: &mut impl BoardServices) {
        self.wake(now);
        for &byte in bytes {
            let event = self.session.receive(now, byte);
            if self.session.take_heard() {
                self.line.hear(now);
            }
            match event {
                Some(BoardEvent::Opened { session }) => {
                    self.recorder.record(now, Happening::Opened(session));
                    self.set_stream(now, self.settings.stream_period_us);
                    // Switching the trigger off is never refused.
                    let _ = self.trigger.set(now, Trigger::Off, io);
                }
                Some(BoardEvent::Request { reply_to, request, received_at }) => {
                    self.line.converse(now);
                    let reply = self.serve(now, &request, received_at, io, services);
                    self.observe(now, io);
                    if let Some(reply) = reply {
                        self.session.reply(reply_to, reply);
                    }
                }
                Some(BoardEvent::Management { seq, request }) => {
                    let report = self.manage(now, &request, services);
                    self.observe(now, io);
                    self.session.reply_management(seq, report);
                }
                None => {}
            }
        }
    }

    /// Takes the request for a plan of a move, if there is one: [`Controller::take_plan_request`]. Ask after each call of
    /// [`Self::receive`] and [`Self::poll`].
    pub fn take_plan_request(&mut self) -> Option<PlanRequest> {
        self.controller.take_plan_request()
    }

    /// Takes a plan; returns false where it begins later: [`Controller::give_plan`].
    pub fn give_plan(&mut self, plan: &MovePlanner) -> bool {
        self.controller.give_plan(plan)
    }

    /// Makes the plan that begins with the next tick, if any, here and now: [`Controller::plan_at_once`].
    pub fn plan_at_once(&mut self) {
        self.controller.plan_at_once();
    }

    /// Judges a tick that comes `late` microseconds after its time: [`Controller::allow_delay`].
    pub fn allow_delay(&mut self, now: Microseconds, late: u64, io: &mut impl RigIo) {
        self.controller.allow_delay(now, late, io);
    }

    /// Runs the control tick, and trigger and telemetry when they are due.
    pub fn poll(&mut self, now: Microseconds, io: &mut impl RigIo) {
        if core::mem::take(&mut self.drivers_wait) {
            self.configure(io);
        }
        let next_tick = self.controller.poll(now, io);
        self.watch_update(now);
        if let Some(before) = self.line.poll(now, self.settings.baud) {
            self.settings.baud = before;
            self.recorder.record(now, Happening::Settings);
        }
        self.trigger.poll(now, io);
        while let Some(edge) = io.take_trigger_edge() {
            let counts = self.controller.counts_from(&edge.counts);
            self.session.send(vergence_protocol::Report::TriggerMark(self.trigger.mark(edge.at, counts)));
        }
        self.recorder.watch_switches(now, &self.settings.axes, io);
        self.observe(now, io);
        self.stream_pose(now, io);
        let rest = if self.is_at_rest(now) { REST_US - TICK_US } else { 0 };
        self.wakes_at = Microseconds(next_tick.0 + rest);
    }

    /// Puts the settings of motor drivers and encoders into effect.
    fn configure(&self, io: &mut impl RigIo) {
        for (index, axis) in self.settings.axes.iter().enumerate() {
            io.expect_counts(index, axis.count_rate());
            io.use_encoder(index, axis.feedback.kind);
        }
        io.configure_joints(self.settings.joint_bus().as_ref());
        io.configure_drivers(&self.settings.axes.iter().map(AxisSettings::driver_settings).collect());
    }

    /// Whether ticks may be rare: nothing moves, streams, triggers, chatters or is asked.
    fn is_at_rest(&self, now: Microseconds) -> bool {
        self.controller.is_at_rest()
            && self.stream_period == 0
            && !self.trigger.is_running()
            && self.recorder.switches_rest(self.controller.axis_count())
            && now.0 >= self.last_byte_at.0 + QUIET_US
    }

    fn set_stream(&mut self, now: Microseconds, period_us: u32) {
        self.stream_period = period_us.into();
        self.next_pose = now;
    }

    fn stream_pose(&mut self, now: Microseconds, io: &impl RigIo) {
        // A stream faster than a slow line would keep it from ever changing its speed.
        if self.stream_period == 0 || now < self.next_pose || self.line.is_changing() {
            return;
        }
        self.pose_seq = self.pose_seq.wrapping_add(1);
        self.session.telemetry(self.controller.pose(now, self.pose_seq, io));
        // The next pose keeps to the period, so that a late tick does not shift the stream.
        let late = (now.0 - self.next_pose.0) / self.stream_period + 1;
        self.next_pose = Microseconds(self.next_pose.0 + late * self.stream_period);
    }

    /// Passes the controller's events to host and recorder.
    fn observe(&mut self, now: Microseconds, io: &impl RigIo) {
        use vergence_protocol::{MovePhase, Report};
        while let Some(event) = self.controller.take_event() {
            self.session.send(match event {
                Event::MoveState { id, phase } => {
                    if phase == MovePhase::Running {
                        self.recorder.record(now, Happening::Move(id));
                    }
                    Report::MoveState { id, phase }
                }
                Event::Fault(record) => {
                    self.recorder.record_fault(&record, &self.controller.pose(now, 0, io).counts);
                    Report::Fault(record)
                }
            });
        }
        let state = self.controller.state();
        if state != self.state {
            self.state = state;
            // The recorder keeps what led to a fault until the fault is cleared.
            if !self.controller.has_fault() {
                self.recorder.release();
            }
            self.recorder.record(now, Happening::State(state));
        }
    }

    /// Queues a log entry for the host; it is sent when nothing else waits, and dropped if the queue is full.
    pub fn log(&mut self, bytes: &[u8]) {
        self.session.log(bytes);
    }

    /// Takes the program that the host wants started. Ask when [`Self::transmit`] returns `None`, so that the answer has been
    /// sent before.
    pub fn take_reboot(&mut self) -> Option<RebootTo> {
        self.reboot.take()
    }

    /// Writes the next frame for the link and returns its length in bytes. Call it until it returns `None`.
    pub fn transmit(&mut self, now: Microseconds, buffer: &mut [u8; MAX_FRAME]) -> Option<usize> {
        let length = self.session.transmit(now, buffer);
        if length.is_none() {
            self.line.run_dry(now);
        }
        length
    }
}
