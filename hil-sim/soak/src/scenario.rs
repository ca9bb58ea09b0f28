//! A scenario: the script of the host, the faults, and the positions of the stages at the start.

use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64Mcg;
use vergence_protocol::{Micro, Mode, Permille};

use crate::faults::{Fault, FaultKind};
use crate::stages::stages;

/// Baseline in micrometres, separation in microradians.
const HERBIVORE: Destination =
    Destination { mode: Mode(1), targets: [Micro(145_000), Micro(2_094_395)], speed: Permille::FULL };
const HUMAN: Destination = Destination { mode: Mode(2), targets: [Micro(145_000), Micro(0)], speed: Permille::FULL };
/// Modes of random places.
const ANYWHERE: Mode = Mode(3);

/// The target of a move.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Destination {
    /// The mode that the target is.
    pub mode: Mode,
    /// Target of each axis.
    pub targets: [Micro; 2],
    /// Share of full speed.
    pub speed: Permille,
}

/// One step of the script. The host arms, homes and clears faults by itself where a step needs it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Step {
    /// Ask for a move while disarmed or without reference: it must be refused. Skipped where the board is armed and
    /// referenced.
    MoveTooEarly(Destination),
    /// Arm.
    Arm,
    /// Homes all axes.
    Home,
    /// Go to the target and wait for its mode.
    Move(Destination),
    /// Requests a target beyond the range, which must be refused.
    MoveTooFar(Destination),
    /// Go to the first target and, after so many microseconds in mid-move, to the second.
    Retarget(Destination, u64, Destination),
    /// Go by so much on each axis, at full speed; skipped where that would leave the range.
    Jog([Micro; 2]),
    /// Go to the target but stop after so many microseconds.
    MoveAndStop(Destination, u64),
    /// Waits for this many microseconds.
    Pause(u64),
    /// Disarm.
    Disarm,
}

/// One scenario.
#[derive(Clone, Debug, PartialEq)]
pub struct Scenario {
    /// The seed from which the scenario was drawn.
    pub seed: u64,
    /// The kind of fault that it counts as.
    pub kind: FaultKind,
    /// The faults.
    pub faults: Vec<Fault>,
    /// The script of the host.
    pub script: Vec<Step>,
    /// Positions of the stages at the start, in micro-units.
    pub positions: [f64; 2],
    /// Least delay of bytes in adapter and driver, in microseconds; their time on the wire is added.
    pub latency_us: u64,
    /// Offset between the board's ticks and the instants at which the host runs, in microseconds.
    pub phase_us: u64,
}

impl Scenario {
    /// Draws the scenario of a seed.
    #[must_use]
    pub fn of(seed: u64) -> Self {
        let random = &mut Pcg64Mcg::seed_from_u64(seed);
        let kind = FaultKind::ALL[random.random_range(0..FaultKind::ALL.len())];
        let script = script(random);
        Self {
            seed,
            kind,
            faults: Fault::draw(kind, script.len(), random),
            script,
            positions: positions(random),
            latency_us: random.random_range(100..3_000),
            phase_us: random.random_range(1..1_000),
        }
    }
}

fn script(random: &mut Pcg64Mcg) -> Vec<Step> {
    let mut script = Vec::new();
    if random.random_bool(0.3) {
        script.push(Step::MoveTooEarly(HERBIVORE));
    }
    script.push(Step::Arm);
    if random.random_bool(0.3) {
        script.push(Step::MoveTooEarly(HUMAN));
    }
    if random.random_bool(0.3) {
        // Upwards only, and less than from the highest start to the hard limit: without reference no limit is checked.
        script.push(Step::Jog([2_000, 35_000].map(|most| Micro(random.random_range(0..most)))));
    }
    script.push(Step::Home);
    let tour = [Step::Move(HERBIVORE), Step::Move(HUMAN)];
    script.extend(if random.random_bool(0.5) { &tour[..] } else { &tour[..1] });
    for _ in 0..random.random_range(1..=3) {
        script.push(excursion(random));
    }
    if random.random_bool(0.5) {
        script.push(Step::Disarm);
    }
    script
}

fn excursion(random: &mut Pcg64Mcg) -> Step {
    match random.random_range(0..15) {
        10..14 => Step::Retarget(anywhere(random), random.random_range(1_000..1_500_000), anywhere(random)),
        14 => Step::Jog([30_000, 400_000].map(|most| Micro(random.random_range(-most..most)))),
        0..5 => Step::Move(anywhere(random)),
        5..7 => Step::MoveAndStop(anywhere(random), random.random_range(1_000..800_000)),
        7 => Step::MoveTooFar(too_far(random)),
        8 => Step::Pause(random.random_range(10_000..500_000)),
        _ => Step::Disarm,
    }
}

fn anywhere(random: &mut Pcg64Mcg) -> Destination {
    let targets = stages().map(|stage| Micro(random.random_range(stage.settings.min.0..=stage.settings.max.0)));
    Destination { mode: ANYWHERE, targets, speed: Permille(random.random_range(400..=1000)) }
}

/// A target beyond the range of one axis, by up to a quarter of the range.
fn too_far(random: &mut Pcg64Mcg) -> Destination {
    let mut destination = anywhere(random);
    let axis = random.random_range(0..destination.targets.len());
    let settings = stages()[axis].settings;
    let beyond = random.random_range(1..(settings.max.0 - settings.min.0) / 4);
    let target = if random.random_bool(0.5) { settings.min.0 - beyond } else { settings.max.0 + beyond };
    destination.targets[axis] = Micro(target);
    destination
}

/// A start position from just off the mechanical end to the end of the range; mostly low, where homing is quick.
fn positions(random: &mut Pcg64Mcg) -> [f64; 2] {
    stages().map(|stage| {
        let low = f64::midpoint(stage.mechanics.home_switch, stage.mechanics.hard_limits[0]);
        let share: f64 = random.random::<f64>().powi(3);
        low + share * (f64::from(stage.settings.max.0) - low)
    })
}
