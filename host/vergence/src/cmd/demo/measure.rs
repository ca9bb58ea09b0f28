//! One measurement of the simulated rig: expose, pose, match, triangulate, score.

use std::sync::Arc;

use image::RgbImage;
use vergence_board::Board;
use vergence_matching::{GuidedMatcher, Matcher};
use vergence_pipeline::{Method, PairCloud, PairImages, PairPose, Score, TriggeredImage, pair_cloud, rig_zones, score};
use vergence_protocol::TriggerMark;
use vergence_rig::{ExposureDelay, HostInstant, Rig, RigPose, StampedImage, TimedEvent};
use vergence_sim::{Room, RoomCamera};
use vergence_vision::{KannalaBrandt, Left, Length, Pixel, Side, Transform, World, Zones};

use crate::failure::Failure;
use crate::sim::SharedRig;
use crate::stage_times::StageTimes;
use crate::stopwatch::Stopwatch;

/// The simulated cameras stamp an image when the host hears of its pulse.
const DELAY: ExposureDelay = ExposureDelay { least_us: 0.0, most_us: 50_000.0 };

/// The two simulated cameras in their room.
pub struct SimulatedPair {
    left: RoomCamera,
    right: RoomCamera,
    mechanics: SharedRig,
    room: Arc<Room>,
}

/// A pair of images and its cloud, with the truth to compare.
pub struct View {
    left: RgbImage,
    right: RgbImage,
    /// The pose at the exposure, from the encoders.
    pub pose: RigPose,
    /// The points.
    pub cloud: PairCloud,
    /// The points compared with the truth.
    pub score: Score,
    /// What the cameras cover in this pose.
    pub zones: Zones,
    /// How long rendering both images took.
    pub expose_seconds: f64,
    /// How long matching and triangulation took.
    pub times: StageTimes,
    world_from_left: Transform<World, Left>,
    lens: KannalaBrandt,
    room: Arc<Room>,
}

impl SimulatedPair {
    /// Two cameras that ride on `simulated`, in the fixed room.
    pub fn new(rig: &Rig, simulated: &SharedRig, seed: u64) -> Self {
        let room = Arc::new(Room::with_rig());
        let camera = |side, lens| RoomCamera { side, lens, room: Arc::clone(&room), seed };
        Self {
            left: camera(Side::Left, rig.left_camera),
            right: camera(Side::Right, rig.right_camera),
            mechanics: simulated.clone(),
            room,
        }
    }

    /// Renders the images of both cameras at `pulse` and measures the pair.
    ///
    /// # Errors
    /// Where image and pulse do not belong together.
    pub fn measure(&self, pulse: &Pulse) -> Result<View, Failure> {
        let exposing = Stopwatch::start();
        let exposed = self.mechanics.lock().exposed_pose();
        let true_pose = exposed.ok_or_else(|| Failure::device("the simulated cameras were not triggered"))?;
        let left = self.left.photograph(&true_pose, pulse.number);
        let right = self.right.photograph(&true_pose, pulse.number);
        let expose_seconds = exposing.seconds();
        let world_from_left = self.room.world_from_left(true_pose.base_from_left);
        let (rig, pose) = (&pulse.rig, pulse.pose()?);
        let images = PairImages { left: &left, right: &right };
        let matcher: &dyn Matcher = &GuidedMatcher::default();
        let mut times = StageTimes::start();
        let cloud = pair_cloud(images, rig, &pose, Method::from(matcher), &mut |stage| times.ended(stage))
            .map_err(|error| Failure::device(format!("the simulated images cannot be matched: {error}")))?;
        let mut view = View {
            zones: rig_zones(rig, pose.at_middle())
                .map_err(|error| Failure::check(format!("the zones of this pose: {error}")))?,
            pose: pose.at_middle().clone(),
            cloud,
            times,
            score: Score::default(),
            expose_seconds,
            world_from_left,
            lens: rig.left_camera,
            room: Arc::clone(&self.room),
            left,
            right,
        };
        view.score = view.scored();
        Ok(view)
    }
}

impl View {
    /// The images of both cameras.
    pub fn images(&self) -> PairImages<'_> {
        PairImages { left: &self.left, right: &self.right }
    }

    /// The true range at `pixel` of the left image.
    pub fn true_range(&self, pixel: Pixel) -> Option<Length> {
        let ray = self.world_from_left * self.lens.unproject::<Left>(pixel).ok()?;
        self.room.scene.cast(&self.world_from_left.origin(), &ray).map(|hit| hit.range)
    }

    fn scored(&self) -> Score {
        let ranges: Vec<_> = self
            .cloud
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

/// A pulse that fired both cameras, and what the host knows of it.
pub struct Pulse {
    rig: Rig,
    mark: TriggerMark,
    /// The pulse on the host's clock.
    at: HostInstant,
    /// The time stamp of both images.
    stamp: HostInstant,
    /// The images are the `number`th of their cameras, from zero.
    number: u32,
}

impl Pulse {
    /// Has the board fire the cameras for the `number`th time, from zero.
    ///
    /// # Errors
    /// Where the link ended, or the clocks were not compared.
    pub async fn fired_by(board: &mut Board, number: u32) -> Result<Self, Failure> {
        let mark = board.fire_cameras().await?;
        let stamp = HostInstant { us: board.client().clock().now().0 as f64, error_us: 0.0 };
        let at = board.client().clock_map().host_at(mark.at);
        let at = at.ok_or_else(|| unknown_pose(&"the clocks were not compared"))?;
        Ok(Self { rig: board.rig().clone(), mark, at, stamp, number })
    }

    /// The rig's pose when the images were exposed: where the encoders were at the edge of the pulse.
    fn pose(&self) -> Result<PairPose, Failure> {
        let image = TriggeredImage {
            pulse: TimedEvent { seq: self.mark.seq, at: self.at },
            counts: &self.mark.counts,
            stamp: StampedImage { seq: 0, middle: self.stamp },
            delay: DELAY,
        };
        PairPose::at_pulse(&self.rig, &image).map_err(|error| unknown_pose(&error))
    }
}

fn unknown_pose(why: &dyn std::fmt::Display) -> Failure {
    Failure::device(format!("the pose at the exposure is unknown: {why}"))
}
