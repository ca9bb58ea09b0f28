//! Pairs of the simulated room from one bench, in a mode or while its stages move.

use std::sync::Arc;

use image::{DynamicImage, GrayImage, RgbImage};
use vergence_pipeline::PairImages;
use vergence_rig::{Rig, RigPose};
use vergence_sim::{Random, Room, RoomCamera};
use vergence_vision::{Angle, CloudPoint, Length, Pixel, Side};

/// Largest distance of a right match from the truth, in pixels.
const RIGHT_PX: f64 = 2.5;
/// At the edge of an object a keypoint belongs to the object or to its background: the truth is the nearest surface at this
/// distance around the keypoint, in pixels.
const AROUND_PX: f64 = 0.8;
/// Baseline of all ways, in millimetres.
const BASELINE_MM: f64 = 145.0;
/// How far the reading of an encoder that stands departs, in counts: it stands beside the edge of a count.
const FLICKER_COUNTS: f64 = 1.0;
/// Different pairs of one way.
const DIFFERENT: usize = 12;

/// Where the stages are.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Way {
    /// They stand, and the optical axes are this far apart.
    Standing(Angle),
    /// They turn to and fro between 60° and beyond, by this angle from pair to pair.
    Turning(Angle),
}

impl Way {
    /// The angle between the optical axes at a pair.
    fn separation(self, number: usize) -> Angle {
        match self {
            Self::Standing(separation) => separation,
            Self::Turning(step) => Angle::from_deg(60.0) + step * number as f64,
        }
    }
}

/// Both images of one exposure, and where they were taken.
pub struct LiveFrame {
    /// In grey: matching sees no colours, and three times as much memory would count as the matcher's.
    images: [GrayImage; 2],
    /// Baseline in millimetres and separation in radians.
    axes: [f64; 2],
    pose: RigPose,
}

impl LiveFrame {
    /// Both images, left first.
    #[must_use]
    pub const fn images(&self) -> &[GrayImage; 2] {
        &self.images
    }
}

/// A pair as cameras and encoders deliver it.
pub struct LivePair<'a> {
    /// What was exposed.
    pub frame: &'a LiveFrame,
    /// The pose by the encoders.
    pub pose: RigPose,
    images: [RgbImage; 2],
}

impl LivePair<'_> {
    /// Both images.
    #[must_use]
    pub const fn images(&self) -> PairImages<'_> {
        let [left, right] = &self.images;
        PairImages { left, right }
    }
}

/// Pairs that follow one another.
pub struct LiveFrames {
    /// The rig that took them.
    pub rig: Rig,
    frames: Vec<LiveFrame>,
    left: RoomCamera,
}

impl LiveFrames {
    /// Renders the pairs of `rig` on `way`.
    #[must_use]
    pub fn rendered(rig: &Rig, way: Way) -> Self {
        let room = Arc::new(Room::with_rig());
        let camera = |side| RoomCamera { side, lens: *rig.camera(side), room: Arc::clone(&room), seed: 1 };
        let cameras = [Side::Left, Side::Right].map(camera);
        let tables = cameras.each_ref().map(RoomCamera::ray_table);
        let frame = |number: usize| {
            let axes = [BASELINE_MM, way.separation(number).rad()];
            let pose = rig.pose_read_at(&axes);
            let images = [0, 1].map(|i| {
                let there = room.world_from_camera(cameras[i].side, &pose);
                let image = cameras[i].photograph_quick(&tables[i], number as u32, &|_| there);
                DynamicImage::ImageRgb8(image).to_luma8()
            });
            LiveFrame { images, axes, pose }
        };
        let [left, _] = cameras.clone();
        Self { rig: rig.clone(), frames: (0..DIFFERENT).map(frame).collect(), left }
    }

    /// The pair `number`: the different ones, to and fro. Each encoder reads up to `FLICKER_COUNTS` beside the true one, each time anew.
    #[must_use]
    pub fn at(&self, number: usize) -> LivePair<'_> {
        let period = 2 * (DIFFERENT - 1);
        let step = number % period;
        let frame = &self.frames[step.min(period - step)];
        let mut random = Random::new(number as u64);
        let mut read = frame.axes;
        for (read, axis) in read.iter_mut().zip(&self.rig.axes) {
            *read += random.between(-FLICKER_COUNTS, FLICKER_COUNTS).round() * axis.value_per_count();
        }
        let images = frame.images.each_ref().map(|grey| DynamicImage::ImageLuma8(grey.clone()).to_rgb8());
        LivePair { frame, pose: self.rig.pose_read_at(&read), images }
    }

    /// How many of `points` are right, and how many there are.
    #[must_use]
    pub fn judge(&self, frame: &LiveFrame, points: &[CloudPoint]) -> [usize; 2] {
        let pixels = points.iter().map(|point| [point.pixels.left, point.pixels.right]);
        [pixels.filter(|pair| self.is_right(frame, *pair)).count(), points.len()]
    }

    /// Whether both pixels show the same place.
    #[must_use]
    pub fn is_right(&self, frame: &LiveFrame, [left, right]: [Pixel; 2]) -> bool {
        let places = [(0.0, 0.0), (AROUND_PX, 0.0), (-AROUND_PX, 0.0), (0.0, AROUND_PX), (0.0, -AROUND_PX)];
        let shown = |range: Length| {
            let ray = self.rig.left_camera.unproject::<vergence_vision::Left>(left).ok()?;
            self.rig.right_camera.project_point(&(frame.pose.left_from_right.inverse() * ray.at(range.mm()))).ok()
        };
        places.into_iter().any(|(du, dv)| {
            let beside = Pixel { u: left.u + du, v: left.v + dv };
            let shown = self.left.true_range(&frame.pose, beside).and_then(shown);
            shown.is_some_and(|shown| (shown.u - right.u).hypot(shown.v - right.v) <= RIGHT_PX)
        })
    }

    /// All pairs that differ.
    #[must_use]
    pub fn different(&self) -> &[LiveFrame] {
        &self.frames
    }
}
