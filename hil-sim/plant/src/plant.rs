//! All mechanics behind the I/O interface of the controller.

use std::collections::VecDeque;

use vergence_control::driver::DriverLine;
use vergence_control::joints::{BusSettings, JointStates};
use vergence_control::{DriverSettings, EncoderKind, IndexEdges, RigIo, StepSchedule, TriggerEdge};
use vergence_protocol::{AxisList, DriverState, EncoderState, Microseconds};

use crate::axis::{AxisMechanics, AxisPlant};
use crate::drivers::Drivers;
use crate::joints::Joints;
use crate::servo::{AnyMechanism, Free, ServoBus};
use crate::tmc2209::{Tmc2209, Turning};

/// All axes, the driver enable and the emergency stop.
#[derive(Clone, Debug)]
pub struct Plant {
    axes: Vec<AxisPlant>,
    now: Microseconds,
    drivers_on: bool,
    holding: bool,
    emergency_stop: bool,
    /// The axis whose home switch is wired to each input.
    home_wires: Vec<usize>,
    /// Axes whose driver's output DIAG is wired to the input of the home switch.
    diag_wires: Vec<usize>,
    /// Axes at whose input the wire of DIAG is broken: its pull-up keeps it high.
    broken_diag: Vec<usize>,
    /// When the cameras will be fired.
    trigger_at: Option<Microseconds>,
    trigger_edges: VecDeque<TriggerEdge>,
    exposed: Option<(Microseconds, Vec<f64>)>,
    drivers: Drivers,
    /// The native board's end of the drivers' serial line.
    line: DriverLine,
    /// The joints of a robot; without servos nobody answers on their bus.
    joints: Joints,
}

impl Plant {
    /// Axes at rest at `positions` (micro-units), drivers off.
    #[must_use]
    pub fn new(mechanics: &[AxisMechanics], positions: &[f64]) -> Self {
        let axes: Vec<_> =
            mechanics.iter().zip(positions).map(|(&axis, &position)| AxisPlant::new(axis, position)).collect();
        Self {
            home_wires: (0..axes.len()).collect(),
            diag_wires: Vec::new(),
            broken_diag: Vec::new(),
            axes,
            now: Microseconds(0),
            drivers_on: false,
            holding: false,
            emergency_stop: false,
            trigger_at: None,
            trigger_edges: VecDeque::new(),
            exposed: None,
            drivers: Drivers::default(),
            line: DriverLine::default(),
            joints: Joints::new(ServoBus::new(Vec::new(), AnyMechanism::new(Free::default()))),
        }
    }

    /// A robot's joints, drivers off, and no stages.
    #[must_use]
    pub fn of_joints(servos: ServoBus<AnyMechanism>) -> Self {
        Self { joints: Joints::new(servos), ..Self::new(&[], &[]) }
    }

    /// The joints.
    #[must_use]
    pub const fn joints(&self) -> &Joints {
        &self.joints
    }

    /// The joints, to change them.
    pub const fn joints_mut(&mut self) -> &mut Joints {
        &mut self.joints
    }

    /// The true position of every load, in micro-units.
    #[must_use]
    pub fn loads(&self) -> Vec<f64> {
        self.axes.iter().map(AxisPlant::load).collect()
    }

    /// The true position of the load of `axis`, in micro-units.
    #[must_use]
    pub fn load(&self, axis: usize) -> Option<f64> {
        self.axes.get(axis).map(AxisPlant::load)
    }

    /// The true position of the stage of `axis`, in micro-units; it lags behind the load by the play between them.
    #[must_use]
    pub fn stage(&self, axis: usize) -> Option<f64> {
        self.axes.get(axis).map(AxisPlant::stage)
    }

    /// Whether the index line of an encoder is high where its lines show the count `raw`; `None` without an index.
    #[must_use]
    pub fn index_line(&self, axis: usize, raw: i32) -> Option<bool> {
        self.axes.get(axis)?.index_line(raw)
    }

    /// Swaps the wires of two home switches. There is no effect where there is no such axis.
    pub fn cross_home_switches(&mut self, one: usize, other: usize) {
        if one.max(other) < self.home_wires.len() {
            self.home_wires.swap(one, other);
        }
    }

    /// Wires the output DIAG of an axis' driver to the input of its home switch, in place of the switch.
    pub fn wire_diag(&mut self, axis: usize) {
        self.diag_wires.push(axis);
    }

    /// Breaks the wire of DIAG at the input of an axis: its pull-up keeps it high.
    pub fn break_diag(&mut self, axis: usize) {
        self.broken_diag.push(axis);
    }

    /// When the cameras were last fired, and the true position of every load then, in micro-units.
    #[must_use]
    pub fn exposed(&self) -> Option<(Microseconds, &[f64])> {
        self.exposed.as_ref().map(|(at, loads)| (*at, loads.as_slice()))
    }

    /// One axis, to change it; `None` where there is no such axis.
    pub fn axis_mut(&mut self, axis: usize) -> Option<&mut AxisPlant> {
        self.axes.get_mut(axis)
    }

    /// The TMC2209 drivers of the axes; without any the drivers are plain.
    pub fn drivers_mut(&mut self) -> &mut Drivers {
        &mut self.drivers
    }

    /// The TMC2209 drivers of the axes.
    #[must_use]
    pub fn drivers(&self) -> &Drivers {
        &self.drivers
    }

    /// Restarts the clock of the board at zero, its counters of the encoders too, and switches its outputs off; the mechanics
    /// keep their positions.
    pub fn restart_clock(&mut self) {
        self.set_drivers(false);
        self.holding = false;
        self.axes.iter_mut().for_each(AxisPlant::restart_encoder);
        self.trigger_at = None;
        self.trigger_edges.clear();
        self.exposed = None;
        self.line = DriverLine::default();
        self.joints.restart_clock(self.now);
        self.now = Microseconds(0);
    }

    /// Records the instants of all steps from now on.
    pub fn record_steps(&mut self) {
        self.axes.iter_mut().for_each(AxisPlant::record_steps);
    }

    /// Whether the drivers are on.
    #[must_use]
    pub fn drivers_on(&self) -> bool {
        self.drivers_on
    }

    /// Whether the drivers are asked for their holding current.
    #[must_use]
    pub fn is_holding(&self) -> bool {
        self.holding
    }

    /// Presses or releases the emergency stop, which cuts the drivers in hardware.
    pub fn press_emergency_stop(&mut self, pressed: bool) {
        self.emergency_stop = pressed;
        self.drivers.supply(!pressed);
        self.axes.iter_mut().for_each(AxisPlant::drop_order);
    }

    /// Wedges the load of `axis` where it is, or frees it. A motor that pulls on a wedged load loses steps, so that the
    /// encoder stands still while the command continues. There is no effect where there is no such axis.
    pub fn block(&mut self, axis: usize, blocked: bool) {
        if let Some(axis) = self.axes.get_mut(axis) {
            axis.block(blocked);
        }
    }

    /// Lets time pass until `to`.
    pub fn advance(&mut self, to: Microseconds) {
        if let Some(at) = self.trigger_at.take_if(|at| *at <= to) {
            self.run_to(at.max(self.now));
            self.latch();
        }
        self.run_line(to);
        self.run_to(to);
        self.axes.iter_mut().for_each(AxisPlant::ask_magnet);
    }

    /// Runs the native board's exchanges with the drivers, which take no time.
    fn run_line(&mut self, to: Microseconds) {
        while let Some(at) = self.line.wakes_at().filter(|at| *at <= to) {
            let now = at.max(self.now);
            self.run_to(now);
            let Some(datagram) = self.line.poll(now) else { continue };
            let reply = self.drivers.hear(&datagram);
            let bytes = datagram.into_iter().chain(reply.into_iter().flat_map(|reply| reply.bytes));
            bytes.for_each(|byte| self.line.receive(now, byte));
        }
    }

    /// Makes the trigger's edge: hardware latches every encoder.
    fn latch(&mut self) {
        self.axes.iter_mut().for_each(AxisPlant::ask_magnet);
        let counts = match self.joints.states() {
            Some(states) => (0..states.0.len()).map(|joint| states.counts_at(joint, self.now)).collect(),
            None => self.axes.iter().map(AxisPlant::encoder).collect(),
        };
        self.trigger_edges.push_back(TriggerEdge { at: self.now, counts });
        self.exposed = Some((self.now, self.loads()));
    }

    fn run_to(&mut self, to: Microseconds) {
        let powered = self.is_powered();
        for (index, axis) in self.axes.iter_mut().enumerate() {
            axis.set_step_size(self.drivers.step_size(index));
            let before = axis.steps();
            axis.advance(self.now, to, powered);
            let steps = axis.steps().abs_diff(before);
            self.drivers.advance(index, to, Turning { steps, last: axis.last_steps(), pressed: axis.pressed() });
        }
        self.joints.advance(to);
        self.now = to;
    }

    fn is_powered(&self) -> bool {
        self.drivers_on && !self.emergency_stop
    }
}

impl RigIo for Plant {
    fn set_drivers(&mut self, on: bool) {
        self.drivers_on = on;
        self.drivers.enable(on);
        self.line.set_motors(on);
        self.axes.iter_mut().for_each(AxisPlant::drop_order);
        if let Some(orders) = self.joints.orders() {
            orders.set_torque(on);
        }
    }

    fn set_holding(&mut self, holding: bool) {
        self.holding = holding;
    }

    fn schedule_steps(&mut self, axis: usize, steps: &StepSchedule) {
        if self.is_powered()
            && let Some(axis) = self.axes.get_mut(axis)
        {
            axis.schedule(steps);
        }
    }

    fn set_goal(&mut self, axis: usize, counts: i32) {
        if let Some(orders) = self.joints.orders() {
            orders.set_goal(axis, counts);
        }
    }

    fn steps(&self, axis: usize) -> i32 {
        self.axes.get(axis).map_or(0, AxisPlant::steps)
    }

    fn encoder(&self, axis: usize) -> i32 {
        if let Some(states) = self.joints.states() {
            return states.counts(axis);
        }
        self.axes.get(axis).map_or(0, AxisPlant::encoder)
    }

    fn use_encoder(&mut self, axis: usize, kind: EncoderKind) {
        if let Some(axis) = self.axes.get_mut(axis) {
            axis.use_encoder(kind);
        }
    }

    fn encoder_state(&self, axis: usize) -> EncoderState {
        if let Some(states) = self.joints.states() {
            return states.encoder(axis);
        }
        self.axes.get(axis).map_or(EncoderState::Plain, AxisPlant::encoder_state)
    }

    fn take_index(&mut self, axis: usize) -> IndexEdges {
        self.axes.get_mut(axis).map(AxisPlant::take_index).unwrap_or_default()
    }

    fn encoders_read_at(&self, _now: Microseconds) -> Microseconds {
        // Stages are read now whatever tick this is.
        self.joints.states().and_then(JointStates::read_at).unwrap_or(self.now)
    }

    fn home_switch(&self, axis: usize) -> bool {
        if self.diag_wires.contains(&axis) {
            let is_high = self.broken_diag.contains(&axis) || self.drivers.chip(axis).is_some_and(Tmc2209::diag);
            return !is_high;
        }
        let switch = self.home_wires.get(axis).and_then(|&wired| self.axes.get(wired));
        switch.is_some_and(AxisPlant::home_line_is_low)
    }

    fn hard_limit(&self, axis: usize) -> bool {
        self.axes.get(axis).is_some_and(AxisPlant::limit_line_is_high)
    }

    fn emergency_stop(&self) -> bool {
        self.emergency_stop
    }

    fn configure_drivers(&mut self, drivers: &AxisList<DriverSettings>) {
        self.line.configure(drivers.iter().copied());
    }

    fn configure_joints(&mut self, bus: Option<&BusSettings>) {
        self.joints.configure(bus, self.now);
    }

    fn driver(&self, axis: usize) -> DriverState {
        if let Some(states) = self.joints.states() {
            return states.driver(axis);
        }
        self.line.state(axis)
    }

    fn fire_trigger(&mut self, at: Microseconds) {
        self.trigger_at = Some(at);
    }

    fn take_trigger_edge(&mut self) -> Option<TriggerEdge> {
        self.trigger_edges.pop_front()
    }
}
