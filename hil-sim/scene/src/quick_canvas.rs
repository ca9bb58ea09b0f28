//! What the rays through the centres of the pixels of an image meet, for images in real time.
//!
//! All rows lie in a few large pieces of memory: the system gets these back, but not what is left between many small ones.

use rayon::prelude::*;

use crate::texture::Rgb;
use crate::trace::NOTHING;

/// The numbers of each row: red, green and blue, and the level.
const PLANES: usize = 4;
const LEVEL: usize = 3;

/// What the rays through the centres of the pixels meet.
#[derive(Clone, Debug)]
pub struct Canvas {
    width: usize,
    /// Row by row, of each row plane by plane.
    planes: Vec<f32>,
    surfaces: Vec<u32>,
}

/// Some rows of a canvas, to be written.
pub struct CanvasRows<'a> {
    width: usize,
    planes: &'a mut [f32],
    surfaces: &'a mut [u32],
}

/// The pixels of one row of a canvas, to be written.
pub struct CanvasRow<'a> {
    /// Red, green and blue; none outside the field.
    pub light: [&'a mut [f32]; 3],
    /// The square root of the mean of the colours.
    pub levels: &'a mut [f32],
    /// Numbers of the surfaces; [`NOTHING`] where nothing is met, and outside the field.
    pub surfaces: &'a mut [u32],
}

impl Canvas {
    /// Of so many columns and rows, at least one.
    pub fn new(width: usize, height: usize) -> Self {
        Self { width, planes: vec![0.0; PLANES * width * height], surfaces: vec![NOTHING; width * height] }
    }

    /// Number of columns.
    #[inline]
    pub const fn width(&self) -> usize {
        self.width
    }

    /// Number of rows.
    #[inline]
    pub const fn height(&self) -> usize {
        self.surfaces.len() / self.width
    }

    /// One colour of a row: see [`CanvasRow::light`].
    #[inline]
    pub fn light(&self, channel: usize, y: usize) -> &[f32] {
        &self.planes[(PLANES * y + channel) * self.width..][..self.width]
    }

    /// See [`CanvasRow::levels`].
    #[inline]
    pub fn levels(&self, y: usize) -> &[f32] {
        self.light(LEVEL, y)
    }

    /// See [`CanvasRow::surfaces`].
    #[inline]
    pub fn surfaces(&self, y: usize) -> &[u32] {
        &self.surfaces[y * self.width..][..self.width]
    }

    /// The light of a pixel.
    #[inline]
    pub fn light_at(&self, [x, y]: [usize; 2]) -> Rgb {
        let (at, width) = (PLANES * y * self.width + x, self.width);
        [self.planes[at], self.planes[at + width], self.planes[at + 2 * width]]
    }

    /// Exchanges the light of a pixel for another, and neither its level nor its surface.
    pub fn swap_light(&mut self, [x, y]: [usize; 2], light: &mut Rgb) {
        for (channel, light) in light.iter_mut().enumerate() {
            std::mem::swap(&mut self.planes[(PLANES * y + channel) * self.width + x], light);
        }
    }

    /// The canvas in parts of so many rows, from above.
    pub fn par_bands(&mut self, rows: usize) -> impl IndexedParallelIterator<Item = CanvasRows<'_>> {
        let width = self.width;
        let planes = self.planes.par_chunks_mut(PLANES * width * rows);
        let bands = planes.zip(self.surfaces.par_chunks_mut(width * rows));
        bands.map(move |(planes, surfaces)| CanvasRows { width, planes, surfaces })
    }
}

impl CanvasRows<'_> {
    /// Number of rows.
    pub const fn height(&self) -> usize {
        self.surfaces.len() / self.width
    }

    /// The rows from row `top` of these on.
    pub fn rows(&mut self, top: usize) -> impl Iterator<Item = CanvasRow<'_>> {
        let planes = self.planes.chunks_exact_mut(PLANES * self.width);
        planes.zip(self.surfaces.chunks_exact_mut(self.width)).skip(top).map(|(planes, surfaces)| {
            let (red, others) = planes.split_at_mut(surfaces.len());
            let (green, others) = others.split_at_mut(surfaces.len());
            let (blue, levels) = others.split_at_mut(surfaces.len());
            CanvasRow { light: [red, green, blue], levels, surfaces }
        })
    }
}
