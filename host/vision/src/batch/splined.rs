//! Whole arrays by the splined stereographic model, both ways.
//!
//! The way back is Newton's method, from a surface that is nearly the inverse: finer, and made once per lens.

use multiversion::multiversion;
use multiversion::target::target_cfg_f;

use super::lanes::{ALWAYS_FUSED, Kernel, for_rows, multiply_add};
use super::stepwise::{ASK, RIM};
use super::surface::Surface;
use crate::{Camera, KannalaBrandt, Pixel, SplineGrid, SplinedStereographic, UnitRay};

/// Rows per step.
const LANES: usize = 16;
/// Most steps of Newton's method.
const STEPS: usize = 10;
/// The square of a last step: what is missing after it is about its square.
const SMALLEST: f64 = 1e-10;
/// So near to an edge of the surface, in its intervals, the model itself is asked.
const EDGE: f64 = 1e-9;

/// A splined lens, prepared.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Splined {
    surface: Surface,
    /// What u and v are of (x, y, 1), x and y alone each.
    scale: [f64; 2],
    shift: [f64; 2],
    /// The cosine of the angle at the end of the field.
    end: f64,
}

impl Splined {
    /// Of the lens with this model and this affine map to pixels, which has no skew.
    pub(super) fn new(model: &SplinedStereographic, affine: [[f64; 3]; 2], theta_max: f64) -> Self {
        let surface = Surface::new(model.grid, model.grid.intervals_per_unit(), [0.0; 2], &model.control);
        let [[fx, _, cx], [_, fy, cy]] = affine;
        Self { surface, scale: [fx, fy], shift: [cx, cy], end: theta_max.cos() }
    }

    /// A number: zero where something is told, not one outside, and [`ASK`] where the model is to be asked.
    #[inline(always)]
    fn told<const W: usize>(inside: &[f64; W], above_end: &[f64; W]) -> [f64; W] {
        let mut told = [0.0; W];
        for j in 0..W {
            let out = if inside[j] > EDGE && above_end[j] > RIM { 0.0 } else { f64::NAN };
            let near = inside[j].abs() <= EDGE || above_end[j].abs() <= RIM;
            told[j] = if near { ASK } else { out };
        }
        told
    }
}

impl Kernel<3, 2> for Splined {
    #[inline(always)]
    fn lanes<const FUSED: bool, const W: usize>(&self, [x, y, z]: [[f64; W]; 3]) -> [[f64; W]; 2] {
        let fused = multiply_add::<FUSED>;
        let (mut at, mut above_end) = ([[0.0; W]; 2], [0.0; W]);
        for j in 0..W {
            let norm = fused(x[j], x[j], fused(y[j], y[j], z[j] * z[j])).sqrt();
            let over = 2.0 / (norm + z[j]);
            (at[0][j], at[1][j]) = (x[j] * over, y[j] * over);
            // The origin has no direction.
            above_end[j] = z[j] / norm - self.end;
        }
        let places = self.surface.places::<FUSED, W>(&at);
        let shifts = self.surface.shifts::<FUSED, W>(&places);
        let told = Self::told::<W>(&places.inside, &above_end);
        for j in 0..W {
            at[0][j] = fused(self.scale[0], at[0][j] + shifts[0][j], self.shift[0]) + told[j];
            at[1][j] = fused(self.scale[1], at[1][j] + shifts[1][j], self.shift[1]) + told[j];
        }
        at
    }
}

/// The way back.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct SplinedBack {
    forward: Splined,
    /// What is nearly to be added to a shifted place to get the one before.
    start: Surface,
    /// Outside of these places, from their lowest to their highest coordinates, nothing of the field is imaged.
    bounds: [[f64; 2]; 2],
}

impl SplinedBack {
    /// `None` where it does not come near.
    pub(super) fn new(lens: &KannalaBrandt, model: &SplinedStereographic, forward: Splined) -> Option<Self> {
        /// Intervals of the start in each of the surface.
        const FINER: f64 = 4.0;
        const MOST: f64 = 400.0;
        let bounds = bounds(lens, &forward)?;
        let per_unit = FINER * model.grid.intervals_per_unit();
        let middle = [0, 1].map(|axis| 0.5 * (bounds[axis][0] + bounds[axis][1]));
        let count = |axis: usize| ((bounds[axis][1] - bounds[axis][0]) * per_unit).ceil().min(MOST) as usize + 5;
        let grid = SplineGrid { order: 3, columns: count(0), rows: count(1), field_deg: 0.0 };
        let control = inverse_control(&forward, grid, per_unit, middle);
        let prepared = Self { start: Surface::new(grid, per_unit, middle, &control), forward, bounds };
        prepared.is_near(lens).then_some(prepared)
    }

    /// Whether it gives the rays of the lens.
    fn is_near(&self, lens: &KannalaBrandt) -> bool {
        const LARGEST_ERROR: f64 = 8e-10;
        rays(lens).all(|ray| {
            let Ok(Pixel { u, v }) = lens.project(&ray) else { return true };
            let [[x], [y], [z]] = self.lanes::<false, 1>([[u], [v]]);
            x == ASK || (ray.vector() - nalgebra::Vector3::new(x, y, z)).norm() <= LARGEST_ERROR
        })
    }
}

impl Kernel<2, 3> for SplinedBack {
    #[inline(always)]
    fn lanes<const FUSED: bool, const W: usize>(&self, [u, v]: [[f64; W]; 2]) -> [[f64; W]; 3] {
        let (fused, surface) = (multiply_add::<FUSED>, &self.forward.surface);
        let over = self.forward.scale.map(|scale| 1.0 / scale);
        let (mut wanted, mut outside, middle) =
            ([[0.0; W]; 2], [0.0; W], self.bounds.map(|[low, high]| 0.5 * (low + high)));
        let [[left, right], [top, bottom]] = self.bounds;
        for j in 0..W {
            let (x, y) = ((u[j] - self.forward.shift[0]) * over[0], (v[j] - self.forward.shift[1]) * over[1]);
            // What is no number is outside. Outside, nothing is sought.
            let is_inside = x >= left && x <= right && y >= top && y <= bottom;
            outside[j] = if is_inside { 0.0 } else { f64::NAN };
            wanted[0][j] = if is_inside { x } else { middle[0] };
            wanted[1][j] = if is_inside { y } else { middle[1] };
        }
        let shifts = self.start.shifts::<FUSED, W>(&self.start.places::<FUSED, W>(&wanted));
        let (mut found, mut last) = (wanted, [0.0; W]);
        for j in 0..W {
            found[0][j] += shifts[0][j];
            found[1][j] += shifts[1][j];
        }
        for _ in 0..STEPS {
            let places = surface.places::<FUSED, W>(&found);
            let (shifts, [[xx, xy], [yx, yy]]) = surface.shifts_with_slopes::<FUSED, W>(&places);
            for j in 0..W {
                let (xx, yy, xy, yx) = (1.0 + xx[j], 1.0 + yy[j], xy[j], yx[j]);
                let over = 1.0 / (xx * yy - xy * yx);
                let (off_x, off_y) =
                    (wanted[0][j] - found[0][j] - shifts[0][j], wanted[1][j] - found[1][j] - shifts[1][j]);
                let (step_x, step_y) = ((yy * off_x - xy * off_y) * over, (xx * off_y - yx * off_x) * over);
                found[0][j] += step_x;
                found[1][j] += step_y;
                last[j] = fused(step_x, step_x, step_y * step_y);
            }
            let mut longest = 0.0;
            for square in last {
                longest = if square > longest { square } else { longest };
            }
            if longest <= SMALLEST {
                break;
            }
        }
        let places = surface.places::<FUSED, W>(&found);
        let [mut x, mut y] = found;
        let (mut z, mut above_end) = ([0.0; W], [0.0; W]);
        for j in 0..W {
            let squared = 0.25 * fused(x[j], x[j], y[j] * y[j]);
            let over = 1.0 / (1.0 + squared);
            (x[j], y[j], z[j]) = (x[j] * over, y[j] * over, (1.0 - squared) * over);
            above_end[j] = z[j] - self.forward.end;
        }
        for j in 0..W {
            // Where nothing is found there may still be a ray.
            let is_told = last[j] <= SMALLEST && places.inside[j] > EDGE && above_end[j] > RIM;
            x[j] = outside[j] + if is_told { x[j] } else { ASK };
            y[j] += outside[j];
            z[j] += outside[j];
        }
        [x, y, z]
    }
}

/// Rays all over the field of a lens.
fn rays(lens: &KannalaBrandt) -> impl Iterator<Item = UnitRay<Camera>> {
    const RAYS: u32 = 2000;
    let most = lens.theta_max().rad();
    (0..RAYS).filter_map(move |place| {
        let (sine, cosine) = (most * (f64::from(place) / f64::from(RAYS)).sqrt()).sin_cos();
        let (sin, cos) = (2.4 * f64::from(place)).sin_cos();
        UnitRay::new(nalgebra::Vector3::new(sine * cos, sine * sin, cosine))
    })
}

/// The lowest and highest coordinates, across and down, of shifted places of the field, and a margin.
fn bounds(lens: &KannalaBrandt, forward: &Splined) -> Option<[[f64; 2]; 2]> {
    const MARGIN: f64 = 0.05;
    let nothing = [[f64::INFINITY, f64::NEG_INFINITY]; 2];
    let seen = rays(lens).filter_map(|ray| lens.project(&ray).ok()).fold(nothing, |bounds, Pixel { u, v }| {
        let at = [(u - forward.shift[0]) / forward.scale[0], (v - forward.shift[1]) / forward.scale[1]];
        [0, 1].map(|axis| [bounds[axis][0].min(at[axis]), bounds[axis][1].max(at[axis])])
    });
    let wider = seen.map(|[low, high]| [low - MARGIN * (high - low), high + MARGIN * (high - low)]);
    wider.as_flattened().iter().all(|bound| bound.is_finite()).then_some(wider)
}

/// Control points of a cubic surface near the inverse: c = (8 f - the mean of the neighbours' twice) / 6 along each axis, which is exact for
/// cubic polynomials (C. de Boor, *A Practical Guide to Splines*, chapter XII).
fn inverse_control(forward: &Splined, grid: SplineGrid, per_unit: f64, middle: [f64; 2]) -> Vec<[f64; 2]> {
    let SplineGrid { columns, rows, .. } = grid;
    let place = |index: usize, count: usize, middle: f64| {
        // One sample beyond each edge.
        (index as f64 - 1.0 - 0.5 * (count as f64 - 1.0)) / per_unit + middle
    };
    let sample =
        |row: usize, column: usize| before(forward, [place(column, columns, middle[0]), place(row, rows, middle[1])]);
    let samples: Vec<Vec<[f64; 2]>> =
        (0..rows + 2).map(|row| (0..columns + 2).map(|column| sample(row, column)).collect()).collect();
    let sharpened = |[a, b, c]: [[f64; 2]; 3]| [0, 1].map(|axis| (8.0 * b[axis] - a[axis] - c[axis]) / 6.0);
    let across =
        |row: &Vec<[f64; 2]>| -> Vec<[f64; 2]> { row.array_windows().map(|three| sharpened(*three)).collect() };
    let sharp: Vec<Vec<[f64; 2]>> = samples.iter().map(across).collect();
    sharp
        .array_windows()
        .flat_map(|[above, here, below]| {
            (0..columns).map(|column| sharpened([above[column], here[column], below[column]]))
        })
        .collect()
}

/// What is to be added to a shifted place to get the one before, by Newton's method; beyond the surface the shift is that of its edge.
fn before(forward: &Splined, wanted: [f64; 2]) -> [f64; 2] {
    const STEPS: usize = 12;
    let mut found = wanted;
    for _ in 0..STEPS {
        let kept = forward.surface.kept(found);
        let places = forward.surface.places::<false, 1>(&kept.map(|x| [x]));
        let (shifts, slopes) = forward.surface.shifts_with_slopes::<false, 1>(&places);
        let [[xx, xy], [yx, yy]] = slopes.map(|row| row.map(|[slope]| slope));
        let (xx, yy) = (1.0 + xx, 1.0 + yy);
        let over = 1.0 / (xx * yy - xy * yx);
        let off = [0, 1].map(|axis| wanted[axis] - found[axis] - shifts[axis][0]);
        let step = [(yy * off[0] - xy * off[1]) * over, (xx * off[1] - yx * off[0]) * over];
        found = [found[0] + step[0], found[1] + step[1]];
    }
    let shift = [found[0] - wanted[0], found[1] - wanted[1]];
    // Far outside nothing need be near.
    if shift.iter().all(|shift| shift.abs() < 1.0) { shift } else { [0.0; 2] }
}

pub(super) fn splined_baseline(lens: &Splined, points: &[[f64; 3]], pixels: &mut Vec<[f64; 2]>) {
    for_rows::<ALWAYS_FUSED, LANES, 3, 2>(lens, points, pixels);
}

#[multiversion(targets("x86_64+avx512f+avx512dq+avx512vl+avx2+fma", "x86_64+avx2+fma"))]
pub(super) fn splined_best(lens: &Splined, points: &[[f64; 3]], pixels: &mut Vec<[f64; 2]>) {
    if target_cfg_f!(target_feature = "fma") {
        for_rows::<true, LANES, 3, 2>(lens, points, pixels);
    } else {
        for_rows::<ALWAYS_FUSED, LANES, 3, 2>(lens, points, pixels);
    }
}

pub(super) fn splined_back_baseline(lens: &SplinedBack, pixels: &[[f64; 2]], rays: &mut Vec<[f64; 3]>) {
    for_rows::<ALWAYS_FUSED, LANES, 2, 3>(lens, pixels, rays);
}

#[multiversion(targets("x86_64+avx512f+avx512dq+avx512vl+avx2+fma", "x86_64+avx2+fma"))]
pub(super) fn splined_back_best(lens: &SplinedBack, pixels: &[[f64; 2]], rays: &mut Vec<[f64; 3]>) {
    if target_cfg_f!(target_feature = "fma") {
        for_rows::<true, LANES, 2, 3>(lens, pixels, rays);
    } else {
        for_rows::<ALWAYS_FUSED, LANES, 2, 3>(lens, pixels, rays);
    }
}
