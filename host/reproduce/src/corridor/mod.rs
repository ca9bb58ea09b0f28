//! The robot in a simulated corridor: it searches with its widest view, passes with depth to both sides, and inspects from near.
//!
//! What is simulated: the corridor, both cameras, the servos, and the trunk with its play and springs. Where the robot stands is given:
//! walking is no subject here, and the robot stands still for each pair. Real are the controller that moves the joints, the protocol
//! over which it is told to ([`DrivenJoints`]), and the measurement: poses from joints and images, matching, triangulation. The truth
//! scores it and is used for nothing else. Only the comparison of many corridors places its joints ([`PlacedJoints`]).

mod area;
mod auto;
mod comparison;
mod eyes;
mod joints;
mod map;
mod mission;
mod place;
mod station;
mod target;
mod walls;

use std::path::Path;
use std::time::Duration;

use serde_json::{Value, json};
use vergence_files::write_whole;
use vergence_output::trunk_strip_svg;
use vergence_rig::linkage::{TrunkPath, WantedClearance};
use vergence_rig::{Rig, RigTrunk, rounded};
use vergence_scene::CorridorPlan;
use vergence_vision::{Length, Side};

use crate::error::DemoError;
pub use comparison::{Comparison, compare};
pub use joints::{DrivenJoints, Joints, PlacedJoints, Standing};
use map::corridor_map;
pub use mission::{Mission, Orders, Outcome, Outlooks, STORY, Step};
pub use place::Place;
pub use station::{Built, PoseError, Sight, Station};
use target::find_target;
use walls::walls;

/// Width of the images in pixels: half of the lens file's, which renders four times as fast.
pub const WIDTH: u32 = 640;
/// Places along the corridor, in millimetres, at which the robot searches.
const SEARCHES: [f64; 3] = [0.0, 600.0, 1250.0];
/// Places at which it passes.
const PASSES: [f64; 3] = [0.0, 400.0, 800.0];
/// The mode in which the simulated robot is switched on.
const FIRST_MODE: &str = "spider";

/// The demonstration so far.
pub struct Corridor<'a> {
    rig: Rig,
    out: &'a Path,
    seed: u64,
    clock: fn() -> Duration,
    corridor: Built,
    stations: Vec<Station>,
    /// The mode in which the trunk stands.
    mode: String,
}

/// What the demonstration says and returns.
#[derive(Clone, Debug, Default)]
pub struct Story {
    /// Lines for people, in their order.
    pub lines: Vec<String>,
    /// One entry for each mode, for programs.
    pub modes: Vec<Value>,
    /// Distances of the walls and of the target, for programs.
    pub found: Value,
    /// Changes of the mode: what the controller took and what was planned, and the reason where the robot chose the mode itself.
    pub changes: Vec<Value>,
    /// Time, area and errors of the whole, where the robot chose its modes itself; else null.
    pub mission: Value,
}

/// A change of the mode.
struct Change<'n> {
    names: [&'n str; 2],
    /// What it took, in seconds.
    seconds: f64,
    /// As it was planned.
    path: TrunkPath,
}

impl Change<'_> {
    fn in_words(&self) -> String {
        format!(
            "{}: {:.2} s from {} in {} legs; planned {:.2} s",
            self.names[1],
            self.seconds,
            self.names[0],
            self.path.legs.len(),
            self.path.seconds()
        )
    }

    fn json(&self, why: Option<&str>) -> Value {
        json!({
            "from": self.names[0],
            "to": self.names[1],
            "seconds": rounded(self.seconds),
            "planned_s": rounded(self.path.seconds()),
            "why": why,
        })
    }
}

impl<'a> Corridor<'a> {
    /// The robot of `rig`, which has a trunk and the modes gecko, spider and stick-bug. Files go to the folder `out`; the `seed` sets
    /// noise of the images; `clock` times the work.
    ///
    /// # Errors
    /// Where the rig has no trunk, lacks a mode, or its sensors cannot be made smaller.
    pub fn new(rig: &Rig, out: &'a Path, seed: u64, clock: fn() -> Duration) -> Result<Self, DemoError> {
        let missing = ["gecko", "spider", "stick-bug"].into_iter().find(|mode| rig.mode(mode).is_none());
        if let (Some(mode), _) | (None, Some(mode)) = (missing, rig.trunk.is_none().then_some("[trunk]")) {
            return Err(DemoError::UnknownPose(format!("rig '{}' has no {mode}", rig.name)));
        }
        let rig = rig.clone().with_sensors(WIDTH).map_err(|error| DemoError::UnknownPose(error.to_string()))?;
        let corridor = Built::new(CorridorPlan::default());
        Ok(Self { rig, out, seed, clock, corridor, stations: Vec::new(), mode: FIRST_MODE.to_owned() })
    }

    /// Plays the story with a trunk that `joints` move, and which stands in spider; `said` hears each line as it comes.
    ///
    /// # Errors
    /// Where a mode is not reached, a pair cannot be measured, or a file not be written.
    pub fn play(mut self, joints: &mut dyn Joints, said: &mut dyn FnMut(&str)) -> Result<Story, DemoError> {
        let mut story = Story::default();
        let mut tell = |line: String, story: &mut Story| {
            said(&line);
            story.lines.push(line);
        };
        let mut bearing = None;
        for along in SEARCHES {
            tell(self.change("gecko", joints, &mut story.changes)?, &mut story);
            let number = self.measure(Place::along(along), joints)?;
            tell(self.stations[number].in_words("search"), &mut story);
            bearing = find_target(&self.stations[number], &self.rig);
            let seen = bearing.as_ref().map_or_else(|| "nothing red in sight".to_owned(), target::Found::in_words);
            tell(format!("  {seen}"), &mut story);
            if bearing.is_some() {
                break;
            }
        }
        for along in PASSES {
            tell(self.change("spider", joints, &mut story.changes)?, &mut story);
            let number = self.measure(Place::along(along), joints)?;
            tell(self.stations[number].in_words("pass"), &mut story);
            let walls = walls(&self.stations[number]);
            tell(format!("  {}", walls.in_words()), &mut story);
            self.stations[number].walls = Some(walls);
        }
        let target = bearing.ok_or_else(|| DemoError::Matching("the target was not found".into()))?;
        tell(self.change("stick-bug", joints, &mut story.changes)?, &mut story);
        let number = self.measure(self.facing(&target), joints)?;
        tell(self.stations[number].in_words("inspect"), &mut story);
        let inspected = target::inspect(&self.stations[number], &self.rig);
        tell(format!("  {}", inspected.in_words()), &mut story);
        self.finish(story, &target, &inspected)
    }

    /// Has the trunk go to `mode`, and returns a line on it.
    fn change(&mut self, mode: &str, joints: &mut dyn Joints, changes: &mut Vec<Value>) -> Result<String, DemoError> {
        let before = std::mem::replace(&mut self.mode, mode.to_owned());
        if before == mode {
            return Ok(format!("{mode}:"));
        }
        let seconds = joints.go_to(mode)?;
        let change = self.changed([&before, mode], seconds)?;
        changes.push(change.json(None));
        Ok(change.in_words())
    }

    /// Draws the planned change, and puts what it took beside it.
    fn changed<'n>(&self, names: [&'n str; 2], seconds: Option<f64>) -> Result<Change<'n>, DemoError> {
        let path = self.path(names[0], names[1])?;
        self.write_strip(names[0], names[1], &path)?;
        Ok(Change { names, seconds: seconds.unwrap_or_else(|| path.seconds()), path })
    }

    /// Writes pictures of the trunk along a path.
    fn write_strip(&self, from: &str, to: &str, path: &TrunkPath) -> Result<(), DemoError> {
        match trunk_strip_svg(&self.rig, path) {
            Some(svg) => self.write(&format!("{from}-to-{to}.svg"), &svg),
            None => Ok(()),
        }
    }

    fn path(&self, from: &str, to: &str) -> Result<TrunkPath, DemoError> {
        let values = |mode: &str| station::values(&self.rig, mode);
        let trunk: &RigTrunk = self.rig.trunk.as_deref().ok_or(DemoError::NotTriggered)?;
        trunk
            .path(&values(from), &values(to), &WantedClearance::default())
            .map_err(|error| DemoError::UnknownPose(format!("from {from} to {to}: {error}")))
    }

    /// The place from which the robot looks straight at the target from near, by the bearing alone and the corridor's width.
    fn facing(&self, target: &target::Found) -> Place {
        let beside = self.corridor.plan.half_width - CorridorPlan::TARGET_FROM_WALL;
        Place::facing(target.beside_wall(Length::from_mm(beside)))
    }

    /// Measures at `place` in the present mode; returns the number of the station.
    fn measure(&mut self, place: Place, joints: &mut dyn Joints) -> Result<usize, DemoError> {
        let number = self.stations.len();
        let before = self.stations.last().map_or(Place::along(0.0), |station| station.place);
        joints.walk(before.seconds_to(&place))?;
        let standing = joints.standing()?;
        let seed = self.seed.wrapping_add(number as u64);
        let sight = Sight::Rendered(self.clock);
        let station = Station::measure((&self.rig, &self.corridor), (&self.mode, &standing), place, seed, sight)?;
        let name = format!("{number}-{}", self.mode);
        station.write(&name, self.out).map_err(|error| DemoError::File(error.to_string()))?;
        self.stations.push(station);
        Ok(number)
    }

    fn write(&self, name: &str, text: &str) -> Result<(), DemoError> {
        write_whole(&self.out.join(name), text.as_bytes()).map_err(|error| DemoError::File(error.to_string()))
    }

    fn finish(
        &self,
        mut story: Story,
        target: &target::Found,
        inspected: &target::Inspected,
    ) -> Result<Story, DemoError> {
        self.write("corridor.svg", &corridor_map(&self.corridor.plan, &self.stations))?;
        for mode in ["gecko", "spider", "stick-bug"] {
            let of_mode: Vec<_> = self.stations.iter().filter(|station| station.mode == mode).collect();
            story.modes.push(json!({
                "name": mode,
                "stations": of_mode.iter().map(|station| station.json()).collect::<Vec<_>>(),
            }));
        }
        story.found = json!({
            "target_seen_by": target.side.map(|side: Side| side.to_string()),
            "target_bearing_deg": rounded(target.azimuth.deg()),
            "target_bearing_error_deg": rounded(target.error().deg()),
            "target_range_mm": inspected.range_mm.map(rounded),
            "target_range_error_mm": inspected.error_mm().map(rounded),
            "target_points": inspected.points,
        });
        Ok(story)
    }
}
