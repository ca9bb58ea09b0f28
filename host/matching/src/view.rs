//! An image seen along the shared direction, sampled so that epipolar curves are rows.
//!
//! The pixel grid is equirectangular with its poles on the baseline: d = (sin a, cos a sin b, cos a cos b), column ∝ a,
//! row ∝ b. A plane through both cameras has one b, so a scene point has the same row in both views whatever its range.

use image::GrayImage;
use nalgebra::Vector3;
use rayon::prelude::*;
use vergence_vision::{Angle, BatchLens, Frame, KannalaBrandt, OutsideField, Pixel, Transform, UnitRay};

use crate::plane::{Plane, cubic_weights};
use crate::shared_field::{Extent, Inside, SharedField};
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

impl Grid {
    /// The grid over all that both cameras see (at infinity or 1 m), within ±75° of a and ±105° of b. Its density is
    /// that of the denser lens at its axis times `oversampling`, or less where a side would exceed 4096 pixels.
    ///
    /// `None` where the cameras share nothing or `oversampling` is not positive.
    #[must_use]
    pub fn covering(
        frame: &SharedFrame,
        left: &KannalaBrandt,
        right: &KannalaBrandt,
        oversampling: f64,
    ) -> Option<Self> {
        Self::over(&SharedField::new(frame, left, right), left.k()[0].max(right.k()[0]) * oversampling)
    }

    /// The grid over a field with `wanted` pixels per radian, or fewer.
    pub(crate) fn over(field: &SharedField<'_>, wanted: f64) -> Option<Self> {
        const LARGEST: f64 = 4096.0;
        let extent = Extent::of(field)?;
        let (wide, tall) = (extent.a_max - extent.a_min, extent.b_max - extent.b_min);
        let pixels_per_radian = if wanted > 0.0 { wanted.min((LARGEST - 1.0) / wide.max(tall)) } else { return None };
        let count = |angle: f64| (angle * pixels_per_radian) as usize + 1;
        Some(Self {
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
        self.position_of(d.x.atan2(d.y.hypot(d.z)), d.y.atan2(d.z))
    }

    /// Where the direction with these angles lies, possibly beyond the grid.
    pub(crate) fn position_of(&self, a: f64, b: f64) -> ViewPixel {
        ViewPixel { x: (a - self.a_min) * self.pixels_per_radian, y: (b - self.b_min) * self.pixels_per_radian }
    }

    /// The index by rows of the pixel nearest to a position; `None` beyond the grid.
    pub(crate) fn index_nearest(&self, at: ViewPixel) -> Option<usize> {
        let (x, y) = (at.x.round(), at.y.round());
        let inside = x >= 0.0 && y >= 0.0 && x < self.width as f64 && y < self.height as f64;
        inside.then_some(y as usize * self.width + x as usize)
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

impl<F: Frame> View<F> {
    /// Samples `image` on `grid` by cubic convolution (Keys, "Cubic convolution interpolation for digital image
    /// processing", ASSP 29(6), 1981). Directions the camera does not see are black.
    #[must_use]
    pub fn new(
        image: &GrayImage,
        camera: &KannalaBrandt,
        shared_from_camera: Transform<Shared, F>,
        grid: Grid,
    ) -> Self {
        let camera_from_shared = shared_from_camera.inverse().rotation().to_rotation_matrix().into_inner();
        let (lens, inside) = (BatchLens::new(camera), Inside::of(camera));
        let mut values = vec![0.0; grid.width * grid.height];
        let mut seen = vec![false; values.len()];
        let columns: Vec<_> = (0..grid.width).map(|x| grid.a(x as f64).sin_cos()).collect();
        let rows = values.par_chunks_mut(grid.width).zip(seen.par_chunks_mut(grid.width));
        rows.enumerate().for_each(|(y, (values, seen))| {
            let row = grid.b(y as f64).sin_cos();
            let ray = |column| (camera_from_shared * direction_of(column, row)).into();
            let rays: Vec<[f64; 3]> = columns.iter().map(|&column| ray(column)).collect();
            let pixels = lens.project(&rays);
            for (((&[_, _, z], [u, v]), value), seen) in rays.iter().zip(pixels).zip(values).zip(seen) {
                let at = Pixel { u, v };
                if let Some(sampled) = inside.contains(z, &at).then(|| sample_image(image, at)).flatten() {
                    (*value, *seen) = (sampled, true);
                }
            }
        });
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
        self.grid.index_nearest(at).is_some_and(|index| self.seen[index])
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

    /// How many pixels of the original image make one of the view at an original pixel, along the radius.
    pub(crate) fn shrinking(&self, original: Pixel) -> f64 {
        let theta = self.camera.unproject::<F>(original).map_or(0.0, |ray| ray.vector().z.clamp(-1.0, 1.0).acos());
        self.camera.pixels_per_radian(Angle::from_rad(theta)) / self.grid.pixels_per_radian
    }

    pub(crate) const fn plane(&self) -> &Plane {
        &self.plane
    }

    /// Which pixels the camera sees, by rows, its rim of 1.5° excluded.
    pub(crate) fn seen(&self) -> &[bool] {
        &self.seen
    }
}

/// The brightness of an 8-bit image between its pixels; `None` where the 4 × 4 pixels around are not all there.
#[inline]
fn sample_image(image: &GrayImage, at: Pixel) -> Option<f32> {
    let (column, row) = (at.u as u32, at.v as u32);
    let wu = cubic_weights((at.u - f64::from(column)) as f32);
    let wv = cubic_weights((at.v - f64::from(row)) as f32);
    let (pixels, width): (&[u8], _) = (image.as_raw(), image.width() as usize);
    let first = (row.checked_sub(1)? as usize) * width + column.checked_sub(1)? as usize;
    if column as usize + 3 > width {
        return None;
    }
    let mut mixed = [0.0_f32; 4];
    for (j, weight) in wv.iter().enumerate() {
        let taps: &[u8; 4] = pixels.get(first + j * width..)?.first_chunk()?;
        for (sum, tap) in mixed.iter_mut().zip(taps) {
            *sum += weight * f32::from(*tap);
        }
    }
    Some(wu[0] * mixed[0] + wu[1] * mixed[1] + wu[2] * mixed[2] + wu[3] * mixed[3])
}

/// d = (sin a, cos a sin b, cos a cos b).
pub(crate) fn direction(a: f64, b: f64) -> Vector3<f64> {
    direction_of(a.sin_cos(), b.sin_cos())
}

/// The same of the sine and cosine of both angles.
fn direction_of((sin_a, cos_a): (f64, f64), (sin_b, cos_b): (f64, f64)) -> Vector3<f64> {
    Vector3::new(sin_a, cos_a * sin_b, cos_a * cos_b)
}
