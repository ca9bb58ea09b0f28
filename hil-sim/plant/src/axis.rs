//! One axis of the mechanics: motor, transmission, encoder and switches.

mod encoders;

use std::collections::VecDeque;

use vergence_control::{As5048a, HomeEnd, IndexEdges, Scale, StepSchedule};
use vergence_protocol::{AxisKind, Microseconds};

use crate::as5048a::As5048aChip;
use crate::encoder::{Encoder, EncoderFault};
use crate::ends::{StopMechanics, SwitchMechanics};
use crate::switch::{Switch, SwitchNoise};

/// The mechanics of one axis. Positions are axis coordinates in micro-units (µm or µrad).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct AxisMechanics {
    /// Motor steps along the axis.
    pub motor: Scale,
    /// Encoder counts along the axis; the encoder is on the load.
    pub encoder: Scale,
    /// Play between motor and load.
    pub backlash: f64,
    /// Errors of the screw or pinion between motor and load.
    pub pitch: PitchError,
    /// Play between the encoder and the stage that it stands for, such as of a rack behind its pinion.
    pub encoder_play: f64,
    /// Errors of the encoder's scale: how much further it reads than the load is.
    pub scale: PitchError,
    /// Marks of the scale from one index pulse to the next, 0 for none, and how long a pulse is high.
    pub index: [i32; 2],
    /// Time constant with which the load follows the motor, in seconds, above zero.
    pub compliance: f64,
    /// Position at and beyond which the home switch is operated.
    pub home_switch: f64,
    /// Ends and contacts of the switches.
    pub switches: SwitchMechanics,
    /// Positions at and outside of which the hard limit switches are operated.
    pub hard_limits: [f64; 2],
    /// Mechanical end stops; a motor that pushes the load against one loses steps.
    pub end_stops: [f64; 2],
    /// What the end stops do to a motor that pushes.
    pub stop: StopMechanics,
}

impl AxisMechanics {
    /// Whether the home switch is operated where the load is at `position`.
    fn is_home(&self, position: f64) -> bool {
        match self.switches.home_end {
            HomeEnd::Low => position <= self.home_switch,
            HomeEnd::High => position >= self.home_switch,
        }
    }
}

/// Step pulses, a full step and more at up to 64 microsteps, in which a rotor that was thrown out of step gives its driver
/// no other sign than a standing one.
const TREMBLING_STEPS: u32 = 64;

/// How far a screw or pinion leads the load beside where a perfect one would, in micro-units.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct PitchError {
    /// Error that grows with the position: micro-units for each micro-unit.
    pub lead: f64,
    /// Largest error that returns with each period, such as of a turn of the screw.
    pub wobble: f64,
    /// That period in micro-units; of no effect where `wobble` is zero.
    pub period: f64,
}

impl PitchError {
    /// The error at a position.
    #[must_use]
    pub fn at(&self, position: f64) -> f64 {
        let turn = if self.wobble == 0.0 { 0.0 } else { std::f64::consts::TAU * position / self.period };
        self.lead * position + self.wobble * turn.sin()
    }
}

/// The state of one axis.
#[derive(Clone, Debug)]
pub struct AxisPlant {
    mechanics: AxisMechanics,
    /// Steps ordered and not made yet: when, in nanoseconds, and whether forward.
    ordered: VecDeque<(u64, bool)>,
    /// Steps made so far.
    steps: i32,
    /// Axis position of motor step zero; changes when steps are lost.
    motor_zero: f64,
    /// Error of the pitch where the axis started: only differences move the load.
    pitch_zero: f64,
    /// Positions of the scale of the encoder and of the stage.
    load: f64,
    stage: f64,
    encoder: Encoder,
    /// Edges of the index line since they were last taken.
    index_edges: IndexEdges,
    /// An absolute encoder beside the scale, and what the native board has read of it, where it reads it.
    magnet: Option<As5048aChip>,
    reader: Option<As5048a>,
    home: Switch,
    /// Reading of a hard limit that does not follow the load.
    limit_fixed: Option<bool>,
    blocked: bool,
    stalled: bool,
    /// Steps that the rotor will miss.
    to_lose: u32,
    /// Share of every step by which the coupling slips.
    slips: f64,
    /// Share of the motor's largest force with which an end stop or a wedged load held it in the last advance.
    pressed: f64,
    /// Steps still to be made until a rotor that has lost its step turns with its field again.
    trembles: u32,
    /// Times of the last two steps in nanoseconds.
    last_steps: [u64; 2],
    /// Way of a step pulse, in steps of the motor's scale; not 1 where the driver has other microsteps, or drives nothing.
    step_size: f64,
    /// The steps made since they were last taken, where they are recorded.
    made: Option<Vec<StepMade>>,
}

/// One step of a motor.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct StepMade {
    /// Time of the step on the clock of the plant, in nanoseconds.
    pub at_ns: u64,
    /// Whether the raw step count rose.
    pub forward: bool,
}

impl AxisPlant {
    /// An axis at rest at `position`, where the encoder starts at count zero.
    #[must_use]
    pub fn new(mechanics: AxisMechanics, position: f64) -> Self {
        Self {
            mechanics,
            ordered: VecDeque::new(),
            steps: 0,
            motor_zero: position,
            pitch_zero: mechanics.pitch.at(position),
            load: position,
            stage: position,
            encoder: Encoder::new(scale_reading(&mechanics, position)),
            index_edges: IndexEdges::new(),
            magnet: None,
            reader: None,
            home: Switch::new(mechanics.is_home(position)),
            limit_fixed: None,
            blocked: false,
            stalled: false,
            to_lose: 0,
            slips: 0.0,
            pressed: 0.0,
            trembles: 0,
            last_steps: [0; 2],
            step_size: 1.0,
            made: None,
        }
    }

    /// Records the instants of all steps from now on.
    pub fn record_steps(&mut self) {
        self.made.get_or_insert_default();
    }

    /// Takes the steps recorded since the last call, in order; empty where nothing is recorded.
    pub fn take_steps(&mut self) -> Vec<StepMade> {
        self.made.as_mut().map(std::mem::take).unwrap_or_default()
    }

    /// Lets a failed encoder count again from the count that it shows, as after its cable was mended or its supply returned:
    /// its counter does not jump, and what was moved meanwhile was never counted.
    pub fn mend_encoder(&mut self) {
        self.encoder.go_on(self.scale_reading());
    }

    /// Counts from zero again, as an encoder's counter does whose chip restarts.
    pub fn restart_encoder(&mut self) {
        self.reader = None;
        self.encoder.restart(self.scale_reading());
    }

    /// The true position of the load.
    #[must_use]
    pub fn load(&self) -> f64 {
        self.load
    }

    /// The true position of the stage, which lags behind the load by the play between them.
    #[must_use]
    pub fn stage(&self) -> f64 {
        self.stage
    }

    /// The raw encoder count.
    #[must_use]
    pub fn encoder(&self) -> i32 {
        self.reader.map_or_else(|| self.encoder.raw(self.scale_reading()), |reader| reader.count())
    }

    fn scale_reading(&self) -> i32 {
        scale_reading(&self.mechanics, self.load)
    }

    /// Steps made so far.
    #[must_use]
    pub fn steps(&self) -> i32 {
        self.steps
    }

    /// Orders steps, each at its instant.
    pub fn schedule(&mut self, steps: &StepSchedule) {
        let due = steps.at_ns.iter().map(|&after| (steps.start.0 * 1000 + u64::from(after), steps.forward));
        self.ordered.extend(due);
    }

    /// Drops the steps not made yet, as at power-off and power-on.
    pub fn drop_order(&mut self) {
        self.ordered.clear();
    }

    /// Wedges the load where it is, or frees it: a motor that pulls on a wedged load loses steps.
    pub fn block(&mut self, blocked: bool) {
        self.blocked = blocked;
    }

    /// Lets the rotor stand while steps are made, or turn again where it stands.
    pub fn stall(&mut self, stalled: bool) {
        self.stalled = stalled;
    }

    /// Lets the rotor miss the next `steps` steps; a motor at rest loses none.
    pub fn lose_steps(&mut self, steps: u32) {
        self.to_lose += steps;
    }

    /// Lets the rotor miss no more steps.
    pub fn keep_steps(&mut self) {
        self.to_lose = 0;
    }

    /// Lets the coupling slip by `share` of every step; 0 makes it hold again.
    pub fn slip(&mut self, share: f64) {
        self.slips = share;
    }

    /// Sets the way of a step pulse, in steps of the motor's scale.
    pub fn set_step_size(&mut self, size: f64) {
        self.step_size = size;
    }

    /// Makes the encoder fail from now on, or work again.
    pub fn fail_encoder(&mut self, fault: Option<EncoderFault>) {
        self.encoder.fail(fault, self.scale_reading());
    }

    /// Adds chatter and spikes to the home switch from now on, or removes them.
    pub fn disturb_home_switch(&mut self, noise: Option<SwitchNoise>) {
        self.home.disturb(noise);
    }

    /// Fixes the reading of the home switch from now on, or lets it follow its contact again.
    pub fn fix_home_switch(&mut self, reading: Option<bool>) {
        self.home.fix(reading);
    }

    /// Whether the home switch is read as operated.
    #[must_use]
    pub fn home_switch(&self) -> bool {
        self.home.reads_closed()
    }

    /// Whether the line of the home switch is low: its contact is closed.
    #[must_use]
    pub fn home_line_is_low(&self) -> bool {
        self.home.reads_closed() != self.mechanics.switches.home_normally_closed
    }

    /// Share of its largest force that the motor needs against an end stop or a wedged load, 0 to 1.
    #[must_use]
    pub fn pressed(&self) -> f64 {
        if self.trembles > 0 { 1.0 } else { self.pressed }
    }

    /// Times of the last two steps on the clock of the plant in nanoseconds, the later one first.
    #[must_use]
    pub fn last_steps(&self) -> [u64; 2] {
        self.last_steps
    }

    /// Fixes the reading of the hard limit from now on, or lets it follow the load again.
    pub fn fix_hard_limit(&mut self, reading: Option<bool>) {
        self.limit_fixed = reading;
    }

    /// Whether a hard limit is reached.
    #[must_use]
    pub fn hard_limit(&self) -> bool {
        let [low, high] = self.mechanics.hard_limits;
        self.limit_fixed.unwrap_or(self.load <= low || self.load >= high)
    }

    /// Whether the line of the hard limit is high: its contact is open.
    #[must_use]
    pub fn limit_line_is_high(&self) -> bool {
        self.hard_limit() != self.mechanics.switches.limits_normally_open
    }

    /// Lets time pass from `from` to `to`; without drivers the motor does not turn.
    pub fn advance(&mut self, from: Microseconds, to: Microseconds, drivers_on: bool) {
        if drivers_on {
            self.turn_motor(to);
        }
        let turned = self.motor_zero + f64::from(self.steps) / counts_per_micro(self.mechanics.motor);
        let motor = turned + self.mechanics.pitch.at(turned) - self.pitch_zero;
        let play = self.mechanics.backlash / 2.0;
        // Inside the play the load is at rest; outside, the transmission pulls it after the motor.
        let pulled = self.load.clamp(motor - play, motor + play);
        let dt = (to.0 - from.0) as f64 * 1e-6;
        // Most encoders have no index, and this runs each 20 us.
        let before = (self.mechanics.index[0] > 0).then(|| self.scale_reading());
        let share = 1.0 - (-dt / self.mechanics.compliance).exp();
        let (held_by, give) = match self.blocked {
            true => ([self.load; 2], 0.0),
            false => (self.mechanics.end_stops, self.mechanics.stop.give),
        };
        self.load += (pulled - self.load) * share;
        self.strike(held_by, give, motor);
        let play = self.mechanics.encoder_play / 2.0;
        self.stage = self.stage.clamp(self.load - play, self.load + play);
        self.encoder.advance();
        if let Some(before) = before {
            self.pass_index(before, self.scale_reading());
        }
        self.home.advance(self.mechanics.is_home(self.load), to.0 - from.0);
    }

    fn turn_motor(&mut self, to: Microseconds) {
        let step = 1.0 / counts_per_micro(self.mechanics.motor);
        while let Some((at_ns, forward)) = self.ordered.pop_front_if(|(at, _)| *at <= to.0 * 1000) {
            let by = if forward { 1 } else { -1 };
            self.steps += by;
            self.last_steps = [at_ns, self.last_steps[0]];
            self.trembles = self.trembles.saturating_sub(1);
            if let Some(made) = &mut self.made {
                made.push(StepMade { at_ns, forward });
            }
            let turned = if self.stalled || self.to_lose > 0 { 0.0 } else { (1.0 - self.slips) * self.step_size };
            let lost = 1.0 - turned;
            self.to_lose = self.to_lose.saturating_sub(1);
            self.motor_zero -= f64::from(by) * step * lost;
        }
    }

    /// Keeps a load at an obstacle that yields by `give` at most; a motor that pulls further loses steps.
    fn strike(&mut self, [low, high]: [f64; 2], give: f64, motor: f64) {
        let deep = (low - self.load).max(self.load - high).max(0.0);
        self.pressed = if deep < give { deep / give } else { f64::from(u8::from(deep > 0.0)) };
        if deep > give {
            let outward = if self.load < low { -1.0 } else { 1.0 };
            self.load = self.load.clamp(low - give, high + give);
            let slack = self.mechanics.backlash / 2.0;
            let reachable = motor.clamp(self.load - slack, self.load + slack);
            if (motor - reachable).abs() > 0.0 {
                self.motor_zero += reachable - outward * self.mechanics.stop.fall_back - motor;
                self.trembles = TREMBLING_STEPS;
            }
        }
    }
}

/// The mark of the scale of an axis's encoder at a position of the load.
fn scale_reading(mechanics: &AxisMechanics, position: f64) -> i32 {
    ((position + mechanics.scale.at(position)) * counts_per_micro(mechanics.encoder)).floor() as i32
}

/// Counts (or steps) for each micro-unit of the axis.
fn counts_per_micro(scale: Scale) -> f64 {
    let micro_units = match scale.kind {
        AxisKind::Linear => 1e6,
        AxisKind::Rotary => std::f64::consts::TAU * 1e6,
    };
    f64::from(scale.per_unit) / micro_units
}
