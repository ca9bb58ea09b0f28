//! A simulated person who holds a calibration target before simulated cameras, at another place after every second image.

use image::{DynamicImage, RgbImage};
use nalgebra::{UnitQuaternion, Vector3};
use vergence_camera::{Camera, CameraError, CameraImage};
use vergence_scene::{Lens, LensChoice, Optics, Sheet, SheetView, Target, photograph_sheet};
use vergence_vision::{Camera as CameraFrame, Frame, KannalaBrandt, Left, Point, Right, Side, Transform, World};

use crate::Random;

/// Distances from the left camera at which the target is held, in millimetres.
const RANGE_MM: [f64; 2] = [180.0, 420.0];
/// Number of images for which each place is held, so that the target is seen to stand still.
const HELD_IMAGES: u64 = 2;
/// Number of places tried until one is in sight of the cameras.
const TRIES: u32 = 10_000;

/// A target held before two cameras that stand still.
#[derive(Clone, Copy, Debug)]
pub struct HeldTarget {
    /// The left lens.
    pub left: KannalaBrandt,
    /// The right lens and its pose.
    pub right: (KannalaBrandt, Transform<Left, Right>),
    /// Whether both cameras must see the target.
    pub both: bool,
    /// The target.
    pub target: Sheet,
    /// Seed of the places and of the image noise.
    pub seed: u64,
}

impl HeldTarget {
    /// The `index`th place; `None` where the cameras see the target nowhere.
    #[must_use]
    pub fn left_from_target(&self, index: u64) -> Option<Transform<Left, Target>> {
        let mut random = Random::new(self.seed ^ (index + 1).wrapping_mul(0x9e37_79b9_7f4a_7c15));
        let mut uniform = move |low, high| random.between(low, high);
        (0..TRIES).find_map(|_| {
            // Evenly over the part of the sphere that the lens sees.
            let (low, turn) = (self.left.theta_max().rad().cos(), uniform(0.0, std::f64::consts::TAU));
            let z = uniform(low, 1.0);
            let side = (1.0 - z * z).sqrt();
            let towards = Vector3::new(side * turn.cos(), side * turn.sin(), z);
            let facing = UnitQuaternion::rotation_between(&Vector3::z(), &towards)?;
            let tilt = UnitQuaternion::from_euler_angles(uniform(-0.7, 0.7), uniform(-0.7, 0.7), uniform(-0.5, 0.5));
            let rotation = facing * tilt;
            let centre = towards * uniform(RANGE_MM[0], RANGE_MM[1]);
            let place = self.target.placed(rotation, centre);
            self.is_in_sight(&place).then_some(place)
        })
    }

    fn is_in_sight(&self, left_from_target: &Transform<Left, Target>) -> bool {
        let right_from_target = self.right.1.inverse() * *left_from_target;
        let [[left, top], [right, bottom]] = self.target.outermost();
        let corners = [(left, top), (right, top), (left, bottom), (right, bottom)];
        corners.iter().all(|&(x, y)| {
            let corner = Point::<Target>::from_mm(Vector3::new(x, y, 0.0));
            let left = on_sensor(&self.left, &(*left_from_target * corner));
            left && (!self.both || on_sensor(&self.right.0, &(right_from_target * corner)))
        })
    }
}

fn on_sensor<F: Frame>(lens: &KannalaBrandt, point: &Point<F>) -> bool {
    lens.project_point(point).is_ok_and(|pixel| lens.on_sensor(pixel))
}

/// One of the cameras before which a target is held.
#[derive(Clone, Debug)]
pub struct TargetCamera {
    held: HeldTarget,
    side: Side,
    lens: LensChoice,
    images: u64,
}

impl TargetCamera {
    /// The camera on `side` of those before which the target is held.
    #[must_use]
    pub const fn new(held: HeldTarget, side: Side) -> Self {
        Self { held, side, lens: LensChoice::Ideal, images: 0 }
    }

    /// The same camera with another lens in the place of the ideal one, by which the target is still held.
    #[must_use]
    pub const fn with_lens(self, lens: LensChoice) -> Self {
        Self { lens, ..self }
    }
}

impl Camera for TargetCamera {
    fn grab(&mut self) -> Result<Option<CameraImage>, CameraError> {
        let place = self.held.left_from_target(self.images / HELD_IMAGES).ok_or_else(|| {
            CameraError::Simulated(
                "the cameras share no field in which a target can be held: choose another pose or target".into(),
            )
        })?;
        // The left camera's frame is the world of this image.
        let (ideal, world_from_camera): (_, Transform<World, CameraFrame>) = match self.side {
            Side::Left => (&self.held.left, Transform::new(UnitQuaternion::identity(), Vector3::zeros())),
            Side::Right => (&self.held.right.0, self.held.right.1.renamed()),
        };
        let lens = self.lens.in_place_of(ideal).map_err(|error| CameraError::Simulated(error.to_string()))?;
        // Corners lie on edges, which need many rays to be placed exactly. The rest of the image is plain.
        let optics = Optics { samples: 1, edge_samples: 100, ..Optics::default() };
        let seed = self.held.seed.wrapping_mul(4).wrapping_add(self.images * 2 + self.side.index() as u64);
        let image = photograph_target(self.held.target, place.renamed(), &lens, world_from_camera, &optics, seed);
        self.images += 1;
        Ok(Some(CameraImage {
            image,
            name: format!("image{:06}", self.images),
            seq: None,
            exposed_at: None,
            bytes: None,
        }))
    }
}

/// Image of a target alone before a grey background, by a monochrome camera. Of the rays of a pixel, `samples` of the optics counts as 1.
#[must_use]
pub fn photograph_target(
    target: impl Into<Sheet>,
    world_from_target: Transform<World, Target>,
    lens: &dyn Lens,
    world_from_camera: Transform<World, CameraFrame>,
    optics: &Optics,
    seed: u64,
) -> RgbImage {
    let camera_from_sheet = world_from_camera.inverse() * world_from_target;
    let view = SheetView { sheet: target.into(), camera_from_sheet, camera: lens, optics };
    DynamicImage::from(photograph_sheet(&view, seed)).into_rgb8()
}
