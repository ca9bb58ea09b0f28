//! Pairs of the simulated room from one bench, in a mode or while its stages move.

use std::sync::Arc;

use image::RgbImage;
use vergence_pipeline::PairImages;
use vergence_rig::{Rig, RigPose};
use vergence_sim::{Room, RoomCamera};
use vergence_vision::{Angle, CloudPoint, Length, Pixel, Side};

/// Largest distance of a right match from the truth, in pixels.
const RIGHT_PX: f64 = 2.5;
/// At the edge of an object a keypoint belongs to the object or to its background: the truth is the nearest surface at this
/// distance around the keypoint, in pixels.
const AROUND_PX: f64 = 0.8;
/// Baseline of all ways, in millimetres.
const BASELINE_MM: f64 = 145.0;
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

/// Both images of one exposure, and the true pose.
pub struct LiveFrame {
    images: [RgbImage; 2],
    /// The pose, known as a calibrated bench knows it.
    pub pose: RigPose,
}

impl LiveFrame {
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
            let pose = rig.pose_read_at(&[BASELINE_MM, way.separation(number).rad()]);
            let images = [0, 1].map(|i| {
                let there = room.world_from_camera(cameras[i].side, &pose);
                cameras[i].photograph_quick(&tables[i], number as u32, &|_| there)
            });
            LiveFrame { images, pose }
        };
        let [left, _] = cameras.clone();
        Self { rig: rig.clone(), frames: (0..DIFFERENT).map(frame).collect(), left }
    }

    /// The pair `number`: the different ones, to and fro.
    #[must_use]
    pub fn at(&self, number: usize) -> &LiveFrame {
        let period = 2 * (DIFFERENT - 1);
        let step = number % period;
        &self.frames[step.min(period - step)]
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
