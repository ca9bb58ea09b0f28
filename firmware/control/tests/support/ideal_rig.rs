//! Motors that lose nothing, loads that follow at once, and toggles for everything that can go wrong.

use std::collections::VecDeque;
use std::f64::consts::TAU;

use vergence_control::{AxisSettings, HomeEnd, HomeSensor, RigIo, Scale, StepSchedule, SwitchSettings};
use vergence_protocol::{AxisKind, DriverState, Microseconds};

/// How a home switch behaves.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum HomeSwitch {
    /// Operated at its place and beyond.
    Good,
    NeverCloses,
    StuckClosed,
}

#[derive(Clone, Debug)]
pub struct IdealAxis {
    motor: f64,
    encoder: f64,
    pub switch_at: f64,
    switches: SwitchSettings,
    /// Raw numbers at power-on.
    raw_steps: i32,
    raw_counts: i32,
    /// Steps since power-on, made and ordered.
    steps: i32,
    pub ordered: i32,
    /// When each step is due, in nanoseconds, and whether forward.
    queue: VecDeque<(u64, bool)>,
    /// All that was ever in the queue.
    pub log: Vec<(u64, bool)>,
    /// Where the motor is at step zero: changes when it is turned without power.
    motor_zero: f64,
    pub load: f64,
    pub switch: HomeSwitch,
    pub hard_limit: bool,
    /// What the motor driver says of itself.
    pub driver: DriverState,
    /// Positions at and beyond which the hard limit is reached.
    pub hard_limits: [f64; 2],
    /// The load stands still whatever the motor does; let go, it springs to the motor.
    pub blocked: bool,
    /// The encoder reads wrong by this much.
    pub misread: f64,
    /// The load goes so much of the way that the motor goes.
    pub grip: f64,
    /// Direction of the motor and of the encoder as wired.
    pub reversed: [bool; 2],
}

impl IdealAxis {
    fn new(settings: &AxisSettings, load: f64, raw: [i32; 2]) -> Self {
        Self {
            motor: per_micro(settings.motor()),
            encoder: per_micro(settings.encoder()),
            switch_at: f64::from(settings.homing.switch_at.0),
            switches: settings.switches,
            raw_steps: raw[0],
            raw_counts: raw[1],
            steps: 0,
            ordered: 0,
            queue: VecDeque::new(),
            log: Vec::new(),
            motor_zero: load,
            load,
            switch: HomeSwitch::Good,
            hard_limit: false,
            driver: DriverState::Plain,
            hard_limits: [f64::NEG_INFINITY, f64::INFINITY],
            blocked: false,
            misread: 0.0,
            grip: 1.0,
            reversed: [settings.steps_reversed, settings.counts_reversed],
        }
    }

    fn reach(&mut self, now: u64) {
        let before = self.steps;
        while let Some((_, forward)) = self.queue.pop_front_if(|(at, _)| *at <= now * 1000) {
            self.steps += if forward { 1 } else { -1 };
        }
        self.motor_zero -= (1.0 - self.grip) * f64::from(self.steps - before) / self.motor;
        if !self.blocked {
            self.load = self.motor_zero + f64::from(self.steps) / self.motor;
        }
    }

    /// Length of a step.
    pub fn step(&self) -> f64 {
        1.0 / self.motor
    }

    /// Whether the home switch is operated.
    pub fn closed(&self) -> bool {
        match (self.switch, self.switches.home_end) {
            (HomeSwitch::Good, HomeEnd::Low) => self.load <= self.switch_at,
            (HomeSwitch::Good, HomeEnd::High) => self.load >= self.switch_at,
            (HomeSwitch::NeverCloses, _) => false,
            (HomeSwitch::StuckClosed, _) => true,
        }
    }
}

#[derive(Clone, Debug)]
pub struct IdealRig {
    pub axes: Vec<IdealAxis>,
    pub drivers: bool,
    pub emergency_stop: bool,
    /// The wires of the first two home switches have changed places.
    pub crossed_switches: bool,
    now: u64,
    /// Orders to motors without drivers: there must be none.
    pub orders_without_drivers: u32,
    /// The drivers were switched since the last look.
    pub switched: bool,
}

impl IdealRig {
    /// Raw steps and counts begin near the ends of their range: only differences may count.
    pub fn new(settings: &[AxisSettings], loads: &[f64]) -> Self {
        let raw = [i32::MAX - 1_000, i32::MIN + 1_000];
        Self {
            axes: settings.iter().zip(loads).map(|(axis, &load)| IdealAxis::new(axis, load, raw)).collect(),
            drivers: false,
            emergency_stop: false,
            crossed_switches: false,
            now: 0,
            orders_without_drivers: 0,
            switched: false,
        }
    }

    /// Lets time pass until `now`.
    pub fn reach(&mut self, now: Microseconds) {
        self.now = now.0;
        self.axes.iter_mut().for_each(|axis| axis.reach(now.0));
        if self.emergency_stop {
            self.freeze();
        }
    }

    /// Moves a load by hand; only a stage without power gives way.
    pub fn push(&mut self, axis: usize, by: f64) {
        if !self.drivers {
            let axis = &mut self.axes[axis];
            axis.load += by;
            axis.motor_zero += by;
        }
    }

    /// Motors without power make no more steps.
    fn freeze(&mut self) {
        for axis in &mut self.axes {
            axis.queue.clear();
            axis.ordered = axis.steps;
            // And a blocked load turns them back.
            axis.motor_zero = axis.load - f64::from(axis.steps) / axis.motor;
        }
    }
}

impl RigIo for IdealRig {
    fn set_drivers(&mut self, on: bool) {
        self.switched |= self.drivers != on;
        self.drivers = on;
        self.freeze();
    }

    fn schedule_steps(&mut self, axis: usize, steps: &StepSchedule) {
        self.orders_without_drivers += u32::from(!self.drivers);
        assert!(steps.start.0 >= self.now && steps.start.0 <= self.now + 1_000, "{steps:?} at {}", self.now);
        assert!(steps.at_ns.is_sorted() && steps.at_ns.iter().all(|&at| at < 1_000_000), "{steps:?}");
        let axis = &mut self.axes[axis];
        let forward = steps.forward != axis.reversed[0];
        let count = steps.at_ns.len() as i32;
        axis.ordered += if forward { count } else { -count };
        let due = steps.at_ns.iter().map(|&at| (steps.start.0 * 1000 + u64::from(at), forward));
        axis.queue.extend(due.clone());
        axis.log.extend(due);
    }

    fn steps(&self, axis: usize) -> i32 {
        self.axes[axis].steps.wrapping_add(self.axes[axis].raw_steps)
    }

    fn encoder(&self, axis: usize) -> i32 {
        let axis = &self.axes[axis];
        let counts = ((axis.load + axis.misread) * axis.encoder).floor() as i32;
        let counts = if axis.reversed[1] { -counts } else { counts };
        counts.wrapping_add(axis.raw_counts)
    }

    fn home_switch(&self, axis: usize) -> bool {
        let wire = if self.crossed_switches { 1 - axis } else { axis };
        let axis = &self.axes[wire];
        axis.closed() == (axis.switches.home == HomeSensor::NormallyOpen)
    }

    fn hard_limit(&self, axis: usize) -> bool {
        let IdealAxis { hard_limit, hard_limits: [low, high], load, switches, .. } = self.axes[axis];
        (hard_limit || load <= low || load >= high) != switches.limits_normally_open
    }

    fn driver(&self, axis: usize) -> DriverState {
        self.axes[axis].driver
    }

    fn emergency_stop(&self) -> bool {
        self.emergency_stop
    }
}

/// Counts or steps for each micro-unit.
pub fn per_micro(scale: Scale) -> f64 {
    let unit = match scale.kind {
        AxisKind::Linear => 1e6,
        AxisKind::Rotary => TAU * 1e6,
    };
    f64::from(scale.per_unit) / unit
}
