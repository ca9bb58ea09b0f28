//! Compares what the two boards say and do, as soon as both have.

use vergence_control::{RigIo, TICK_US};
use vergence_protocol::{ControllerState, PoseReport};

use super::difference::{Difference, Figures};
use super::messages;
use super::pair::{Pair, Snapshot};
use super::side::Stream;
use super::slack::{HOMING_TICKS, LAG_LIMIT_TICKS, Slack, apart};
use super::steps::{Moment, Steps};

/// Longest time in microseconds from a message of one board to the same of the other: a page of flash is erased meanwhile.
const PATIENCE_US: u64 = 300_000;
/// Ticks after which a pose is compared, so that later ticks of the native board are known.
const LATER_TICKS: u64 = HOMING_TICKS + 3;
/// Time in microseconds without steps after which motors and loads are at rest.
const REST_US: u64 = 60_000;
/// Most microseconds by which a tick may come late without a fault.
const LATE_US: u64 = 200;

/// Reasons why the boards may be some ticks apart, until the next rest.
#[derive(Clone, Copy, Debug, Default)]
pub struct Apart {
    /// An axis searches its home switch.
    pub homing: bool,
    /// The mechanics fail, and an encoder or a switch shows it.
    pub failing: bool,
    /// A tick came late.
    pub late: bool,
    /// The largest following error was set to no more than the lag of a sound load.
    pub at_the_lag: bool,
}

impl Apart {
    /// Whether the encoders of both boards may show a fault some ticks apart.
    pub fn in_faults(self) -> bool {
        self.failing || self.at_the_lag
    }

    /// Most ticks from an event on one board to the same on the other.
    pub fn ticks(self) -> u64 {
        match self {
            Self { homing: true, .. } => HOMING_TICKS,
            Self { at_the_lag: true, .. } => LAG_LIMIT_TICKS,
            Self { failing: true, .. } => 3,
            // The encoders come into the tolerance, and stay.
            _ => 1,
        }
    }
}

/// The running comparison.
#[derive(Debug)]
pub struct Comparison {
    /// The clock of the chip less that of the native board, in microseconds, once poses have shown it.
    pub clocks: Option<i64>,
    pub slack: Slack,
    pub apart: Apart,
    /// Whether the boards have given different names to a failure between a stall and a slip.
    pub named_apart: bool,
    pub figures: Figures,
    steps: [Steps; 2],
    /// Chip's motor steps less those of the native board, at the last rest.
    offsets: [i32; 2],
    last: Option<Snapshot>,
    moved_at_us: u64,
}

impl Comparison {
    pub fn new() -> Self {
        Self {
            clocks: None,
            slack: Slack::new(),
            apart: Apart::default(),
            named_apart: false,
            figures: Figures::default(),
            steps: [Steps::default(), Steps::default()],
            offsets: [0; 2],
            last: None,
            moved_at_us: 0,
        }
    }

    /// The boards have restarted: their clocks are new, and the chip's counters begin where the stages stand.
    pub fn restarted(&mut self, pair: &Pair) {
        self.clocks = None;
        self.last = None;
        self.forget_motion(pair);
        self.slack.restarted();
    }

    /// Compares all that both boards have said and done since the last call.
    pub fn compare(&mut self, pair: &mut Pair) -> Result<(), Difference> {
        self.follow(pair);
        self.compare_steps(pair)?;
        self.find_clocks(pair);
        if self.clocks.is_some() {
            self.compare_messages(pair)?;
            self.compare_poses(pair)?;
        }
        self.compare_rest(pair)
    }

    /// An error where one board has said something that the other has not.
    pub fn compare_end(&self, pair: &Pair) -> Result<(), Difference> {
        for stream in Stream::ALL {
            let [native, chip] = [0, 1].map(|side: usize| pair.sides[side].first(stream));
            if native.is_some() || chip.is_some() {
                return Err(Difference::new(format!("a message ({stream:?})"), native, chip));
            }
        }
        Ok(())
    }

    /// Follows the ticks of the native board.
    fn follow(&mut self, pair: &Pair) {
        for now in &pair.ticks {
            if self.last.as_ref().is_some_and(|last| now.pose.at <= last.pose.at) {
                continue;
            }
            if let Some(before) = &self.last {
                self.slack.tick(before, now);
            }
            self.apart.homing |= now.pose.state == ControllerState::Homing;
            self.last = Some(now.clone());
        }
    }

    fn find_clocks(&mut self, pair: &mut Pair) {
        let [native, chip] = &pair.sides;
        if let (None, Some(native), Some(chip)) = (self.clocks, native.poses.front(), chip.poses.front()) {
            self.clocks = Some(chip.at.0 as i64 - native.at.0 as i64);
        }
        // The ticks hold more than these.
        pair.sides[0].poses.clear();
    }

    fn compare_messages(&mut self, pair: &mut Pair) -> Result<(), Difference> {
        for stream in Stream::ALL {
            loop {
                let [native, chip] = [0, 1].map(|side: usize| pair.sides[side].first(stream));
                let (Some((_, native)), Some((_, chip))) = (native, chip) else {
                    let waiting = native.or(chip).map(|(at, _)| *at);
                    if waiting.is_some_and(|at| pair.now_us() > at + PATIENCE_US) {
                        return Err(Difference::new(format!("a message ({stream:?})"), native, chip));
                    }
                    break;
                };
                messages::compare(self, native, chip)?;
                self.figures.messages += 1;
                pair.sides.iter_mut().for_each(|side| {
                    side.take(stream);
                });
            }
        }
        Ok(())
    }

    /// The time of the native board's clock at a time of the chip's, in microseconds.
    pub fn native_time(&self, chip_us: u64) -> i64 {
        chip_us as i64 - self.clocks.unwrap_or_default()
    }

    fn compare_poses(&mut self, pair: &mut Pair) -> Result<(), Difference> {
        let known = pair.ticks.back().map_or(0, |tick| tick.pose.at.0) as i64;
        while let Some(pose) = pair.sides[1].poses.front() {
            let at = self.native_time(pose.at.0);
            if at + (LATER_TICKS * TICK_US) as i64 > known {
                return Ok(());
            }
            if let Some(pose) = pair.sides[1].poses.pop_front() {
                self.compare_pose(pair, &pose, at)?;
            }
        }
        Ok(())
    }

    fn compare_pose(&mut self, pair: &Pair, chip: &PoseReport, at: i64) -> Result<(), Difference> {
        let within = |ticks: u64| {
            let allowed = (ticks * TICK_US + LATE_US) as i64;
            pair.ticks.iter().filter(move |tick| (tick.pose.at.0 as i64 - at).abs() <= allowed)
        };
        let closest = within(1).min_by_key(|tick| (tick.pose.at.0 as i64 - at).abs());
        let Some(native) = closest else {
            return Err(Difference::new("the time of a pose", pair.ticks.back().map(|tick| tick.pose.at), chip.at));
        };
        self.figures.poses += 1;
        if messages::pose_differs(self, &native.pose, chip).is_some() {
            let like = |tick: &&Snapshot| messages::pose_differs(self, &tick.pose, chip).is_none();
            if !within(self.apart.ticks()).any(|tick| like(&tick)) {
                return messages::pose_differs(self, &native.pose, chip).map_or(Ok(()), Err);
            }
            self.figures.poses_a_tick_apart += 1;
        }
        let homes_apart = self.apart.homing && self.steps.iter().any(Steps::is_apart);
        let ticks = if homes_apart || self.apart.in_faults() || self.apart.late { self.apart.ticks() } else { 0 };
        for axis in 0..2 {
            // On one board the axis may have got its reference some ticks earlier.
            if native.pose.referenced.contains(axis) != chip.referenced.contains(axis) {
                continue;
            }
            let (ours, theirs) = (native.pose.counts[axis], chip.counts[axis]);
            let mut allowed = self.slack.counts_at(axis, ticks as f64, speed_near(pair, native, axis));
            if self.apart.homing {
                allowed += self.slack.search_counts(axis);
            }
            let field = format!("counts of axis {axis} in state {}", native.pose.state);
            Difference::unless_close(field, 0.0, f64::from(apart(ours, theirs)), allowed)?;
            if ticks == 0
                && let Some(ticks) = self.slack.ticks_of(axis, apart(ours, theirs))
            {
                self.figures.lag_us = self.figures.lag_us.max(ticks * TICK_US as f64);
            }
            if native.pose.state == ControllerState::Ready && chip.referenced.contains(axis) && !self.apart.in_faults()
            {
                let most = &mut self.figures.rest_counts[axis];
                *most = (*most).max(apart(ours, theirs));
            }
        }
        Ok(())
    }

    fn compare_steps(&mut self, pair: &mut Pair) -> Result<(), Difference> {
        let pose = pair.ticks.back().map(|tick| tick.pose.clone());
        let made = |tick: usize, axis: usize| {
            let steps = |tick: usize| pair.ticks.iter().rev().nth(tick).map_or(0, |tick| tick.steps[axis]);
            steps(tick).wrapping_sub(steps(tick + 1))
        };
        let steady = [0, 1].map(|axis| (1..4).all(|tick| made(0, axis).abs_diff(made(tick, axis)) <= 1));
        let [native, chip] = &mut pair.sides;
        for (axis, &steady) in steady.iter().enumerate() {
            if !native.steps[axis].is_empty() || !chip.steps[axis].is_empty() {
                self.moved_at_us = pair_time(&native.steps[axis], &chip.steps[axis]).max(self.moved_at_us);
            }
            let steps = &mut self.steps[axis];
            let was_apart = steps.is_apart();
            steps.compare(
                axis,
                [&mut native.steps[axis], &mut chip.steps[axis]],
                Moment { pose: pose.as_ref(), steady, steps_back: self.slack.steps_back(axis) },
                self.apart,
                self.slack.target_steps(axis),
                &mut self.figures,
            )?;
            if self.apart.homing && steps.is_apart() && !was_apart {
                self.slack.homes_apart(axis);
            }
            if steps.went_back() {
                self.slack.goes_back(axis);
            }
        }
        Ok(())
    }

    /// Compares steps and places once everything is at rest.
    fn compare_rest(&mut self, pair: &mut Pair) -> Result<(), Difference> {
        let state = pair.ticks.back().map(|tick| tick.pose.state);
        let busy = matches!(state, Some(ControllerState::Homing));
        if busy || pair.now_us() < self.moved_at_us + REST_US {
            return Ok(());
        }
        let [native, chip] = pair.plants();
        for axis in 0..2 {
            let offset = chip.steps(axis).wrapping_sub(native.steps(axis));
            let allowed = self.slack.steps(axis);
            let [before, now] = [self.offsets[axis], offset].map(f64::from);
            Difference::unless_close(format!("steps made by axis {axis}, chip less native"), before, now, allowed)?;
            let [ours, theirs] = [native, chip].map(|plant| plant.load(axis).unwrap_or_default());
            Difference::unless_close(format!("true place of axis {axis}"), ours, theirs, self.slack.load(axis, 0.0))?;
        }
        let on = [native.drivers_on(), chip.drivers_on()];
        Difference::unless_equal("drivers", &on[0], &on[1])?;
        self.forget_motion(pair);
        let [native, chip] = &mut pair.sides;
        for axis in 0..2 {
            native.steps[axis].clear();
            chip.steps[axis].clear();
        }
        Ok(())
    }

    /// Begins a new motion.
    fn forget_motion(&mut self, pair: &Pair) {
        let [native, chip] = pair.plants();
        for axis in 0..2 {
            self.offsets[axis] = chip.steps(axis).wrapping_sub(native.steps(axis));
            self.figures.motions_apart += u64::from(self.steps[axis].is_apart());
            self.steps[axis] = Steps::default();
        }
        self.slack.rested();
        (self.apart.homing, self.apart.late) = (false, false);
    }
}

/// The largest way of a load in the ticks around this one, in micro-units.
fn speed_near(pair: &Pair, tick: &Snapshot, axis: usize) -> f64 {
    const NEAR_US: u64 = 2 * TICK_US;
    let near = pair.ticks.iter().filter(|other| other.pose.at.0.abs_diff(tick.pose.at.0) <= NEAR_US);
    let loads: Vec<f64> = near.map(|tick| tick.loads[axis]).collect();
    loads.windows(2).map(|pair| (pair[1] - pair[0]).abs()).fold(0.0, f64::max)
}

/// The time of the session of the latest step, in microseconds.
fn pair_time(native: &std::collections::VecDeque<(u64, bool)>, chip: &std::collections::VecDeque<(u64, bool)>) -> u64 {
    let last = |steps: &std::collections::VecDeque<(u64, bool)>| steps.back().map_or(0, |(at, _)| at / 1_000);
    last(native).max(last(chip))
}
