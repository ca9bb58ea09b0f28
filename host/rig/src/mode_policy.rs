//! Which mode a robot should stand in, chosen from its task and from what each mode is predicted to cost.
//!
//! All costs are seconds, so that coverage, accuracy and travel can be weighed:
//!
//! - search: the share of the horizon that no camera sees, times the time to come back for what was missed;
//! - pass: the pairs of images that tell both walls as well as wanted, at each station that is left;
//! - inspect: the pairs that tell the target's range as well as wanted.
//!
//! The mean of n pairs has 1/√n of the standard deviation of one, so that (sigma / wanted)² pairs are needed.
//!
//! **Hysteresis.** The mode changes only if staying costs at least [`PolicyRule::least_gain`] times as much as changing, with the
//! time of the change, and not before [`PolicyRule::least_stay_s`] seconds in a mode. Two laws follow. Whatever comes in, there is at
//! most one change in any `least_stay_s` seconds. And while nothing truly changes, and each cost is known to a factor below
//! √`least_gain`, no mode is left and entered again: each change must gain a factor `least_gain`, of which noise can feign all
//! but a part, and the product of these parts round a cycle would be above one.

use std::fmt;

use vergence_vision::{Angle, Length};

/// What the robot is about.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Task {
    /// The target is not known.
    Search,
    /// The target is known and far: the robot walks there and keeps clear of the walls.
    Pass,
    /// The target is near, and its range is asked for.
    Inspect,
}

impl fmt::Display for Task {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Search => "search",
            Self::Pass => "pass",
            Self::Inspect => "inspect",
        })
    }
}

/// Where the target is believed to be.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TargetBelief {
    /// Direction from the robot, to the right of its forward direction.
    pub azimuth: Angle,
    /// Distance from the robot.
    pub range: Length,
    /// Standard deviation of the distance.
    pub range_sigma: Length,
}

/// What the robot knows when a mode is to be chosen.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TaskState {
    /// Time in seconds since any fixed instant; it never decreases.
    pub seconds: f64,
    /// The target, where it was seen.
    pub target: Option<TargetBelief>,
    /// Distances of the left and the right wall, measured or assumed.
    pub walls: [Length; 2],
    /// The way that is left to walk.
    pub way_left: Length,
    /// Walking speed in millimetres per second.
    pub speed_mm_s: f64,
}

/// What a mode is predicted to offer in a state.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ModeFigures {
    /// Share of the horizon that no camera sees, 0 to 1.
    pub blind_share: f64,
    /// Standard deviation of the distance of the worse known wall from one pair; `None` where a wall is not seen by both cameras.
    pub wall_sigma: Option<Length>,
    /// Standard deviation of the target's range from one pair; `None` where not both cameras see the target.
    pub target_sigma: Option<Length>,
    /// Time of the change from the present mode, in seconds; 0 for the present mode. Infinite where no way leads there.
    pub change_s: f64,
}

/// Numbers of the policy.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PolicyRule {
    /// Time of one pair of images with its evaluation, in seconds.
    pub pair_s: f64,
    /// Distance between stations on the way.
    pub station_step: Length,
    /// Wanted standard deviation of the walls' distances.
    pub wall_sigma: Length,
    /// Wanted standard deviation of the target's range.
    pub target_sigma: Length,
    /// Most pairs at one station: what needs more is given up.
    pub most_pairs: f64,
    /// Factor by which the cost of staying must exceed that of changing.
    pub least_gain: f64,
    /// Least time in a mode, in seconds.
    pub least_stay_s: f64,
    /// The target is inspected once it is certainly nearer than the first, and until it is certainly farther than the second.
    pub inspect_within: [Length; 2],
}

impl Default for PolicyRule {
    fn default() -> Self {
        Self {
            pair_s: 1.0,
            station_step: Length::from_mm(400.0),
            wall_sigma: Length::from_mm(3.0),
            target_sigma: Length::from_mm(0.5),
            most_pairs: 100.0,
            least_gain: 1.5,
            least_stay_s: 3.0,
            inspect_within: [Length::from_mm(500.0), Length::from_mm(700.0)],
        }
    }
}

/// Why a mode was chosen.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ModeChoice {
    /// Number of the mode in the list of figures.
    pub mode: usize,
    /// The mode before; the same where it stays.
    pub before: usize,
    /// The task that decided.
    pub task: Task,
    /// Cost of staying in the mode before, in seconds.
    pub stay_s: f64,
    /// Cost of the mode chosen without the change, in seconds.
    pub chosen_s: f64,
    /// Time of the change, in seconds.
    pub change_s: f64,
    /// What the mode before and the chosen mode offer.
    pub figures: [ModeFigures; 2],
}

impl ModeChoice {
    /// Whether the mode changes.
    #[must_use]
    pub const fn changes(&self) -> bool {
        self.mode != self.before
    }

    /// One line with the figures that decided; `names` are those of the modes.
    #[must_use]
    pub fn in_words(&self, names: &[String]) -> String {
        let name = |mode: usize| names.get(mode).map_or("?", String::as_str);
        let (before, chosen) = (name(self.before), name(self.mode));
        if !self.changes() {
            return format!("{}: stays {chosen}, {:.1} s to go", self.task, self.chosen_s);
        }
        let sigma = |sigma: Option<Length>| sigma.map_or("unseen".to_owned(), |sigma| format!("{:.2} mm", sigma.mm()));
        let [old, new] = self.figures;
        let offer = match self.task {
            Task::Search => {
                format!("{:.0} % of the horizon unseen, not {:.0} %", 100.0 * new.blind_share, 100.0 * old.blind_share)
            }
            Task::Pass => format!("walls to {} a pair, not {}", sigma(new.wall_sigma), sigma(old.wall_sigma)),
            Task::Inspect => format!("target to {} a pair, not {}", sigma(new.target_sigma), sigma(old.target_sigma)),
        };
        format!(
            "{}: {chosen} instead of {before}: {offer}; {:.1} s and {:.1} s for the change against {:.1} s",
            self.task, self.chosen_s, self.change_s, self.stay_s
        )
    }
}

/// Chooses modes, and remembers what its hysteresis needs.
#[derive(Clone, Debug)]
pub struct ModePolicy {
    rule: PolicyRule,
    mode: usize,
    since_s: f64,
    task: Task,
}

impl ModePolicy {
    /// A robot that stands in `mode` for as long as anyone cares.
    #[must_use]
    pub const fn new(rule: PolicyRule, mode: usize) -> Self {
        Self { rule, mode, since_s: f64::NEG_INFINITY, task: Task::Search }
    }

    /// The present mode.
    #[must_use]
    pub const fn mode(&self) -> usize {
        self.mode
    }

    /// Chooses among the modes with `figures`, one entry a mode in a fixed order. `None` without figures of the present mode.
    pub fn choose(&mut self, state: &TaskState, figures: &[ModeFigures]) -> Option<ModeChoice> {
        self.task = self.task_of(state);
        let present = *figures.get(self.mode)?;
        let cost = |mode: &ModeFigures| self.cost(state, mode);
        let stay_s = cost(&present);
        let with_change = |mode: &ModeFigures| cost(mode) + mode.change_s;
        let others =
            figures.iter().enumerate().filter(|(mode, figures)| *mode != self.mode && figures.change_s.is_finite());
        let best = others.min_by(|one, other| with_change(one.1).total_cmp(&with_change(other.1)));
        let rested = state.seconds - self.since_s >= self.rule.least_stay_s;
        let better = best.filter(|(_, mode)| rested && stay_s >= self.rule.least_gain * with_change(mode));
        let (mode, chosen) = better.map_or((self.mode, present), |(mode, figures)| (mode, *figures));
        let choice = ModeChoice {
            mode,
            before: self.mode,
            task: self.task,
            stay_s,
            chosen_s: cost(&chosen),
            change_s: if mode == self.mode { 0.0 } else { chosen.change_s },
            figures: [present, chosen],
        };
        if choice.changes() {
            (self.mode, self.since_s) = (mode, state.seconds);
        }
        Some(choice)
    }

    /// The task; between both distances of inspection it stays what it was.
    fn task_of(&self, state: &TaskState) -> Task {
        let Some(target) = state.target else { return Task::Search };
        let [enter, leave] = self.rule.inspect_within.map(Length::mm);
        let (range, sigma) = (target.range.mm(), target.range_sigma.mm());
        match self.task {
            Task::Inspect if range - sigma <= leave => Task::Inspect,
            _ if range + sigma < enter => Task::Inspect,
            _ => Task::Pass,
        }
    }

    /// The cost of the task in a mode, in seconds.
    fn cost(&self, state: &TaskState, mode: &ModeFigures) -> f64 {
        let rule = &self.rule;
        let pairs = |sigma: Option<Length>, wanted: Length| {
            sigma.map_or(rule.most_pairs, |sigma| (sigma.mm() / wanted.mm()).powi(2).clamp(1.0, rule.most_pairs))
        };
        let stations = (state.way_left.mm() / rule.station_step.mm()).max(1.0);
        match self.task {
            // What was missed costs the way back.
            Task::Search => mode.blind_share * state.way_left.mm() / state.speed_mm_s.max(1.0),
            Task::Pass => stations * rule.pair_s * pairs(mode.wall_sigma, rule.wall_sigma),
            Task::Inspect => rule.pair_s * pairs(mode.target_sigma, rule.target_sigma),
        }
    }
}
