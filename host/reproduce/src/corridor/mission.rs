//! The robot's mission: find the target somewhere in a corridor, walk to it between the walls, and measure it from near.
//!
//! It stands still for each pair of images. Times of walking and turning, and one second for a pair, are a model, stated here and in
//! [`PolicyRule`]. A change of mode takes what the controller takes, or as planned where the joints are placed. That the target stands beside a wall is known; beside which, and where, is not.

use vergence_pipeline::ModeOutlook;
use vergence_rig::linkage::WantedClearance;
use vergence_rig::{ModeChoice, ModePolicy, PolicyRule, Rig, TargetBelief, TaskState};
use vergence_scene::CorridorPlan;
use vergence_vision::{Angle, Length};

use super::area::AreaSeen;
use super::joints::Joints;
use super::place::SPEED;
use super::station::values;
use super::target::{Found, Inspected, find_target, inspect};
use super::walls::walls;
use super::{Built, Place, Sight, Station};
use crate::error::DemoError;

/// Distance between stations in millimetres.
const STEP: f64 = 400.0;
/// How near the robot comes to either end of the corridor, in millimetres.
const FROM_END: f64 = 600.0;
/// Distance of the walls that is assumed before any is measured.
const ASSUMED_WALL: Length = Length::from_mm(550.0);
/// Standard deviation of the target's place by a direction and the wall beside it.
const BELIEF_SIGMA: Length = Length::from_mm(50.0);
/// More stations than any corridor needs.
const MOST_STATIONS: usize = 60;

/// The modes of the paper's story, in the order of search, pass and inspect.
pub const STORY: [&str; 3] = ["gecko", "spider", "stick-bug"];

/// Who chooses the modes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Orders {
    /// [`ModePolicy`].
    Auto,
    /// One mode of [`STORY`], by number, for everything.
    Fixed(usize),
    /// Gecko to search, spider to pass, stick-bug to inspect, as the paper's authors order it by hand.
    Paper,
}

impl Orders {
    /// All that are compared.
    pub const ALL: [Self; 5] = [Self::Auto, Self::Paper, Self::Fixed(0), Self::Fixed(1), Self::Fixed(2)];

    /// For tables.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Auto => "auto",
            Self::Paper => "paper's order",
            Self::Fixed(mode) => STORY.get(mode).copied().unwrap_or("unknown"),
        }
    }

    /// The mode for a part of the mission; `None` where the policy chooses it.
    fn mode(self, part: usize) -> Option<usize> {
        match self {
            Self::Auto => None,
            Self::Fixed(mode) => Some(mode),
            Self::Paper => Some(part),
        }
    }
}

/// The modes of a rig with what they would offer, and the times of the changes between them.
pub struct Outlooks<'a> {
    pub(super) rig: &'a Rig,
    modes: Vec<ModeOutlook<'a>>,
    change_s: [[f64; 3]; 3],
}

impl<'a> Outlooks<'a> {
    /// Predicts for the modes of [`STORY`], and plans all changes.
    ///
    /// # Errors
    /// Where the rig has no trunk or lacks a mode.
    pub fn of(rig: &'a Rig) -> Result<Self, DemoError> {
        let unknown = |what: &str| DemoError::UnknownPose(format!("rig '{}' has no {what}", rig.name));
        let trunk = rig.trunk.as_deref().ok_or_else(|| unknown("[trunk]"))?;
        let outlook = |name: &str| {
            let mode = rig.mode(name).ok_or_else(|| unknown(name))?;
            ModeOutlook::of(rig, mode).map_err(|error| DemoError::Zones(error.to_string()))
        };
        let modes = STORY.into_iter().map(outlook).collect::<Result<Vec<_>, _>>()?;
        let seconds = |from: usize, to: usize| {
            let ends = [STORY[from], STORY[to]].map(|mode| values(rig, mode));
            // A mode without a way costs for ever.
            trunk.path(&ends[0], &ends[1], &WantedClearance::default()).map_or(f64::INFINITY, |path| path.seconds())
        };
        let change_s =
            std::array::from_fn(|from| std::array::from_fn(|to| if from == to { 0.0 } else { seconds(from, to) }));
        Ok(Self { rig, modes, change_s })
    }
}

/// What the mission tells while it runs.
#[derive(Clone, Copy)]
pub enum Step<'s> {
    /// A mode was chosen by the policy, or ordered, and the trunk went to it.
    Mode {
        /// The mode before and the new one.
        names: [&'static str; 2],
        /// Seconds that the joints took, or the planned ones where nothing moved them.
        seconds: f64,
        /// The reason, where the policy chose.
        why: Option<&'s str>,
    },
    /// A station was measured, as part of the mission.
    Measured(&'static str, &'s Station),
    /// The target was seen for the first time.
    Found(&'s Found),
    /// The target was measured.
    Inspected(&'s Inspected),
}

/// How the mission went.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Outcome {
    /// Time of the whole, in seconds.
    pub seconds: f64,
    /// Part of the free floor that a camera saw, 0 to 1.
    pub area: f64,
    /// Whether the target was seen at all.
    pub found: bool,
    /// Error of the target's median range, in millimetres, where points told it.
    pub target_error_mm: Option<f64>,
    /// Errors of the walls' distances, in millimetres, at all stations but the last.
    pub wall_errors_mm: Vec<f64>,
    /// Walls that too few points told.
    pub walls_missed: usize,
    /// Changes of the mode.
    pub changes: usize,
}

/// One robot in one corridor.
pub struct Mission<'a> {
    outlooks: &'a Outlooks<'a>,
    corridor: Built,
    orders: Orders,
    sight: Sight,
    joints: &'a mut dyn Joints,
    seed: u64,
    policy: ModePolicy,
    mode: usize,
    place: Place,
    /// The best direction to the target so far.
    target: Option<Found>,
    walls: [Length; 2],
    area: AreaSeen,
    stations: Vec<Station>,
    outcome: Outcome,
}

impl<'a> Mission<'a> {
    /// A robot at the start of a corridor, which begins in gecko, or in the mode that is ordered for all. `joints` move its trunk, and
    /// `seed` sets the noise of what it sees.
    #[must_use]
    pub fn new(
        (outlooks, joints): (&'a Outlooks<'a>, &'a mut dyn Joints),
        corridor: &Built,
        orders: Orders,
        sight: Sight,
        seed: u64,
    ) -> Self {
        let mode = orders.mode(0).unwrap_or(0);
        Self {
            outlooks,
            corridor: corridor.clone(),
            orders,
            sight,
            joints,
            seed,
            policy: ModePolicy::new(PolicyRule::default(), mode),
            mode,
            place: Place::along(0.0),
            target: None,
            walls: [ASSUMED_WALL; 2],
            area: AreaSeen::of(&corridor.plan),
            stations: Vec::new(),
            outcome: Outcome::default(),
        }
    }

    /// The robot at `place` in a mode by number, to measure there alone.
    ///
    /// # Errors
    /// Where the pair cannot be measured.
    pub fn station(&mut self, mode: usize, place: Place) -> Result<Station, DemoError> {
        self.joints.go_to(STORY[mode])?;
        let mut station = self.see(mode, place, self.seed)?;
        station.walls = Some(walls(&station));
        Ok(station)
    }

    /// Runs the mission; `told` hears of each step.
    ///
    /// # Errors
    /// Where a pair cannot be measured, and what `told` returns.
    pub fn run(
        mut self,
        told: &mut dyn FnMut(Step<'_>) -> Result<(), DemoError>,
    ) -> Result<(Outcome, Vec<Station>), DemoError> {
        // The mission begins in its first mode: the way there does not count.
        self.joints.go_to(STORY[self.mode])?;
        self.search(told)?;
        if self.target.is_some() {
            self.pass(told)?;
            self.inspect(told)?;
        }
        self.outcome.area = self.area.share();
        Ok((self.outcome, self.stations))
    }

    /// Walks to the far end and back to the near one, until the target is seen.
    fn search(&mut self, told: &mut dyn FnMut(Step<'_>) -> Result<(), DemoError>) -> Result<(), DemoError> {
        let [back, front] = self.corridor.plan.ends;
        let mut heading = 1.0;
        while self.stations.len() < MOST_STATIONS {
            let end = if heading > 0.0 { front - FROM_END } else { back + FROM_END };
            self.measure(0, "search", (end - self.place.along).abs(), told)?;
            if let Some(found) = &self.target {
                self.outcome.found = true;
                return told(Step::Found(found));
            }
            let next = self.place.along + heading * STEP;
            if (next - end) * heading <= 0.0 {
                self.walk_to(Place { along: next, ..self.place })?;
            } else if heading > 0.0 {
                heading = -1.0;
                self.walk_to(Place { yaw: Angle::from_deg(180.0), ..self.place })?;
            } else {
                return Ok(());
            }
        }
        Ok(())
    }

    /// Walks between the walls until the target is beside the robot.
    fn pass(&mut self, told: &mut dyn FnMut(Step<'_>) -> Result<(), DemoError>) -> Result<(), DemoError> {
        while let Some(goal) = self.facing().filter(|_| self.stations.len() < MOST_STATIONS) {
            let left = goal.along - self.place.along;
            if left.abs() < STEP / 2.0 {
                return Ok(());
            }
            let yaw = Angle::from_deg(if left > 0.0 { 0.0 } else { 180.0 });
            self.walk_to(Place { yaw, along: self.place.along + left.clamp(-STEP, STEP), ..self.place })?;
            self.measure(1, "pass", (left.abs() - STEP).max(0.0), told)?;
        }
        Ok(())
    }

    /// Faces the target from near, and measures it.
    fn inspect(&mut self, told: &mut dyn FnMut(Step<'_>) -> Result<(), DemoError>) -> Result<(), DemoError> {
        if let Some(goal) = self.facing() {
            self.walk_to(goal)?;
        }
        self.measure(2, "inspect", 0.0, told)?;
        let Some(station) = self.stations.last() else { return Ok(()) };
        let inspected = inspect(station, self.outlooks.rig);
        self.outcome.target_error_mm = inspected.error_mm();
        told(Step::Inspected(&inspected))
    }

    fn walk_to(&mut self, to: Place) -> Result<(), DemoError> {
        let seconds = self.place.seconds_to(&to);
        self.joints.walk(seconds)?;
        self.outcome.seconds += seconds;
        self.place = to;
        Ok(())
    }

    /// Measures in the mode of this number, in which the trunk stands.
    fn see(&mut self, mode: usize, place: Place, seed: u64) -> Result<Station, DemoError> {
        let standing = self.joints.standing()?;
        Station::measure((self.outlooks.rig, &self.corridor), (STORY[mode], &standing), place, seed, self.sight)
    }

    /// Where the target is believed to stand, across and along.
    fn believed(&self) -> Option<[f64; 2]> {
        let beside = Length::from_mm(self.corridor.plan.half_width - CorridorPlan::TARGET_FROM_WALL);
        self.target.as_ref().map(|found| found.beside_wall(beside))
    }

    /// The place from which the robot looks straight at the target from near, nearly across the corridor.
    fn facing(&self) -> Option<Place> {
        self.believed().map(Place::facing)
    }

    /// Chooses the mode, measures, and looks for walls and target.
    fn measure(
        &mut self,
        part: usize,
        task: &'static str,
        way_left: f64,
        told: &mut dyn FnMut(Step<'_>) -> Result<(), DemoError>,
    ) -> Result<(), DemoError> {
        self.choose(part, way_left, told)?;
        let rule = PolicyRule::default();
        let seed = self.seed.wrapping_add(self.stations.len() as u64);
        let rig = self.outlooks.rig;
        let mut station = self.see(self.mode, self.place, seed)?;
        self.outcome.seconds += rule.pair_s;
        self.area.add(&station);
        if part < 2 {
            let walls = walls(&station);
            for side in 0..2 {
                match walls.measured[side] {
                    Some(measured) => {
                        self.outcome.wall_errors_mm.push(measured - walls.truth[side]);
                        self.walls[side] = Length::from_mm(measured);
                    }
                    None => self.outcome.walls_missed += 1,
                }
            }
            station.walls = Some(walls);
            let better = |found: &Found| self.target.as_ref().is_none_or(|known| found.across() > known.across());
            if let Some(found) = find_target(&station, rig).filter(better) {
                self.target = Some(found);
            }
        }
        told(Step::Measured(task, &station))?;
        self.stations.push(station);
        Ok(())
    }

    /// Goes to the mode that is ordered, or that the policy chooses.
    fn choose(
        &mut self,
        part: usize,
        way_left: f64,
        told: &mut dyn FnMut(Step<'_>) -> Result<(), DemoError>,
    ) -> Result<(), DemoError> {
        let before = self.mode;
        let choice = match self.orders.mode(part) {
            Some(mode) => {
                self.mode = mode;
                None
            }
            None => self.chosen(way_left),
        };
        if let Some(choice) = choice {
            self.mode = choice.mode;
        }
        if self.mode == before {
            return Ok(());
        }
        self.outcome.changes += 1;
        let planned = self.outlooks.change_s[before][self.mode];
        let seconds = self.joints.go_to(STORY[self.mode])?.unwrap_or(planned);
        self.outcome.seconds += seconds;
        let why = choice.map(|choice| choice.in_words(&STORY.map(String::from)));
        told(Step::Mode { names: [STORY[before], STORY[self.mode]], seconds, why: why.as_deref() })
    }

    fn chosen(&mut self, way_left: f64) -> Option<ModeChoice> {
        let target = self.believed().map(|[x, z]| {
            let [dx, dz] = [x - self.place.x, z - self.place.along];
            TargetBelief {
                azimuth: Angle::from_rad(dx.atan2(dz)) - self.place.yaw,
                range: Length::from_mm(dx.hypot(dz)),
                range_sigma: BELIEF_SIGMA,
            }
        });
        let state = TaskState {
            seconds: self.outcome.seconds,
            target,
            walls: self.walls,
            way_left: Length::from_mm(way_left),
            speed_mm_s: SPEED,
        };
        let change_s = self.outlooks.change_s[self.mode];
        let figures: Vec<_> =
            self.outlooks.modes.iter().zip(change_s).map(|(mode, change_s)| mode.figures(&state, change_s)).collect();
        self.policy.choose(&state, &figures)
    }
}
