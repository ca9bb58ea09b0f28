//! A scenario: the script of the host, the faults, and the positions of the stages at the start.

use std::ops::RangeInclusive;

use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64Mcg;
use vergence_protocol::{Micro, Mode, Permille, SettingItem, SettingKey};

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
    /// A request that moves nothing.
    Errand(Errand),
    /// Disarm.
    Disarm,
}

/// A request that moves nothing.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Errand {
    /// Fires the cameras with this period in microseconds from now on, or never with 0.
    Trigger(u32),
    /// Changes a setting and saves all settings, which needs the drivers off.
    Set(SettingKey, i64),
    /// Begins a firmware update, during which nothing may be armed, and lets it lapse.
    Update,
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
    /// Time between two probes of the board's clock, in microseconds.
    pub probe_us: Option<u64>,
}

impl Scenario {
    /// Draws the scenario of a seed.
    #[must_use]
    pub fn of(seed: u64) -> Self {
        let random = &mut Pcg64Mcg::seed_from_u64(seed);
        let kind = FaultKind::ALL[random.random_range(0..FaultKind::ALL.len())];
        Self::draw(seed, kind, random)
    }

    /// Draws a scenario with this kind of fault.
    #[must_use]
    pub fn of_kind(seed: u64, kind: FaultKind) -> Self {
        Self::draw(seed, kind, &mut Pcg64Mcg::seed_from_u64(seed))
    }

    fn draw(seed: u64, kind: FaultKind, random: &mut Pcg64Mcg) -> Self {
        let mut script = script(random);
        let faults = Fault::draw(kind, script.len(), random);
        for fault in &faults {
            if let Fault::RashJog(by) = fault
                && let Some(home) = script.iter().position(|step| *step == Step::Home)
            {
                script.insert(home, Step::Jog(*by));
            }
        }
        Self {
            seed,
            kind,
            faults,
            script,
            positions: positions(random),
            latency_us: random.random_range(100..3_000),
            phase_us: random.random_range(1..1_000),
            probe_us: random.random_bool(0.5).then(|| random.random_range(2_000..200_000)),
        }
    }
}

/// Positions in micro-units that a move may ask for, of each axis.
type Ranges = [RangeInclusive<i32>; 2];

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
    let mut ranges = stages().map(|stage| stage.settings.min.0..=stage.settings.max.0);
    for _ in 0..random.random_range(1..=3) {
        if random.random_bool(0.4) {
            script.push(Step::Errand(errand(&mut ranges, random)));
        }
        script.push(excursion(&ranges, random));
    }
    if random.random_bool(0.5) {
        script.push(Step::Disarm);
    }
    script
}

fn excursion(ranges: &Ranges, random: &mut Pcg64Mcg) -> Step {
    match random.random_range(0..15) {
        10..14 => Step::Retarget(anywhere(ranges, random), in_mid_move(1_500_000, random), anywhere(ranges, random)),
        14 => Step::Jog([30_000, 400_000].map(|most| Micro(random.random_range(-most..most)))),
        0..5 => Step::Move(anywhere(ranges, random)),
        5..7 => Step::MoveAndStop(anywhere(ranges, random), in_mid_move(800_000, random)),
        7 => Step::MoveTooFar(too_far(ranges, random)),
        8 => Step::Pause(random.random_range(10_000..500_000)),
        _ => Step::Disarm,
    }
}

/// Microseconds after the begin of a move, often so few that it is still being planned.
fn in_mid_move(longest: u64, random: &mut Pcg64Mcg) -> u64 {
    let most = if random.random_bool(0.3) { 10_000 } else { longest };
    random.random_range(1_000..most)
}

/// A request that moves nothing; `ranges` are the positions that moves may ask for afterwards.
fn errand(ranges: &mut Ranges, random: &mut Pcg64Mcg) -> Errand {
    let axis = random.random_range(0..ranges.len());
    let key = |item| SettingKey { item, axis: axis as u8 };
    match random.random_range(0..8) {
        0..2 => Errand::Trigger([0, 2_000, 10_000, 33_333][random.random_range(0..4)]),
        2..4 => {
            let speed = f64::from(stages()[axis].settings.speed) * random.random_range(0.5..1.0);
            Errand::Set(key(SettingItem::Speed), speed as i64)
        }
        4..7 => {
            let (min, max) = (*ranges[axis].start(), *ranges[axis].end());
            let narrower = max - random.random_range(0..(max - min) / 4);
            ranges[axis] = min..=narrower;
            Errand::Set(key(SettingItem::Max), narrower.into())
        }
        _ => Errand::Update,
    }
}

fn anywhere(ranges: &Ranges, random: &mut Pcg64Mcg) -> Destination {
    let targets = ranges.each_ref().map(|range| Micro(random.random_range(range.clone())));
    Destination { mode: ANYWHERE, targets, speed: Permille(random.random_range(400..=1000)) }
}

/// A target beyond the range of one axis, by up to a quarter of the range.
fn too_far(ranges: &Ranges, random: &mut Pcg64Mcg) -> Destination {
    let mut destination = anywhere(ranges, random);
    let axis = random.random_range(0..destination.targets.len());
    let (min, max) = (*ranges[axis].start(), *ranges[axis].end());
    let beyond = random.random_range(1..(max - min) / 4);
    let target = if random.random_bool(0.5) { min - beyond } else { max + beyond };
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
