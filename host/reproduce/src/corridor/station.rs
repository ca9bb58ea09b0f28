//! One measurement of the robot: where it stands, what its joints say, and the cloud.

use std::path::Path;
use std::sync::Arc;
use std::time::Duration;

use image::RgbImage;
use nalgebra::{UnitQuaternion, Vector3};
use serde_json::{Value, json};
use vergence_files::FileError;
use vergence_matching::{GuidedMatcher, Matcher};
use vergence_output::{pose_source_json, pose_source_line, write_scored_pair};
use vergence_pipeline::{
    Method, PairCloud, PairImages, PairPose, Score, Stage, StageTimes, pair_cloud, rig_zones, score, with_fused,
};
use vergence_rig::{Rig, RigPose, rounded, zones_json};
use vergence_scene::Scene;
use vergence_sim::{Random, Room, RoomCamera};
use vergence_vision::{Angle, Base, Left, Length, Pixel, Point, Side, Transform, World, Zones};

use super::walls::Walls;
use crate::error::DemoError;

/// Where the robot stands in the corridor.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Place {
    /// Millimetres to the right of the corridor's middle.
    pub x: f64,
    /// Millimetres along the corridor.
    pub along: f64,
    /// Turn to the right.
    pub yaw: Angle,
}

impl Place {
    /// In the middle of the corridor, looking along it.
    #[must_use]
    pub fn along(along: f64) -> Self {
        Self { x: 0.0, along, yaw: Angle::from_rad(0.0) }
    }

    /// The pose of the robot's front link.
    #[must_use]
    pub fn world_from_base(&self) -> Transform<World, Base> {
        let turn = UnitQuaternion::from_axis_angle(&Vector3::y_axis(), self.yaw.rad());
        Transform::new(turn, Vector3::new(self.x, 0.0, self.along))
    }
}

/// A measurement and its truth.
pub struct Station {
    /// Name of the mode.
    pub mode: String,
    /// Where the robot stood.
    pub place: Place,
    /// The pose by which the cloud was made.
    pub pose: RigPose,
    /// The points, in the left camera's frame.
    pub cloud: PairCloud,
    /// Their errors.
    pub score: Score,
    /// What both cameras cover.
    pub zones: Zones,
    /// Distances of the walls, where they were measured.
    pub walls: Option<Walls>,
    /// The left and the right image.
    pub images: [RgbImage; 2],
    /// True pose of the left camera.
    pub world_from_left: Transform<World, Left>,
    /// Seconds for matching and triangulation.
    pub seconds: f64,
    room: Arc<Room>,
    rig: Rig,
}

/// Positions of the axes in a mode, in radians; none for a mode that the rig lacks.
pub fn values(rig: &Rig, mode: &str) -> Vec<f64> {
    rig.mode(mode).map(|mode| mode.targets.iter().map(|target| target.value()).collect()).unwrap_or_default()
}

impl Station {
    /// Photographs the corridor in `mode` at `place` with joints that are off by their play, and measures the pair by the pose that
    /// the joints say and, where that is uncertain, the images.
    pub(super) fn measure(
        rig: &Rig,
        scene: &Arc<Scene>,
        mode: &str,
        place: Place,
        seed: u64,
        clock: fn() -> Duration,
    ) -> Result<Self, DemoError> {
        let said = values(rig, mode);
        let mut random = Random::new(seed);
        let off = |(axis, &value): (usize, &f64)| {
            value + 0.5 * rig.axes.get(axis).map_or(0.0, |axis| axis.play) * random.normal()
        };
        let truth: Vec<f64> = said.iter().enumerate().map(off).collect();
        let true_pose = rig.pose_at_values(&truth);
        let room = Arc::new(Room { scene: scene.as_ref().clone(), world_from_base: place.world_from_base() });
        let images = [Side::Left, Side::Right].map(|side| {
            let camera = RoomCamera { side, lens: *rig.camera(side), room: Arc::clone(&room), seed };
            camera.photograph(&true_pose, 0)
        });
        let begins = clock();
        let by_joints = rig.pose_read_at(&said);
        let matcher: &dyn Matcher = &GuidedMatcher::default();
        let mut times = StageTimes::start(clock);
        let pair = PairImages { left: &images[0], right: &images[1] };
        let standing = PairPose::standing(by_joints.clone());
        let cloud = pair_cloud(pair, rig, &standing, Method::from(matcher), &mut |stage: Stage| times.ended(stage))
            .map_err(|error| DemoError::Matching(error.to_string()))?;
        let seconds = clock().saturating_sub(begins).as_secs_f64();
        let pose = cloud.fused_pose.as_ref().map_or_else(|| by_joints.clone(), |fused| with_fused(&by_joints, fused));
        let mut station = Self {
            mode: mode.to_owned(),
            place,
            zones: rig_zones(rig, &pose).map_err(|error| DemoError::Zones(error.to_string()))?,
            pose,
            cloud,
            score: Score::default(),
            walls: None,
            images,
            world_from_left: room.world_from_left(true_pose.base_from_left),
            seconds,
            room,
            rig: rig.clone(),
        };
        let ranges: Vec<_> = station
            .cloud
            .points
            .iter()
            .map(|found| (Length::from_mm(found.point.point.mm().norm()), station.true_range(found.point.pixels.left)))
            .collect();
        station.score = score(&ranges);
        Ok(station)
    }

    /// The true range at `pixel` of the left image.
    #[must_use]
    pub fn true_range(&self, pixel: Pixel) -> Option<Length> {
        let ray = self.world_from_left * self.rig.left_camera.unproject::<Left>(pixel).ok()?;
        self.room.scene.cast(&self.world_from_left.origin(), &ray).map(|hit| hit.range)
    }

    /// The measured points in the corridor, in millimetres, by the pose that was measured with.
    pub fn in_corridor(&self) -> impl Iterator<Item = Point<World>> {
        let world_from_left = self.place.world_from_base() * self.pose.base_from_left;
        self.cloud.points.iter().map(move |found| world_from_left * found.point.point)
    }

    /// Writes cloud, images and pictures.
    pub(super) fn write(&self, name: &str, out: &Path) -> Result<(), FileError> {
        let images = PairImages { left: &self.images[0], right: &self.images[1] };
        write_scored_pair(out, name, images, &self.cloud, &|pixel| self.true_range(pixel))
    }

    /// What was measured, for people.
    pub(super) fn in_words(&self, task: &str) -> String {
        let told = pose_source_line(self.cloud.fused_pose.as_ref()).unwrap_or_else(|| "  pose by the joints".into());
        format!(
            "  {task} at {:.0} mm: sees stereo {:.0}, mono {:.0}; {} points, median error {:.2} %, within 1.5 m {:.2} %; {:.1} s\n{told}",
            self.place.along,
            self.zones.stereo,
            self.zones.mono,
            self.cloud.points.len(),
            100.0 * self.score.all.median,
            100.0 * self.score.near.median,
            self.seconds
        )
    }

    /// The same for programs.
    pub(super) fn json(&self) -> Value {
        json!({
            "x_mm": rounded(self.place.x),
            "along_mm": rounded(self.place.along),
            "yaw_deg": rounded(self.place.yaw.deg()),
            "zones_deg": zones_json(&self.zones),
            "points": self.cloud.points.len(),
            "depth_rel_err": { "median": self.score.all.median, "p95": self.score.all.p95 },
            "depth_rel_err_within_1500mm": { "median": self.score.near.median, "p95": self.score.near.p95 },
            "pose": pose_source_json(self.cloud.fused_pose.as_ref()),
            "walls_mm": self.walls.as_ref().map(Walls::json),
            "seconds": rounded(self.seconds),
        })
    }
}
