//! The robot in a simulated corridor: it searches with its widest view, passes with depth to both sides, and inspects from near.
//!
//! What is simulated: the corridor, both cameras, and the joints, each of which is off by its play. Where the robot stands is given:
//! walking is no subject here, and no controller moves the joints. The measurement is the real one: poses from joints and images,
//! matching, triangulation. The truth scores it and is used for nothing else.

mod map;
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
use vergence_scene::Scene;
use vergence_vision::{Angle, Length, Side};

use crate::error::DemoError;
use map::corridor_map;
pub use station::{Place, Station};
use target::find_target;
use walls::walls;

/// Width of the images in pixels: half of the lens file's, which renders four times as fast.
const WIDTH: u32 = 640;
/// Places along the corridor, in millimetres, at which the robot searches.
const SEARCHES: [f64; 3] = [0.0, 600.0, 1250.0];
/// Places at which it passes.
const PASSES: [f64; 3] = [0.0, 400.0, 800.0];
/// Distance from the target at which it inspects, in millimetres.
const NEAR: f64 = 420.0;

/// The demonstration so far.
pub struct Corridor<'a> {
    rig: Rig,
    out: &'a Path,
    seed: u64,
    clock: fn() -> Duration,
    scene: std::sync::Arc<Scene>,
    stations: Vec<Station>,
    mode: Option<String>,
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
}

impl<'a> Corridor<'a> {
    /// The robot of `rig`, which has a trunk and the modes gecko, spider and stick-bug. Files go to the folder `out`; the `seed` sets
    /// errors of the joints and noise of the images; `clock` times the work.
    ///
    /// # Errors
    /// Where the rig has no trunk, lacks a mode, or its sensors cannot be made smaller.
    pub fn new(rig: &Rig, out: &'a Path, seed: u64, clock: fn() -> Duration) -> Result<Self, DemoError> {
        let missing = ["gecko", "spider", "stick-bug"].into_iter().find(|mode| rig.mode(mode).is_none());
        if let (Some(mode), _) | (None, Some(mode)) = (missing, rig.trunk.is_none().then_some("[trunk]")) {
            return Err(DemoError::UnknownPose(format!("rig '{}' has no {mode}", rig.name)));
        }
        let rig = rig.clone().with_sensors(WIDTH).map_err(|error| DemoError::UnknownPose(error.to_string()))?;
        let scene = std::sync::Arc::new(Scene::corridor());
        Ok(Self { rig, out, seed, clock, scene, stations: Vec::new(), mode: None })
    }

    /// Plays the story; `said` hears each line as it comes.
    ///
    /// # Errors
    /// Where a pair cannot be measured or a file not be written.
    pub fn play(mut self, said: &mut dyn FnMut(&str)) -> Result<Story, DemoError> {
        let mut story = Story::default();
        let mut tell = |line: String, story: &mut Story| {
            said(&line);
            story.lines.push(line);
        };
        let mut bearing = None;
        for along in SEARCHES {
            tell(self.change("gecko")?, &mut story);
            let number = self.measure(Place::along(along))?;
            tell(self.stations[number].in_words("search"), &mut story);
            bearing = find_target(&self.stations[number], &self.rig);
            let seen = bearing.as_ref().map_or_else(|| "nothing red in sight".to_owned(), target::Found::in_words);
            tell(format!("  {seen}"), &mut story);
            if bearing.is_some() {
                break;
            }
        }
        for along in PASSES {
            tell(self.change("spider")?, &mut story);
            let number = self.measure(Place::along(along))?;
            tell(self.stations[number].in_words("pass"), &mut story);
            let walls = walls(&self.stations[number]);
            tell(format!("  {}", walls.in_words()), &mut story);
            self.stations[number].walls = Some(walls);
        }
        let target = bearing.ok_or_else(|| DemoError::Matching("the target was not found".into()))?;
        tell(self.change("stick-bug")?, &mut story);
        let number = self.measure(self.facing(&target))?;
        tell(self.stations[number].in_words("inspect"), &mut story);
        let inspected = target::inspect(&self.stations[number], &self.rig);
        tell(format!("  {}", inspected.in_words()), &mut story);
        self.finish(story, &target, &inspected)
    }

    /// Lines of the change to `mode`, planned and drawn; nothing moves but the simulated joints.
    fn change(&mut self, mode: &str) -> Result<String, DemoError> {
        let before = self.mode.replace(mode.to_owned());
        let Some(before) = before.filter(|before| before != mode) else { return Ok(format!("{mode}:")) };
        let path = self.path(&before, mode)?;
        if let Some(svg) = trunk_strip_svg(&self.rig, &path) {
            self.write(&format!("{before}-to-{mode}.svg"), &svg)?;
        }
        Ok(format!("{mode}: {:.1} s from {before} in {} legs", path.seconds(), path.legs.len()))
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
        let [x, z] = target.beside_wall(Length::from_mm(Scene::CORRIDOR_HALF_WIDTH - 150.0));
        // Nearly across the corridor: the parcel that hides the target from the start stays aside.
        let yaw = 1.25_f64.copysign(x);
        Place { x: x - NEAR * yaw.sin(), along: z - NEAR * yaw.cos(), yaw: Angle::from_rad(yaw) }
    }

    /// Measures at `place` in the present mode; returns the number of the station.
    fn measure(&mut self, place: Place) -> Result<usize, DemoError> {
        let mode = self.mode.clone().unwrap_or_default();
        let number = self.stations.len();
        let station = Station::measure(&self.rig, &self.scene, &mode, place, self.seed + number as u64, self.clock)?;
        let name = format!("{number}-{mode}");
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
        self.write("corridor.svg", &corridor_map(&self.stations))?;
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
