//! An image resampled in the shared axes, so that epipolar curves are rows.
//!
//! The grid ([`Grid`]) is common to both views of a pair.

use image::GrayImage;
use multiversion::multiversion;
use nalgebra::Matrix3;
use rayon::prelude::*;
use vergence_vision::{Angle, BatchLens, BodyMask, Frame, KannalaBrandt, OutsideField, Pixel, Transform};

use crate::grid::direction_of;
use crate::knots::{KNOT, interpolate};
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
        Self::in_buffers((image, mask), camera, shared_from_camera, grid, &mut Buffers::default())
    }

    /// The same in memory that is taken from `buffers`.
    pub(crate) fn in_buffers(
        (image, mask): (&GrayImage, Option<&BodyMask>),
        camera: &KannalaBrandt,
        shared_from_camera: Transform<Shared, F>,
        grid: Grid,
        buffers: &mut Buffers,
    ) -> Self {
        let camera_from_shared = shared_from_camera.inverse().rotation().to_rotation_matrix().into_inner();
        let (lens, inside) = (BatchLens::new(camera), Inside::of(camera));
        let (width, height) = grid.size();
        let (mut values, mut seen) = (buffers.values(width * height), buffers.flags(width * height));
        let columns = Columns::of(&grid);
        let rows = values.par_chunks_mut(width).zip(seen.par_chunks_mut(width)).enumerate();
        rows.for_each_init(Line::default, |line, (y, (values, seen))| {
            let from_row = Row::new(&camera_from_shared, grid.b(y as f64).sin_cos());
            line.fill(&lens, &columns, &from_row);
            see(&inside, &line.pixels, &columns.turns, [from_row.by_sine[2], from_row.by_cosine[2]], seen);
            if let Some(mask) = mask {
                let seen = seen.iter_mut().zip(&line.pixels).filter(|(seen, _)| **seen);
                seen.for_each(|(seen, &[u, v])| *seen = !mask.hides(Pixel { u, v }));
            }
            sample_line(image.as_raw(), image.width() as usize, &line.pixels, seen, values);
        });
        Self { grid, camera: *camera, shared_from_camera, plane: Plane::new(width, height, values), seen }
    }

    /// Gives the memory back.
    pub(crate) fn recycle(self, buffers: &mut Buffers) {
        buffers.values.push(self.plane.into_values());
        buffers.flags.push(self.seen);
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

/// Memory that is used again: to ask the system for a megabyte costs as much as to fill it.
#[derive(Debug, Default)]
pub(crate) struct Buffers {
    pub values: Vec<Vec<f32>>,
    flags: Vec<Vec<bool>>,
}

impl Buffers {
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

/// The angles of a grid's columns.
struct Columns {
    /// Sine and cosine of each column.
    turns: Vec<(f64, f64)>,
    /// The same of each knot, from the one before the first column to the second one behind the last.
    knots: Vec<(f64, f64)>,
}

impl Columns {
    fn of(grid: &Grid) -> Self {
        let width = grid.size().0;
        let turn = |x: f64| grid.a(x).sin_cos();
        let knot = |k: usize| turn((k * KNOT) as f64 - KNOT as f64);
        Self {
            turns: (0..width).map(|x| turn(x as f64)).collect(),
            knots: (0..width.div_ceil(KNOT) + 3).map(knot).collect(),
        }
    }
}

/// The rays of one row: a sine and a cosine of the column times two vectors.
struct Row {
    by_sine: [f64; 3],
    by_cosine: [f64; 3],
}

impl Row {
    fn new(camera_from_shared: &Matrix3<f64>, turn: (f64, f64)) -> Self {
        let axis = |a| (camera_from_shared * direction_of(a, turn)).into();
        Self { by_sine: axis((1.0, 0.0)), by_cosine: axis((0.0, 1.0)) }
    }

    fn ray(&self, (sine, cosine): (f64, f64)) -> [f64; 3] {
        std::array::from_fn(|i| sine * self.by_sine[i] + cosine * self.by_cosine[i])
    }
}

/// The pixels of one row of a view, and what finds them.
#[derive(Default)]
struct Line {
    rays: Vec<[f64; 3]>,
    knots: Vec<[f64; 2]>,
    exact: Vec<[f64; 2]>,
    /// NaN beyond the field.
    pixels: Vec<[f64; 2]>,
}

impl Line {
    fn fill(&mut self, lens: &BatchLens, columns: &Columns, row: &Row) {
        self.rays.clear();
        self.knots.clear();
        self.rays.extend(columns.knots.iter().map(|turn| row.ray(*turn)));
        lens.project_into(&self.rays, &mut self.knots);
        self.pixels.resize(columns.turns.len(), [f64::NAN; 2]);
        between(&self.knots, &mut self.pixels);
        let chunks = self.knots.windows(4).zip(self.pixels.chunks_mut(KNOT)).zip(columns.turns.chunks(KNOT));
        let at_edge = |knots: &[[f64; 2]]| {
            let lost = knots.iter().filter(|knot| knot[0].is_nan()).count();
            (1..4).contains(&lost)
        };
        for ((_, pixels), turns) in chunks.filter(|((knots, _), _)| at_edge(knots)) {
            self.rays.clear();
            self.exact.clear();
            self.rays.extend(turns.iter().map(|turn| row.ray(*turn)));
            lens.project_into(&self.rays, &mut self.exact);
            pixels.copy_from_slice(&self.exact);
        }
    }
}

/// Interpolates the pixels of a row between those of its knots; NaN where one of four knots has none.
#[multiversion(targets("x86_64+avx2"))]
fn between(knots: &[[f64; 2]], pixels: &mut [[f64; 2]]) {
    knots.windows(4).zip(pixels.chunks_mut(KNOT)).for_each(|(knots, pixels)| interpolate(knots, pixels));
}

/// Says which pixels of a row the camera sees, whose rays have the z `by_sine` sin a + `by_cosine` cos a.
#[multiversion(targets("x86_64+avx2"))]
fn see(inside: &Inside, pixels: &[[f64; 2]], turns: &[(f64, f64)], [by_sine, by_cosine]: [f64; 2], seen: &mut [bool]) {
    for ((seen, &[u, v]), (sine, cosine)) in seen.iter_mut().zip(pixels).zip(turns) {
        *seen = inside.contains(sine * by_sine + cosine * by_cosine, &Pixel { u, v });
    }
}

/// Samples an image at the pixels of a row that are `seen`; what the image's border leaves out is not seen. Unseen pixels are black.
///
/// Positions and weights of some pixels are computed at once, then each finds the pixels around it, and all are weighted down their columns and along
/// their rows. Loops that compute many at once have no branches, and split positions by a sum that rounds them: only then do compilers turn them into vector instructions.
#[multiversion(targets("x86_64+avx2"))]
fn sample_line(image: &[u8], width: usize, pixels: &[[f64; 2]], seen: &mut [bool], values: &mut [f32]) {
    const TOGETHER: usize = 32;
    /// A number to which others are added that are less than it, and not negative, has no bits for their fractions: the sum is rounded.
    const ROUNDING: f64 = (1_u64 << (f64::MANTISSA_DIGITS - 1)) as f64;
    let (most, stride) = (width as f64 - 2.0, width as f64);
    let chunks = pixels.chunks(TOGETHER).zip(seen.chunks_mut(TOGETHER)).zip(values.chunks_mut(TOGETHER));
    for ((pixels, seen), values) in chunks {
        let (mut columns, mut rows) = ([1.0_f64; TOGETHER], [1.0_f64; TOGETHER]);
        for (i, (&[u, v], seen)) in pixels.iter().zip(seen.iter_mut()).enumerate() {
            // Pixels that are seen are at least one pixel inside the camera's images; this image may be narrower.
            *seen &= u < most;
            (columns[i], rows[i]) = if *seen { (u, v) } else { (1.0, 1.0) };
        }
        let (mut firsts, mut past) = ([0_u32; TOGETHER], [[0.0_f32; TOGETHER]; 2]);
        for i in 0..TOGETHER {
            let whole = |place: f64| ((place - 0.5 + ROUNDING) - ROUNDING).max(1.0);
            let (column, row) = (whole(columns[i]), whole(rows[i]));
            (past[0][i], past[1][i]) = ((columns[i] - column) as f32, (rows[i] - row) as f32);
            firsts[i] = ((row - 1.0) * stride + (column - 1.0) + ROUNDING).to_bits() as u32;
        }
        let (mut across, mut down) = ([[0.0_f32; TOGETHER]; 4], [[0.0_f32; TOGETHER]; 4]);
        for i in 0..TOGETHER {
            let (by_column, by_row) = (cubic_weights(past[0][i]), cubic_weights(past[1][i]));
            (across[0][i], across[1][i], across[2][i], across[3][i]) =
                (by_column[0], by_column[1], by_column[2], by_column[3]);
            (down[0][i], down[1][i], down[2][i], down[3][i]) = (by_row[0], by_row[1], by_row[2], by_row[3]);
        }
        let mut taps = [[0_u32; TOGETHER]; 4];
        for (i, seen) in seen.iter_mut().enumerate().filter(|(_, seen)| **seen) {
            let found = taps_from(image, width, firsts[i] as usize);
            *seen = found.is_some();
            let found = found.unwrap_or_default();
            (taps[0][i], taps[1][i], taps[2][i], taps[3][i]) = (found[0], found[1], found[2], found[3]);
        }
        let mut mixed = [[0.0_f32; TOGETHER]; 4];
        for (k, mixed) in mixed.iter_mut().enumerate() {
            let shift = 8 * k as u32;
            for i in 0..TOGETHER {
                let level = |taps: u32| (taps >> shift & 255) as i32 as f32;
                mixed[i] = down[0][i] * level(taps[0][i])
                    + down[1][i] * level(taps[1][i])
                    + down[2][i] * level(taps[2][i])
                    + down[3][i] * level(taps[3][i]);
            }
        }
        let mut sums = [0.0_f32; TOGETHER];
        for i in 0..TOGETHER {
            sums[i] = across[0][i] * mixed[0][i]
                + across[1][i] * mixed[1][i]
                + across[2][i] * mixed[2][i]
                + across[3][i] * mixed[3][i];
        }
        values.copy_from_slice(&sums[..values.len()]);
    }
}

/// The 4 × 4 pixels of an 8-bit image from `first` on, four of a row in a number; `None` where they are not all inside.
#[inline(always)]
fn taps_from(pixels: &[u8], width: usize, first: usize) -> Option<[u32; 4]> {
    let (one, rest) = pixels.get(first..)?.split_at_checked(width)?;
    let (two, rest) = rest.split_at_checked(width)?;
    let (three, four) = rest.split_at_checked(width)?;
    let taps = [one.first_chunk()?, two.first_chunk()?, three.first_chunk()?, four.first_chunk()?];
    Some(taps.map(|taps| u32::from_le_bytes(*taps)))
}
