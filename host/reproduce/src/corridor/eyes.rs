//! What both cameras see at a station: rendered images and their matches, or matches drawn from the true geometry.

use std::sync::Arc;
use std::time::Duration;

use image::RgbImage;
use vergence_matching::{GuidedMatcher, Matcher};
use vergence_pipeline::limits::PIXEL_SIGMA;
use vergence_pipeline::{Method, PairCloud, PairImages, PairPose, cloud_of_pairs, pair_cloud};
use vergence_rig::{Rig, RigPose};
use vergence_scene::CorridorPlan;
use vergence_sim::{Random, Room, RoomCamera};
use vergence_vision::{Base, Camera, Kernel, Left, Pixel, PixelPair, Point, Side, Transform, World};

use super::station::Built;
use super::target::{LEAST_PIXELS, red_spot};
use crate::error::DemoError;

/// Places of the left image that are tried for a match. The number of matches is then about that of the rendered corridor.
const TRIED: usize = 2000;
/// Standard deviation of a drawn position, in pixels: with it the ranges are about as wrong as those of the rendered corridor, whose matches
/// are better than the [`PIXEL_SIGMA`] that is stated for all.
const DRAWN_SIGMA: f64 = 0.075;
/// Share of the true matches that a matcher finds wrong, off by up to [`WRONG_BY`] pixels in the right image.
const WRONG: f64 = 0.01;
const WRONG_BY: f64 = 20.0;
/// Standard deviation of the middle of a red spot, in pixels.
const SPOT_SIGMA: f64 = 0.5;
/// Share of the target's pixels that are red enough: its blots are not.
const RED_SHARE: f64 = 0.5;

/// The cameras of a robot at a station.
pub struct Eyes<'a> {
    pub rig: &'a Rig,
    pub corridor: &'a Built,
    pub world_from_base: Transform<World, Base>,
    /// The true pose.
    pub pose: &'a RigPose,
    pub seed: u64,
}

/// What they see.
pub struct Seen {
    pub images: [RgbImage; 2],
    pub target: [Option<Pixel>; 2],
    pub cloud: PairCloud,
    /// Time of matching and triangulation.
    pub seconds: f64,
}

impl Eyes<'_> {
    pub fn world_from_left(&self) -> Transform<World, Left> {
        self.world_from_base * self.pose.base_from_left
    }

    fn world_from_camera(&self, side: Side) -> Transform<World, Camera> {
        match side {
            Side::Left => self.world_from_left().renamed(),
            Side::Right => (self.world_from_left() * self.pose.left_from_right).renamed(),
        }
    }

    /// Renders both images, and measures them with the product's matcher.
    pub fn rendered(&self, by_joints: &RigPose, clock: fn() -> Duration) -> Result<Seen, DemoError> {
        let scene = self.corridor.scene.as_ref().clone();
        let room = Arc::new(Room { scene, world_from_base: self.world_from_base });
        let images = [Side::Left, Side::Right].map(|side| {
            let camera = RoomCamera { side, lens: *self.rig.camera(side), room: Arc::clone(&room), seed: self.seed };
            camera.photograph(self.pose, 0)
        });
        let begins = clock();
        let matcher: &dyn Matcher = &GuidedMatcher::default();
        let pair = PairImages { left: &images[0], right: &images[1] };
        let standing = PairPose::standing(by_joints.clone());
        let cloud = pair_cloud(pair, self.rig, &standing, Method::from(matcher), &mut |_| ())
            .map_err(|error| DemoError::Matching(error.to_string()))?;
        let seconds = clock().saturating_sub(begins).as_secs_f64();
        Ok(Seen { target: images.each_ref().map(red_spot), images, cloud, seconds })
    }

    /// Draws matches from what both cameras truly see, with noise and some wrong ones, and triangulates them as those of a matcher.
    pub fn sampled(&self, by_joints: &RigPose) -> Result<Seen, DemoError> {
        let mut random = Random::new(self.seed ^ 0x5EED);
        let pairs: Vec<_> =
            (0..TRIED).filter_map(|_| self.matched(&mut random)).map(|pair| (pair, PIXEL_SIGMA)).collect();
        let blank = RgbImage::new(1, 1);
        let standing = PairPose::standing(by_joints.clone());
        let cloud = cloud_of_pairs(&pairs, &blank, self.rig, &standing, Kernel::default())
            .map_err(|error| DemoError::Matching(error.to_string()))?;
        let target = [Side::Left, Side::Right].map(|side| self.target(side, &mut random));
        Ok(Seen { target, images: [blank.clone(), blank], cloud, seconds: 0.0 })
    }

    /// A match at a random place of the left image; `None` where the right camera does not see that place of the corridor.
    fn matched(&self, random: &mut Random) -> Option<PixelPair> {
        let size = self.rig.left_camera.size();
        let place = [size.width, size.height].map(|pixels| random.between(0.0, f64::from(pixels) - 1.0));
        let left = Pixel { u: place[0], v: place[1] };
        let world_from_left = self.world_from_camera(Side::Left);
        let ray = world_from_left * self.rig.left_camera.unproject::<Camera>(left).ok()?;
        let range = self.corridor.scene.reach(&world_from_left.origin(), &ray)?;
        let point = Point::from_mm(world_from_left.origin().mm() + ray.vector() * range.mm());
        let mut right = self.seen(Side::Right, &point)?;
        if random.between(0.0, 1.0) < WRONG {
            right.u += random.between(-WRONG_BY, WRONG_BY);
            right.v += random.between(-WRONG_BY, WRONG_BY);
        }
        let mut noisy = |pixel: Pixel, sigma: f64| Pixel {
            u: pixel.u + sigma * random.normal(),
            v: pixel.v + sigma * random.normal(),
        };
        Some(PixelPair { left: noisy(left, DRAWN_SIGMA), right: noisy(right, DRAWN_SIGMA) })
    }

    /// Where the camera on `side` sees a place on a surface; `None` outside its field and where something is before it.
    fn seen(&self, side: Side, point: &Point<World>) -> Option<Pixel> {
        let world_from_camera = self.world_from_camera(side);
        let pixel = self.rig.camera(side).project_point(&(world_from_camera.inverse() * *point)).ok()?;
        (self.rig.camera(side).on_sensor(pixel) && self.corridor.is_clear(&world_from_camera.origin(), point, 2.0))
            .then_some(pixel)
    }

    /// The target in an image, where enough of it is seen.
    fn target(&self, side: Side, random: &mut Random) -> Option<Pixel> {
        let middle = Point::<World>::from_mm(self.corridor.plan.target.into());
        let world_from_camera = self.world_from_camera(side);
        let lens = self.rig.camera(side);
        let pixel =
            lens.project_point(&(world_from_camera.inverse() * middle)).ok().filter(|&pixel| lens.on_sensor(pixel))?;
        let (from, radius) = (world_from_camera.origin(), CorridorPlan::TARGET_RADIUS);
        let way = middle.mm() - from.mm();
        let [across, up] = [way.cross(&nalgebra::Vector3::y()).normalize(), nalgebra::Vector3::y()];
        // The disc of the target as it is seen, at 21 places.
        let steps = || (-2..=2).map(|step| f64::from(step) / 2.0);
        let disc = steps().flat_map(|a| steps().map(move |b| [a, b])).filter(|[a, b]| a.hypot(*b) <= 1.0);
        let at = |[a, b]: [f64; 2]| Point::from_mm(middle.mm() + (across * a + up * b) * (0.9 * radius));
        let clear: Vec<bool> = disc.map(|place| self.corridor.is_clear(&from, &at(place), radius + 5.0)).collect();
        let share = clear.iter().filter(|&&clear| clear).count() as f64 / clear.len() as f64;
        let pixels_radius = lens.pixels_per_radian(vergence_vision::Angle::from_rad(0.0)) * radius / way.norm();
        let pixels = std::f64::consts::PI * pixels_radius.powi(2) * share * RED_SHARE;
        let mut noise = || SPOT_SIGMA * random.normal();
        (pixels >= LEAST_PIXELS as f64).then(|| Pixel { u: pixel.u + noise(), v: pixel.v + noise() })
    }
}
