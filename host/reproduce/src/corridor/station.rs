//! One measurement of the robot: where it stands, what its joints say, and the cloud.

use std::path::Path;
use std::sync::Arc;
use std::time::Duration;

use image::RgbImage;
use serde_json::{Value, json};
use vergence_files::FileError;
use vergence_output::{pose_source_json, pose_source_line, write_scored_pair};
use vergence_pipeline::{PairCloud, PairImages, Score, rig_zones, score};
use vergence_rig::{Rig, RigPose, rounded, zones_json};
use vergence_scene::{CorridorPlan, Scene};
use vergence_vision::{Angle, Left, Length, Pixel, Point, Right, Transform, UnitRay, World, Zones};

use super::eyes::{Eyes, Seen};
use super::joints::Standing;
use super::place::Place;
use super::walls::Walls;
use crate::error::DemoError;

/// A corridor with its plan.
#[derive(Clone)]
pub struct Built {
    /// Where everything stands.
    pub plan: Arc<CorridorPlan>,
    /// The same as surfaces.
    pub scene: Arc<Scene>,
}

impl Built {
    /// The corridor of `plan`.
    #[must_use]
    pub fn new(plan: CorridorPlan) -> Self {
        Self { scene: Arc::new(Scene::of_corridor(&plan)), plan: Arc::new(plan) }
    }

    /// Whether nothing stands between two places, but for the last `margin` millimetres.
    pub(super) fn is_clear(&self, from: &Point<World>, to: &Point<World>, margin: f64) -> bool {
        let way = to.mm() - from.mm();
        let Some(ray) = UnitRay::new(way) else { return false };
        self.scene.reach(from, &ray).is_none_or(|reach| reach.mm() > way.norm() - margin)
    }
}

/// How the cameras see the corridor.
#[derive(Clone, Copy, Debug)]
pub enum Sight {
    /// Images are rendered and matched; the clock times that.
    Rendered(fn() -> Duration),
    /// Matches are drawn from the true geometry, with noise: quick, but without images and without the matcher.
    Sampled,
}

/// A measurement and its truth.
pub struct Station {
    /// Name of the mode.
    pub mode: String,
    /// Where the robot stood.
    pub place: Place,
    /// The pose by which the cloud was made.
    pub pose: RigPose,
    /// How far the right camera is off in the left one's frame: by the joints alone, and by that pose.
    pub off: [PoseError; 2],
    /// The points, in the left camera's frame.
    pub cloud: PairCloud,
    /// Their errors.
    pub score: Score,
    /// What both cameras cover.
    pub zones: Zones,
    /// Distances of the walls, where they were measured.
    pub walls: Option<Walls>,
    /// Where the left and the right image show the target.
    pub target: [Option<Pixel>; 2],
    /// The left and the right image; of one pixel where none were rendered.
    pub images: [RgbImage; 2],
    /// True pose of the left camera.
    pub world_from_left: Transform<World, Left>,
    /// True pose of the right camera.
    pub world_from_right: Transform<World, Right>,
    /// Seconds for matching and triangulation.
    pub seconds: f64,
    corridor: Built,
    rig: Rig,
}

/// How far a pose is off.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PoseError {
    /// Angle between the stated and the true orientation of the right camera.
    pub rotation: Angle,
    /// Distance between its stated and its true place.
    pub position: Length,
}

impl PoseError {
    fn of(stated: &RigPose, truth: &RigPose) -> Self {
        let [stated, truth] = [stated, truth].map(|pose| pose.left_from_right);
        Self {
            rotation: Angle::from_rad(stated.rotation().angle_to(&truth.rotation())),
            position: Length::from_mm((stated.origin().mm() - truth.origin().mm()).norm()),
        }
    }

    fn json(&self) -> Value {
        json!({ "rotation_deg": rounded(self.rotation.deg()), "position_mm": rounded(self.position.mm()) })
    }
}

/// Positions of the axes in a mode, in radians; none for a mode that the rig lacks.
pub fn values(rig: &Rig, mode: &str) -> Vec<f64> {
    rig.mode(mode).map(|mode| mode.targets.iter().map(|target| target.value()).collect()).unwrap_or_default()
}

impl Station {
    /// Sees the corridor in `mode` at `place` with the cameras where they truly are, and measures the pair by the pose that the joints
    /// say and, where that is uncertain, the images.
    pub(super) fn measure(
        (rig, corridor): (&Rig, &Built),
        (mode, standing): (&str, &Standing),
        place: Place,
        seed: u64,
        sight: Sight,
    ) -> Result<Self, DemoError> {
        let Standing { by_joints, truth: true_pose } = standing;
        let eyes = Eyes { rig, corridor, world_from_base: place.world_from_base(), pose: true_pose, seed };
        let Seen { images, target, cloud, seconds } = match sight {
            Sight::Rendered(clock) => eyes.rendered(by_joints, clock)?,
            Sight::Sampled => eyes.sampled(by_joints)?,
        };
        let pose = cloud.pose(by_joints);
        let mut station = Self {
            mode: mode.to_owned(),
            place,
            zones: rig_zones(rig, &pose).map_err(|error| DemoError::Zones(error.to_string()))?,
            off: [by_joints, &pose].map(|pose| PoseError::of(pose, true_pose)),
            pose,
            cloud,
            score: Score::default(),
            walls: None,
            target,
            images,
            world_from_left: eyes.world_from_left(),
            world_from_right: eyes.world_from_left() * true_pose.left_from_right,
            seconds,
            corridor: corridor.clone(),
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

    /// Whether one of the cameras sees a place in free space.
    pub(super) fn sees(&self, point: &Point<World>) -> bool {
        let in_left = self.rig.left_camera.project_point(&(self.world_from_left.inverse() * *point));
        let in_right = self.rig.right_camera.project_point(&(self.world_from_right.inverse() * *point));
        let is_clear = |from: Point<World>| self.corridor.is_clear(&from, point, 0.0);
        (in_left.is_ok() && is_clear(self.world_from_left.origin()))
            || (in_right.is_ok() && is_clear(self.world_from_right.origin()))
    }

    /// The plan of the corridor: the truth.
    pub(super) fn plan(&self) -> &CorridorPlan {
        &self.corridor.plan
    }

    /// The true range at `pixel` of the left image.
    #[must_use]
    pub fn true_range(&self, pixel: Pixel) -> Option<Length> {
        let ray = self.world_from_left * self.rig.left_camera.unproject::<Left>(pixel).ok()?;
        self.corridor.scene.reach(&self.world_from_left.origin(), &ray)
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
        let [joints, pose] = self.off;
        format!(
            "  {task} at {:.0} mm: sees stereo {:.0}, mono {:.0}; {} points, median error {:.2} %, within 1.5 m {:.2} %; {:.1} s\n{told}\n  \
             that pose is off by {:.3} and {:.2}, by the joints alone {:.3} and {:.2}",
            self.place.along,
            self.zones.stereo,
            self.zones.mono,
            self.cloud.points.len(),
            100.0 * self.score.all.median,
            100.0 * self.score.near.median,
            self.seconds,
            pose.rotation,
            pose.position,
            joints.rotation,
            joints.position
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
            "pose": pose_source_json(&self.pose, self.cloud.fused_pose.as_ref()),
            "pose_off": self.off[1].json(),
            "joints_off": self.off[0].json(),
            "walls_mm": self.walls.as_ref().map(Walls::json),
            "seconds": rounded(self.seconds),
        })
    }
}
