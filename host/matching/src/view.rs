//! An image resampled in the shared axes, so that epipolar curves are rows.
//!
//! The grid ([`Grid`]) is common to both views of a pair.

use image::GrayImage;
use rayon::prelude::*;
use vergence_vision::{Angle, BatchLens, BodyMask, Frame, KannalaBrandt, OutsideField, Pixel, Transform};

use crate::grid::direction_of;
use crate::plane::{Plane, cubic_weights};
use crate::shared_field::Inside;
use crate::{Grid, Shared, ViewPixel};

/// One camera's image resampled on the grid, with the mapping to the original pixels.
#[derive(Clone, Debug)]
pub struct View<F: Frame> {
    grid: Grid,
    camera: KannalaBrandt,
    shared_from_camera: Transform<Shared, F>,
    plane: Plane,
    seen: Vec<bool>,
}

impl<F: Frame> View<F> {
    /// Resamples `image` on `grid` by cubic convolution (R. Keys, "Cubic convolution interpolation for digital image
    /// processing", ASSP 29(6), 1981). Directions that the camera does not see are black.
    #[must_use]
    pub fn new(
        image: &GrayImage,
        camera: &KannalaBrandt,
        shared_from_camera: Transform<Shared, F>,
        grid: Grid,
    ) -> Self {
        Self::masked((image, None), camera, shared_from_camera, grid)
    }

    /// The same, of an image of which `mask` hides a part: the camera does not see what is hidden.
    #[must_use]
    pub fn masked(
        (image, mask): (&GrayImage, Option<&BodyMask>),
        camera: &KannalaBrandt,
        shared_from_camera: Transform<Shared, F>,
        grid: Grid,
    ) -> Self {
        let camera_from_shared = shared_from_camera.inverse().rotation().to_rotation_matrix().into_inner();
        let (lens, inside) = (BatchLens::new(camera), Inside::of(camera));
        let (width, height) = grid.size();
        let mut values = vec![0.0; width * height];
        let mut seen = vec![false; values.len()];
        let columns: Vec<_> = (0..width).map(|x| grid.a(x as f64).sin_cos()).collect();
        let rows = values.par_chunks_mut(width).zip(seen.par_chunks_mut(width));
        rows.enumerate().for_each(|(y, (values, seen))| {
            let row = grid.b(y as f64).sin_cos();
            let ray = |column| (camera_from_shared * direction_of(column, row)).into();
            let rays: Vec<[f64; 3]> = columns.iter().map(|&column| ray(column)).collect();
            let pixels = lens.project(&rays);
            for (((&[_, _, z], [u, v]), value), seen) in rays.iter().zip(pixels).zip(values).zip(seen) {
                let at = Pixel { u, v };
                let is_seen = inside.contains(z, &at) && !mask.is_some_and(|mask| mask.hides(at));
                if let Some(sampled) = is_seen.then(|| sample_image(image, at)).flatten() {
                    (*value, *seen) = (sampled, true);
                }
            }
        });
        Self { grid, camera: *camera, shared_from_camera, plane: Plane::new(width, height, values), seen }
    }

    /// The grid of the view.
    #[must_use]
    pub const fn grid(&self) -> &Grid {
        &self.grid
    }

    /// Brightness by rows, in grey levels from 0 to 255; 0 where the camera does not see.
    #[must_use]
    pub fn brightness(&self) -> &[f32] {
        self.plane.values()
    }

    /// Whether the camera sees the pixel nearest to `at`. The outermost 1.5° of the field are excluded.
    #[must_use]
    pub fn sees(&self, at: ViewPixel) -> bool {
        self.grid.index_nearest(at).is_some_and(|index| self.seen[index])
    }

    /// The pixel of the original image at a position of the view.
    ///
    /// # Errors
    /// [`OutsideField`] beyond the lens's valid cone.
    pub fn original(&self, at: ViewPixel) -> Result<Pixel, OutsideField> {
        let bearing = self.grid.bearing(at).ok_or(OutsideField)?;
        self.camera.project(&(self.shared_from_camera.inverse() * bearing))
    }

    /// The position in the view of a pixel of the original image, possibly beyond the grid.
    ///
    /// # Errors
    /// [`OutsideField`] beyond the lens's valid cone.
    pub fn position(&self, original: Pixel) -> Result<ViewPixel, OutsideField> {
        Ok(self.grid.position(&(self.shared_from_camera * self.camera.unproject(original)?)))
    }

    /// Pixels of the image per pixel of the view where the image shows `original`.
    pub(crate) fn shrinking(&self, original: Pixel) -> f64 {
        let theta = self.camera.unproject::<F>(original).map_or(0.0, |ray| ray.vector().z.clamp(-1.0, 1.0).acos());
        self.camera.pixels_per_radian(Angle::from_rad(theta)) / self.grid.pixels_per_radian()
    }

    pub(crate) const fn plane(&self) -> &Plane {
        &self.plane
    }

    /// Whether the camera sees each pixel, by rows. The outermost 1.5° of the field are excluded.
    pub(crate) fn seen(&self) -> &[bool] {
        &self.seen
    }
}

/// Interpolates the brightness of an 8-bit image; `None` where the 4 × 4 pixels around are not all inside.
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
