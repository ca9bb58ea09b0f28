//! One look of the simulated rig: expose, know the pose, match, triangulate, score.

use std::sync::Arc;

use image::RgbImage;
use vergence_matching::GuidedMatcher;
use vergence_protocol::FrameMark;
use vergence_rig::{ExposureDelay, Fate, FramePairing, JointsAt, RigPose, StampedFrame, TimedEvent};
use vergence_scene::Optics;
use vergence_vision::{KannalaBrandt, Left, Length, Pixel, Side, Transform, World, Zones};

use crate::board::Board;
use crate::camera::{Frame, SimulatedCamera, Stage};
use crate::failure::Failure;
use crate::link::HostClock;
use crate::look::{Eyes, Look, look};
use crate::rig_zones::rig_zones;
use crate::score::{Score, score};
use crate::sim::SharedRig;
use crate::stopwatch::Stopwatch;

/// A simulated frame is stamped as soon as the host knows of its pulse.
const DELAY: ExposureDelay = ExposureDelay { least_us: 0.0, most_us: 50_000.0 };

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
    pub fn new(rig: &vergence_rig::Rig, simulated: &SharedRig, clock: HostClock, seed: u64) -> Self {
        let stage = Arc::new(Stage::room());
        let camera = |side, lens| SimulatedCamera {
            side,
            lens,
            optics: Optics::default(),
            stage: Arc::clone(&stage),
            rig: simulated.clone(),
            clock,
            seed,
            frames: 0,
        };
        Self {
            left: camera(Side::Left, rig.left_camera),
            right: camera(Side::Right, rig.right_camera),
            rig: simulated.clone(),
            stage,
        }
    }

    /// Exposes both cameras and works through what they saw.
    ///
    /// # Errors
    /// Where the link ended, or frame and pulse do not belong together.
    pub async fn see(&mut self, board: &mut Board) -> Result<View, Failure> {
        let exposing = Stopwatch::start();
        let mark = board.fire_cameras().await?;
        let exposed = self.rig.lock().exposed_pose();
        let (Some(left), Some(right), Some(true_pose)) =
            (self.left.grab_triggered(), self.right.grab_triggered(), exposed)
        else {
            return Err(Failure::device("the simulated cameras were not fired"));
        };
        let expose_seconds = exposing.seconds();
        let world_from_left = self.stage.world_from_left(true_pose.base_from_left);
        let pose = pose_of(&left, &mark, board)?;
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

/// The rig's pose when `frame` was exposed: where the encoders were at the edge of the pulse that fired it.
fn pose_of(frame: &Frame, mark: &FrameMark, board: &Board) -> Result<RigPose, Failure> {
    let unknown = |why: &dyn std::fmt::Display| Failure::device(format!("the pose at the exposure is unknown: {why}"));
    let middle = frame.exposed_at.ok_or_else(|| unknown(&"the frame has no time stamp"))?;
    let at = board.client().clock_map().host_at(mark.at).ok_or_else(|| unknown(&"the clocks were not compared"))?;
    // Fired one by one.
    let mut pairing = FramePairing::new(DELAY, f64::INFINITY);
    pairing.event(TimedEvent { seq: mark.seq, at });
    pairing.frame(StampedFrame { seq: 0, middle });
    match pairing.take() {
        Some(Fate::Paired { .. }) => Ok(board.rig().pose(&JointsAt::latched(&mark.counts))),
        _ => Err(unknown(&"the frame belongs to no pulse")),
    }
}
