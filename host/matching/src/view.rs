//! An image resampled in the shared axes, so that epipolar curves are rows.
//!
//! The grid ([`Grid`]) is common to both views of a pair.

use image::GrayImage;
use rayon::prelude::*;
use vergence_vision::{Angle, BodyMask, Frame, KannalaBrandt, OutsideField, Pixel, Transform};

use crate::plane::Plane;
use crate::sampling::sample_line;
use crate::view_map::{Kept, Mapped, Places};
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
        Self::in_buffers((image, mask), camera, shared_from_camera, grid, &mut Buffers::default())
    }

    /// The same in memory that is taken from `buffers`, and where its pixels lie in the image is kept there for the next view.
    pub(crate) fn in_buffers(
        (image, mask): (&GrayImage, Option<&BodyMask>),
        camera: &KannalaBrandt,
        shared_from_camera: Transform<Shared, F>,
        grid: Grid,
        buffers: &mut Buffers,
    ) -> Self {
        let turn = shared_from_camera.inverse().rotation().to_rotation_matrix().into_inner();
        let mapped = Mapped { camera: *camera, turn, grid, image: image.dimensions(), mask: mask.cloned() };
        let (width, height) = grid.size();
        let (mut values, mut seen) = (buffers.values(width * height), buffers.flags(width * height));
        let rows = values.par_chunks_mut(width).zip(seen.par_chunks_mut(width));
        let line = image.width() as usize;
        let sample = |places: &Places, (values, seen): (&mut [f32], &mut [bool])| {
            sample_line((image.as_raw(), line), places, seen, values);
        };
        let (rays, map) = buffers.kept.of(mapped);
        match map {
            Some(map) => rows.zip(map).for_each(|(row, places)| sample(places, row)),
            None => rows.enumerate().for_each_init(Default::default, |(line, places), (y, row)| {
                rays.fill(y, line, places);
                sample(places, row);
            }),
        }
        Self { grid, camera: *camera, shared_from_camera, plane: Plane::new(width, height, values), seen }
    }

    /// Gives the memory back.
    pub(crate) fn recycle(self, buffers: &mut Buffers) {
        buffers.values.push(self.plane.into_values());
        buffers.flags.push(self.seen);
    }

    /// Takes the brightness out, for its memory.
    pub(crate) fn take_values(&mut self) -> Vec<f32> {
        std::mem::take(&mut self.plane).into_values()
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

/// Memory of the views of one camera that is used again: to ask the system for a megabyte costs as much as to fill it.
#[derive(Debug, Default)]
pub(crate) struct Buffers {
    pub values: Vec<Vec<f32>>,
    flags: Vec<Vec<bool>>,
    kept: Kept,
}

impl Buffers {
    /// The number of views that lay in their images as the ones before.
    pub(crate) const fn kept_views(&self) -> u64 {
        self.kept.served()
    }

    fn values(&mut self, count: usize) -> Vec<f32> {
        let mut values = self.values.pop().unwrap_or_default();
        values.resize(count, 0.0);
        values
    }

    fn flags(&mut self, count: usize) -> Vec<bool> {
        let mut flags = self.flags.pop().unwrap_or_default();
        flags.resize(count, false);
        flags
    }
}
