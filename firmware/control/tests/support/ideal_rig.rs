//! Motors that lose nothing, loads that follow at once, and toggles for everything that can go wrong.

use std::f64::consts::TAU;

use vergence_control::{AxisSettings, RigIo, Scale};
use vergence_protocol::{AxisKind, Microseconds};

/// How a home switch behaves.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum HomeSwitch {
    /// Closes at its place and below.
    Good,
    NeverCloses,
    StuckClosed,
}

/// A line of steps: from where and when, to where and when.
#[derive(Clone, Copy, Debug)]
struct Order {
    from: (i32, u64),
    to: (i32, u64),
}

#[derive(Clone, Debug)]
pub struct IdealAxis {
    motor: f64,
    encoder: f64,
    pub switch_at: f64,
    /// Raw numbers at power-on.
    raw_steps: i32,
    raw_counts: i32,
    /// Steps since power-on.
    steps: i32,
    order: Order,
    /// Where the motor is at step zero: changes when it is turned without power.
    motor_zero: f64,
    pub load: f64,
    pub switch: HomeSwitch,
    pub hard_limit: bool,
    /// The load stands still whatever the motor does; let go, it springs to the motor.
    pub blocked: bool,
    /// The encoder reads wrong by this much.
    pub misread: f64,
    /// Where the motor was last told to be at the end of its tick, in axis coordinates.
    pub commanded: f64,
    /// Where the motor stood when the drivers were last switched.
    pub held: f64,
}

impl IdealAxis {
    fn new(settings: &AxisSettings, load: f64, raw: [i32; 2]) -> Self {
        Self {
            motor: per_micro(settings.motor()),
            encoder: per_micro(settings.encoder()),
            switch_at: f64::from(settings.homing.switch_at.0),
            raw_steps: raw[0],
            raw_counts: raw[1],
            steps: 0,
            order: Order { from: (0, 0), to: (0, 0) },
            motor_zero: load,
            load,
            switch: HomeSwitch::Good,
            hard_limit: false,
            blocked: false,
            misread: 0.0,
            commanded: load,
            held: load,
        }
    }

    fn reach(&mut self, now: u64) {
        let Order { from, to } = self.order;
        self.steps = if now >= to.1 {
            to.0
        } else {
            let share = (now - from.1) as f64 / (to.1 - from.1) as f64;
            from.0 + (f64::from(to.0 - from.0) * share).round() as i32
        };
        let motor = self.motor_zero + f64::from(self.steps) / self.motor;
        if !self.blocked {
            self.load = motor;
        }
    }

    pub fn closed(&self) -> bool {
        match self.switch {
            HomeSwitch::Good => self.load <= self.switch_at,
            HomeSwitch::NeverCloses => false,
            HomeSwitch::StuckClosed => true,
        }
    }
}

#[derive(Clone, Debug)]
pub struct IdealRig {
    pub axes: Vec<IdealAxis>,
    pub drivers: bool,
    pub emergency_stop: bool,
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
            axis.held += by;
            axis.commanded += by;
        }
    }

    /// Motors without power make no more steps.
    fn freeze(&mut self) {
        for axis in &mut self.axes {
            axis.order = Order { from: (axis.steps, self.now), to: (axis.steps, self.now) };
            // And a blocked load turns them back.
            axis.motor_zero = axis.load - f64::from(axis.steps) / axis.motor;
            axis.held = axis.load;
            axis.commanded = axis.load;
        }
    }
}

impl RigIo for IdealRig {
    fn set_drivers(&mut self, on: bool) {
        self.switched |= self.drivers != on;
        self.drivers = on;
        self.freeze();
    }

    fn step_to(&mut self, axis: usize, steps: i32, by: Microseconds) {
        self.orders_without_drivers += u32::from(!self.drivers);
        let now = self.now;
        let axis = &mut self.axes[axis];
        let steps = steps.wrapping_sub(axis.raw_steps);
        axis.order = Order { from: (axis.steps, now), to: (steps, by.0) };
        axis.commanded = axis.motor_zero + f64::from(steps) / axis.motor;
    }

    fn steps(&self, axis: usize) -> i32 {
        self.axes[axis].steps.wrapping_add(self.axes[axis].raw_steps)
    }

    fn encoder(&self, axis: usize) -> i32 {
        let axis = &self.axes[axis];
        let counts = ((axis.load + axis.misread) * axis.encoder).floor() as i32;
        counts.wrapping_add(axis.raw_counts)
    }

    fn home_switch(&self, axis: usize) -> bool {
        self.axes[axis].closed()
    }

    fn hard_limit(&self, axis: usize) -> bool {
        self.axes[axis].hard_limit
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
