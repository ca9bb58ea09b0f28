//! What the rays through the centres of the pixels of an image meet, for images in real time.
//!
//! Each channel lies in one large piece of memory: the system gets it back, but not what is left between many small ones.

use rayon::prelude::*;

use crate::texture::Rgb;
use crate::trace::NOTHING;

/// What the rays through the centres of the pixels meet, row by row.
#[derive(Clone, Debug)]
pub struct Canvas {
    width: usize,
    light: [Vec<f32>; 3],
    surfaces: Vec<u32>,
}

/// Some rows of a canvas, to be written.
pub struct CanvasRows<'a> {
    width: usize,
    /// Red, green and blue; none outside the field.
    light: [&'a mut [f32]; 3],
    /// Numbers of the surfaces; [`NOTHING`] where nothing is met, and outside the field.
    surfaces: &'a mut [u32],
}

impl Canvas {
    /// Of so many columns and rows, at least one.
    pub fn new(width: usize, height: usize) -> Self {
        let dark = || vec![0.0; width * height];
        Self { width, light: [dark(), dark(), dark()], surfaces: vec![NOTHING; width * height] }
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

    /// One colour of a row; none outside the field.
    #[inline]
    pub fn light(&self, channel: usize, y: usize) -> &[f32] {
        &self.light[channel][y * self.width..][..self.width]
    }

    /// Numbers of a row's surfaces; [`NOTHING`] where nothing is met, and outside the field.
    #[inline]
    pub fn surfaces(&self, y: usize) -> &[u32] {
        &self.surfaces[y * self.width..][..self.width]
    }

    /// The light of a pixel, of which the first one of the second row has the number `width`.
    #[inline]
    pub fn light_at(&self, pixel: usize) -> Rgb {
        let [red, green, blue] = &self.light;
        [red[pixel], green[pixel], blue[pixel]]
    }

    /// The number of a pixel's surface.
    #[inline]
    pub fn surface_at(&self, pixel: usize) -> u32 {
        self.surfaces[pixel]
    }

    /// Exchanges the light of a pixel for another, and not its surface.
    pub fn swap_light(&mut self, pixel: usize, light: &mut Rgb) {
        for (channel, light) in self.light.iter_mut().zip(light) {
            std::mem::swap(&mut channel[pixel], light);
        }
    }

    /// The canvas in parts of so many rows, from above.
    pub fn par_bands(&mut self, rows: usize) -> impl IndexedParallelIterator<Item = CanvasRows<'_>> {
        let (width, [red, green, blue]) = (self.width, &mut self.light);
        let [red, green, blue] = [red, green, blue].map(|plane| plane.par_chunks_mut(width * rows));
        let surfaces = self.surfaces.par_chunks_mut(width * rows);
        red.zip(green).zip(blue).zip(surfaces).map(move |(((red, green), blue), surfaces)| CanvasRows {
            width,
            light: [red, green, blue],
            surfaces,
        })
    }
}

impl CanvasRows<'_> {
    /// Number of rows.
    pub const fn height(&self) -> usize {
        self.surfaces.len() / self.width
    }

    /// Pixels of a row from column `x` on, as many as `count`: red, green and blue, and the surfaces.
    #[inline]
    pub fn pixels(&mut self, [x, y]: [usize; 2], count: usize) -> ([&mut [f32]; 3], &mut [u32]) {
        let (at, [red, green, blue]) = (y * self.width + x..y * self.width + x + count, &mut self.light);
        let planes = [red, green, blue].map(|plane| &mut plane[at.clone()]);
        (planes, &mut self.surfaces[at])
    }
}
