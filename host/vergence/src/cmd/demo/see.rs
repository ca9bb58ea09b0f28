//! One look of the simulated rig: expose, know the pose, match, triangulate, score.

use std::sync::Arc;

use image::RgbImage;
use nalgebra::{UnitQuaternion, Vector3};
use vergence_matching::GuidedMatcher;
use vergence_protocol::Microseconds;
use vergence_rig::{Rig, RigPose, TrackGap};
use vergence_scene::{Optics, Scene};
use vergence_vision::{Base, KannalaBrandt, Left, Length, Pixel, Transform, World, Zones};

use super::score::{Score, score};
use crate::board::Board;
use crate::camera::{Camera, Eye, SimulatedCamera, Stage};
use crate::failure::Failure;
use crate::link::HostClock;
use crate::look::{Eyes, Look, look};
use crate::rig_zones::rig_zones;
use crate::sim::SharedRig;
use crate::stopwatch::Stopwatch;

/// The two simulated cameras in their room.
pub struct SimulatedEyes {
    left: SimulatedCamera,
    right: SimulatedCamera,
    rig: SharedRig,
    stage: Arc<Stage>,
}

/// What one look came to.
pub struct View {
    left: RgbImage,
    right: RgbImage,
    /// The pose that the encoders tell for the exposure.
    pub pose: RigPose,
    /// Matches and points.
    pub look: Look,
    /// The points against the truth.
    pub score: Score,
    /// What the cameras cover in this pose.
    pub zones: Zones,
    /// How long the exposure, that is rendering, took.
    pub expose_seconds: f64,
    world_from_left: Transform<World, Left>,
    lens: KannalaBrandt,
    stage: Arc<Stage>,
}

impl SimulatedEyes {
    /// Two cameras that ride on `simulated`, in the fixed room.
    pub fn new(rig: &Rig, simulated: &SharedRig, clock: HostClock, seed: u64) -> Self {
        // The middle of the bench at its nominal baseline of 145 mm stands in the middle of the room.
        let middle = Vector3::new(-72.5, 0.0, 0.0);
        let world_from_base = Transform::<World, Base>::new(UnitQuaternion::identity(), middle);
        let stage = Arc::new(Stage { scene: Scene::room(), world_from_base });
        let camera = |eye, lens| SimulatedCamera {
            eye,
            lens,
            optics: Optics::default(),
            stage: Arc::clone(&stage),
            rig: simulated.clone(),
            clock,
            seed,
            frames: 0,
        };
        Self {
            left: camera(Eye::Left, rig.left_camera),
            right: camera(Eye::Right, rig.right_camera),
            rig: simulated.clone(),
            stage,
        }
    }

    /// Exposes both cameras and works through what they saw.
    ///
    /// # Errors
    /// Where the link ended, or the encoder stream does not cover the exposure.
    pub async fn see(&mut self, board: &mut Board) -> Result<View, Failure> {
        let exposing = Stopwatch::start();
        let (Some(left), Some(right)) = (self.left.grab()?, self.right.grab()?) else {
            return Err(Failure::device("a simulated camera has no more frames"));
        };
        let expose_seconds = exposing.seconds();
        let world_from_left = self.stage.world_from_left(self.rig.lock().true_pose().base_from_left);
        let exposed_at = left.exposed_at.unwrap_or_else(|| board.client().clock().now());
        let pose = pose_at(board, exposed_at).await?;
        let rig = board.rig();
        let eyes = Eyes { left: &left.image, right: &right.image };
        let look = look(eyes, rig, &pose, &GuidedMatcher::default())
            .map_err(|error| Failure::device(format!("the simulated images cannot be matched: {error}")))?;
        let mut view = View {
            zones: rig_zones(rig, &pose)?,
            pose,
            look,
            score: Score::default(),
            expose_seconds,
            world_from_left,
            lens: rig.left_camera,
            stage: Arc::clone(&self.stage),
            left: left.image,
            right: right.image,
        };
        view.score = view.scored();
        Ok(view)
    }
}

impl View {
    /// The images.
    pub fn eyes(&self) -> Eyes<'_> {
        Eyes { left: &self.left, right: &self.right }
    }

    /// The true range of what the left camera sees at `pixel`.
    pub fn true_range(&self, pixel: Pixel) -> Option<Length> {
        let ray = self.world_from_left * self.lens.unproject::<Left>(pixel).ok()?;
        self.stage.scene.cast(&self.world_from_left.origin(), &ray).map(|hit| hit.range)
    }

    fn scored(&self) -> Score {
        let ranges: Vec<_> = self
            .look
            .points
            .iter()
            .map(|point| {
                let measured = Length::from_mm(point.point.point.mm().norm());
                (measured, self.true_range(point.point.pixels.left))
            })
            .collect();
        score(&ranges)
    }
}

/// The rig's pose at an instant on the host's clock, as encoders and clock exchange tell it.
async fn pose_at(board: &mut Board, exposed_at: Microseconds) -> Result<RigPose, Failure> {
    let fail = |gap: TrackGap| Failure::device(format!("the pose at the exposure is unknown: {gap}"));
    loop {
        let instant = board.client().clock_map().board_at(exposed_at);
        match instant.map(|instant| board.client().track().at(instant)) {
            Some(Ok(joints)) => return Ok(board.rig().pose(&joints)),
            Some(Err(gap)) if gap != TrackGap::NotYet => return Err(fail(gap)),
            // The readings after the exposure, or the first clock exchange, are still on their way.
            _ => {
                board.next_pose().await?;
            }
        }
    }
}
