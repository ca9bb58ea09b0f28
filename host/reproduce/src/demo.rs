//! One measurement of the simulated rig in its room: expose, pose, match, triangulate, score.

use std::path::Path;
use std::sync::Arc;
use std::time::Duration;

use image::RgbImage;
use serde_json::{Value, json};
use vergence_board::{Board, Shared};
use vergence_files::FileError;
use vergence_matching::{GuidedMatcher, Matcher};
use vergence_output::{dropped_json, dropped_lines, write_scored_pair};
use vergence_pipeline::{
    Method, PairCloud, PairImages, PairPose, Score, Spread, Stage, StageTimes, TriggeredImage, ZONE_RADIUS, pair_cloud,
    rig_zones, score,
};
use vergence_protocol::TriggerMark;
use vergence_rig::{
    ExposureDelay, HostInstant, Mode, Rig, RigPose, StampedImage, TimedEvent, axes_json, rounded, zones_json,
};
use vergence_scene::TrueLens;
use vergence_sim::{Room, RoomCamera, SimulatedRig};
use vergence_vision::{Length, Pixel, Side, Zones};

use crate::error::DemoError;

/// A simulated rig, shared between the task that serves it and the cameras on it.
type SharedRig = Shared<SimulatedRig>;

/// The simulated cameras stamp an image when the host hears of its pulse.
const DELAY: ExposureDelay = ExposureDelay { least_us: 0.0, most_us: 50_000.0 };

/// The two simulated cameras in their room.
pub struct SimulatedPair {
    left: RoomCamera<TrueLens>,
    right: RoomCamera<TrueLens>,
    mechanics: SharedRig,
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
    /// Seconds that rendering both images took.
    pub expose_seconds: f64,
    /// How long matching and triangulation took.
    pub times: StageTimes,
    /// The left camera and where it truly was.
    camera: RoomCamera<TrueLens>,
    true_pose: RigPose,
}

impl SimulatedPair {
    /// Two cameras with these lenses, left and right, that ride on `simulated`, in the fixed room.
    #[must_use]
    pub fn new([left, right]: [TrueLens; 2], simulated: &SharedRig, seed: u64) -> Self {
        let room = Arc::new(Room::with_rig());
        let camera = |side, lens| RoomCamera { side, lens, room: Arc::clone(&room), seed };
        Self { left: camera(Side::Left, left), right: camera(Side::Right, right), mechanics: simulated.clone() }
    }

    /// Renders the images of both cameras at `pulse` and measures the pair; `clock` times the work.
    ///
    /// # Errors
    /// Where image and pulse do not belong together.
    pub fn measure(&self, pulse: &Pulse, clock: fn() -> Duration) -> Result<View, DemoError> {
        let exposing = clock();
        let exposed = self.mechanics.lock().exposed_pose();
        let true_pose = exposed.ok_or(DemoError::NotTriggered)?;
        let left = self.left.photograph(&true_pose, pulse.number);
        let right = self.right.photograph(&true_pose, pulse.number);
        let expose_seconds = clock().saturating_sub(exposing).as_secs_f64();
        let (rig, pose) = (&pulse.rig, pulse.pose()?);
        let images = PairImages { left: &left, right: &right };
        let matcher: &dyn Matcher = &GuidedMatcher::default();
        let mut times = StageTimes::start(clock);
        let cloud = pair_cloud(images, rig, &pose, Method::from(matcher), &mut |stage| times.ended(stage))
            .map_err(|error| DemoError::Matching(error.to_string()))?;
        let mut view = View {
            zones: rig_zones(rig, pose.at_middle()).map_err(|error| DemoError::Zones(error.to_string()))?,
            pose: pose.at_middle().clone(),
            cloud,
            times,
            score: Score::default(),
            expose_seconds,
            camera: self.left.clone(),
            true_pose,
            left,
            right,
        };
        view.score = view.scored();
        Ok(view)
    }
}

impl View {
    /// The images of both cameras.
    #[must_use]
    pub fn images(&self) -> PairImages<'_> {
        PairImages { left: &self.left, right: &self.right }
    }

    /// The true range at `pixel` of the left image, by the light of the true lens.
    #[must_use]
    pub fn true_range(&self, pixel: Pixel) -> Option<Length> {
        self.camera.true_range(&self.true_pose, pixel)
    }

    /// Writes the cloud, the images that it was measured from, and pictures of matches, ranges and errors to the folder `out`,
    /// under names that begin with `mode`.
    ///
    /// # Errors
    /// [`FileError::Write`].
    pub fn write(&self, mode: &str, out: &Path) -> Result<(), FileError> {
        write_scored_pair(out, mode, self.images(), &self.cloud, &|pixel| self.true_range(pixel))
    }

    /// What was measured in `mode` of `rig`, for people.
    #[must_use]
    pub fn in_words(&self, mode: &Mode, rig: &Rig) -> String {
        let axes = rig.axes.iter().zip(mode.targets.iter().zip(&self.pose.axes));
        let poses: Vec<_> =
            axes.map(|(axis, (target, &reached))| format!("{} {target} -> {reached}", axis.name)).collect();
        let [stereo, mono, blind] = [self.zones.stereo, self.zones.mono, self.zones.blind];
        let (score, cloud) = (&self.score, &self.cloud);
        let percent = |share: f64| 100.0 * share;
        let dropped: String = dropped_lines(&cloud.dropped).iter().map(|line| format!("\n         {line}")).collect();
        format!(
            "{}\n  pose     {}\n  zones    stereo {stereo:.1}, mono {mono:.1}, blind {blind:.1} on a circle of {:.0}\n  \
             points   {} of {} matches, {} keypoints{dropped}\n  error    median {:.2} %, 95 % below {:.2} %, {:.2} % of points off by more than 10 %\n  \
             within 1.5 m: {} points, median {:.2} %\n  time     expose {:.2} s (simulated), match {:.2} s, triangulate {:.4} s",
            mode.name,
            poses.join(", "),
            ZONE_RADIUS,
            cloud.points.len(),
            cloud.matches,
            cloud.keypoints,
            percent(score.all.median),
            percent(score.all.p95),
            percent(score.outlier_fraction),
            score.near.points,
            percent(score.near.median),
            self.expose_seconds,
            self.times.of(Stage::Match),
            self.times.of(Stage::Triangulate),
        )
    }

    /// The same for programs.
    #[must_use]
    pub fn json(&self, mode: &Mode, rig: &Rig) -> Value {
        let spread = |spread: &Spread| json!({ "median": spread.median, "p95": spread.p95 });
        json!({
            "name": mode.name,
            "commanded": axes_json(rig, &mode.targets),
            "achieved": axes_json(rig, &self.pose.axes),
            "zones_deg": zones_json(&self.zones),
            "points": self.cloud.points.len(),
            "matches": self.cloud.matches,
            "keypoints": self.cloud.keypoints,
            "depth_rel_err": spread(&self.score.all),
            "depth_rel_err_within_1500mm": spread(&self.score.near),
            "points_within_1500mm": self.score.near.points,
            "outlier_fraction": self.score.outlier_fraction,
            "dropped": dropped_json(&self.cloud.dropped),
            "stage_seconds": {
                "expose": rounded(self.expose_seconds),
                "match": rounded(self.times.of(Stage::Match)),
                "triangulate": rounded(self.times.of(Stage::Triangulate)),
            },
        })
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
    pub async fn fired_by(board: &mut Board, number: u32) -> Result<Self, DemoError> {
        let mark = board.fire_cameras().await?;
        let stamp = HostInstant { us: board.client().clock().now().0 as f64, error_us: 0.0 };
        let at = board.client().clock_map().host_at(mark.at);
        let at = at.ok_or_else(|| DemoError::UnknownPose("the clocks were not compared".into()))?;
        Ok(Self { rig: board.rig().clone(), mark, at, stamp, number })
    }

    /// The rig's pose when the images were exposed: where the encoders were at the edge of the pulse.
    pub(crate) fn pose(&self) -> Result<PairPose, DemoError> {
        let image = TriggeredImage {
            pulse: TimedEvent { seq: self.mark.seq, at: self.at },
            counts: &self.mark.counts,
            stamp: StampedImage { seq: 0, middle: self.stamp },
            delay: DELAY,
        };
        PairPose::at_pulse(&self.rig, &image).map_err(|error| DemoError::UnknownPose(error.to_string()))
    }
}
