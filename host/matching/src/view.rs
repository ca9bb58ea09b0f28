//! An image seen along the shared direction, sampled so that epipolar curves are rows.
//!
//! The pixel grid is equirectangular with its poles on the baseline: d = (sin a, cos a sin b, cos a cos b), column ∝ a,
//! row ∝ b. A plane through both cameras has one b, so a scene point has the same row in both views whatever its range.

use image::GrayImage;
use nalgebra::Vector3;
use rayon::prelude::*;
use vergence_vision::{Angle, Frame, KannalaBrandt, Length, OutsideField, Pixel, Transform, UnitRay};

use crate::plane::{Plane, cubic_weights};
use crate::{Shared, SharedFrame};

/// A position in a [`View`], in its pixels. (0, 0) is the centre of the top-left one.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct ViewPixel {
    /// Column, growing with a.
    pub x: f64,
    /// Row, growing with b.
    pub y: f64,
}

/// The pixel grid common to both views of a pair.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Grid {
    a_min: f64,
    b_min: f64,
    pixels_per_radian: f64,
    width: usize,
    height: usize,
}

/// Largest |a|: nearer the baseline than 15° disparity says little about range.
const A_LIMIT: Angle = Angle::from_deg(75.0);
/// Largest |b|: a field of 196° ends there for parallel axes.
const B_LIMIT: Angle = Angle::from_deg(105.0);
/// The outermost ring of the lens, vignetted and least well calibrated.
const RIM: Angle = Angle::from_deg(1.5);
/// Besides infinity, the range at which the other camera must see a direction for it to be compared.
const NEAR: Length = Length::from_mm(1000.0);

impl Grid {
    /// The grid over all that both cameras see (at infinity or 1 m), within ±75° of a and ±105° of b; `None` where
    /// that is nothing. Its density is that of the denser lens at its axis times `oversampling`, or less where a side
    /// would exceed 4096 pixels.
    #[must_use]
    pub fn covering(
        frame: &SharedFrame,
        left: &KannalaBrandt,
        right: &KannalaBrandt,
        oversampling: f64,
    ) -> Option<Self> {
        const LARGEST: f64 = 4096.0;
        let extent = Extent::of_shared_field(frame, left, right)?;
        let (wide, tall) = (extent.a_max - extent.a_min, extent.b_max - extent.b_min);
        let wanted = left.k()[0].max(right.k()[0]) * oversampling;
        let pixels_per_radian = wanted.min((LARGEST - 1.0) / wide.max(tall));
        let count = |angle: f64| (angle * pixels_per_radian) as usize + 1;
        (pixels_per_radian > 0.0).then(|| Self {
            a_min: extent.a_min,
            b_min: extent.b_min,
            pixels_per_radian,
            width: count(wide),
            height: count(tall),
        })
    }

    /// The direction of a position. Positions beyond the grid are directions as well.
    #[must_use]
    pub fn bearing(&self, at: ViewPixel) -> Option<UnitRay<Shared>> {
        UnitRay::new(direction(self.a(at.x), self.b(at.y)))
    }

    /// Where a direction lies, possibly beyond the grid.
    #[must_use]
    pub fn position(&self, bearing: &UnitRay<Shared>) -> ViewPixel {
        let d = bearing.vector();
        let (a, b) = (d.x.atan2(d.y.hypot(d.z)), d.y.atan2(d.z));
        ViewPixel { x: (a - self.a_min) * self.pixels_per_radian, y: (b - self.b_min) * self.pixels_per_radian }
    }

    /// Columns and rows.
    #[must_use]
    pub const fn size(&self) -> (usize, usize) {
        (self.width, self.height)
    }

    /// Pixels per radian of a along rows, and of b along columns.
    #[must_use]
    pub const fn pixels_per_radian(&self) -> f64 {
        self.pixels_per_radian
    }

    /// The angle a of a column, in radians.
    pub(crate) fn a(&self, x: f64) -> f64 {
        self.a_min + x / self.pixels_per_radian
    }

    /// The angle b of a row, in radians.
    fn b(&self, y: f64) -> f64 {
        self.b_min + y / self.pixels_per_radian
    }
}

/// One camera's image on the grid, and the way back to the image's own pixels.
#[derive(Clone, Debug)]
pub struct View<F: Frame> {
    grid: Grid,
    camera: KannalaBrandt,
    shared_from_camera: Transform<Shared, F>,
    plane: Plane,
    seen: Vec<bool>,
}

impl<F: Frame + Sync> View<F> {
    /// Samples `image` on `grid` by cubic convolution (Keys, "Cubic convolution interpolation for digital image
    /// processing", ASSP 29(6), 1981). Directions the camera does not see are black.
    #[must_use]
    pub fn new(
        image: &GrayImage,
        camera: &KannalaBrandt,
        shared_from_camera: Transform<Shared, F>,
        grid: Grid,
    ) -> Self {
        let camera_from_shared = shared_from_camera.inverse();
        let sample = |x: usize, y: usize| {
            let ray = camera_from_shared * grid.bearing(ViewPixel { x: x as f64, y: y as f64 })?;
            sample_image(image, seen_at(camera, &ray)?)
        };
        let (values, seen) = (0..grid.width * grid.height)
            .into_par_iter()
            .map(|i| sample(i % grid.width, i / grid.width).map_or((0.0, false), |value| (value, true)))
            .unzip();
        Self { grid, camera: *camera, shared_from_camera, plane: Plane::new(grid.width, grid.height, values), seen }
    }

    /// The grid this view is sampled on.
    #[must_use]
    pub const fn grid(&self) -> &Grid {
        &self.grid
    }

    /// Brightness by rows, in grey levels; 0 where the camera sees nothing.
    #[must_use]
    pub fn brightness(&self) -> &[f32] {
        self.plane.values()
    }

    /// Whether the camera sees the pixel nearest to `at`, its rim of 1.5° excluded.
    #[must_use]
    pub fn sees(&self, at: ViewPixel) -> bool {
        let (x, y) = (at.x.round(), at.y.round());
        x >= 0.0
            && y >= 0.0
            && x < self.grid.width as f64
            && y < self.grid.height as f64
            && self.seen[y as usize * self.grid.width + x as usize]
    }

    /// The original image's pixel at a position.
    ///
    /// # Errors
    /// [`OutsideField`] beyond the lens's valid cone.
    pub fn original(&self, at: ViewPixel) -> Result<Pixel, OutsideField> {
        let bearing = self.grid.bearing(at).ok_or(OutsideField)?;
        self.camera.project(&(self.shared_from_camera.inverse() * bearing))
    }

    /// The position of an original image's pixel, possibly beyond the grid.
    ///
    /// # Errors
    /// [`OutsideField`] beyond the lens's valid cone.
    pub fn position(&self, original: Pixel) -> Result<ViewPixel, OutsideField> {
        Ok(self.grid.position(&(self.shared_from_camera * self.camera.unproject(original)?)))
    }

    pub(crate) const fn plane(&self) -> &Plane {
        &self.plane
    }
}

/// Where the lens shows `ray`, unless that is in the rim or so near the sensor's border that interpolation would read
/// beyond it.
fn seen_at<F: Frame>(camera: &KannalaBrandt, ray: &UnitRay<F>) -> Option<Pixel> {
    const BORDER: f64 = 1.0;
    let pixel = camera.project(ray).ok()?;
    let inside = |x: f64, n: u32| x >= BORDER && x < f64::from(n) - 1.0 - BORDER;
    let in_cone = ray.vector().z >= (camera.theta_max() - RIM).rad().cos();
    (in_cone && inside(pixel.u, camera.size().width) && inside(pixel.v, camera.size().height)).then_some(pixel)
}

/// The brightness of an 8-bit image between its pixels; `None` where the 4 × 4 pixels around are not all there.
fn sample_image(image: &GrayImage, at: Pixel) -> Option<f32> {
    let (width, height) = (image.width() as usize, image.height() as usize);
    let (column, row) = ((at.u.floor() as usize).checked_sub(1)?, (at.v.floor() as usize).checked_sub(1)?);
    let (wu, wv) = (cubic_weights((at.u - at.u.floor()) as f32), cubic_weights((at.v - at.v.floor()) as f32));
    if column + 4 > width || row + 4 > height {
        return None;
    }
    let pixels: &[u8] = image.as_raw();
    Some((0..4).fold(0.0, |sum, j| {
        let taps = &pixels[(row + j) * width + column..][..4];
        sum + wv[j] * taps.iter().zip(&wu).fold(0.0, |sum, (&tap, w)| sum + w * f32::from(tap))
    }))
}

/// d = (sin a, cos a sin b, cos a cos b).
fn direction(a: f64, b: f64) -> Vector3<f64> {
    Vector3::new(a.sin(), a.cos() * b.sin(), a.cos() * b.cos())
}

/// Which directions of each view are worth comparing.
#[derive(Clone, Copy, Debug)]
pub(crate) struct SharedField<'a> {
    frame: &'a SharedFrame,
    left: &'a KannalaBrandt,
    right: &'a KannalaBrandt,
}

impl<'a> SharedField<'a> {
    pub(crate) const fn new(frame: &'a SharedFrame, left: &'a KannalaBrandt, right: &'a KannalaBrandt) -> Self {
        Self { frame, left, right }
    }

    /// Whether the left camera sees a bearing and the right camera sees it too, at infinity or at 1 m.
    pub(crate) fn seen_from_left(&self, bearing: &UnitRay<Shared>) -> bool {
        let (left_from, right_from) =
            (self.frame.shared_from_left().inverse(), self.frame.shared_from_right().inverse());
        seen_at(self.left, &(left_from * *bearing)).is_some()
            && self.parallax_ends(bearing, -1.0).any(|other| seen_at(self.right, &(right_from * other)).is_some())
    }

    /// The same for a bearing of the right camera.
    pub(crate) fn seen_from_right(&self, bearing: &UnitRay<Shared>) -> bool {
        let (left_from, right_from) =
            (self.frame.shared_from_left().inverse(), self.frame.shared_from_right().inverse());
        seen_at(self.right, &(right_from * *bearing)).is_some()
            && self.parallax_ends(bearing, 1.0).any(|other| seen_at(self.left, &(left_from * other)).is_some())
    }

    /// The bearings, from a camera displaced by `side` baselines along x, of the point at infinity and the one at 1 m.
    fn parallax_ends(&self, bearing: &UnitRay<Shared>, side: f64) -> impl Iterator<Item = UnitRay<Shared>> {
        let offset = Vector3::x() * (side * self.frame.baseline().mm());
        [Some(*bearing), UnitRay::new(bearing.at(NEAR.mm()).mm() + offset)].into_iter().flatten()
    }
}

/// Ranges of a and b in radians.
struct Extent {
    a_min: f64,
    a_max: f64,
    b_min: f64,
    b_max: f64,
}

impl Extent {
    /// The bounds of what the cameras share, found on a grid of one degree and widened by that degree.
    fn of_shared_field(frame: &SharedFrame, left: &KannalaBrandt, right: &KannalaBrandt) -> Option<Self> {
        let field = SharedField::new(frame, left, right);
        let (a_limit, b_limit) = (A_LIMIT.deg() as i32, B_LIMIT.deg() as i32);
        let compared = |&(a, b): &(i32, i32)| {
            let d = direction(f64::from(a).to_radians(), f64::from(b).to_radians());
            UnitRay::new(d).is_some_and(|bearing| field.seen_from_left(&bearing) || field.seen_from_right(&bearing))
        };
        let bounds = (-a_limit..=a_limit)
            .flat_map(|a| (-b_limit..=b_limit).map(move |b| (a, b)))
            .filter(compared)
            .map(|(a, b)| [a, a, b, b])
            .reduce(|m, n| [m[0].min(n[0]), m[1].max(n[1]), m[2].min(n[2]), m[3].max(n[3])])?;
        let within = |degrees: i32, limit: i32| f64::from(degrees.clamp(-limit, limit)).to_radians();
        Some(Self {
            a_min: within(bounds[0] - 1, a_limit),
            a_max: within(bounds[1] + 1, a_limit),
            b_min: within(bounds[2] - 1, b_limit),
            b_max: within(bounds[3] + 1, b_limit),
        })
    }
}
