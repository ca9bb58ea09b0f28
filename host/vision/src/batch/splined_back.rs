//! Pixels of whole arrays to rays by the splined stereographic model.
//!
//! A finer surface, made once per lens and only where it is asked for, is so nearly the inverse of the lens's own that one step of Newton's method does.
//! The inverse itself cannot be tabulated to 1e-9 rad: its third derivatives jump along the curves that the lines of the grid are imaged to.

use super::lanes::{Kernel, multiply_add, over_rows};
use super::splined::{EDGE, Splined};
use super::stepwise::{ASK, RIM};
use super::surface::Surface;
use crate::{Camera, KannalaBrandt, Pixel, UnitRay};

/// Rows per step.
const LANES: usize = 32;
/// Most rounds of two steps.
const ROUNDS: usize = 5;
/// What may be missing, in units of the stereographic image, as it is judged by the steps: after one of Newton's method about its square, after one
/// with the same slopes about the product of both.
/// The second is for lenses that bend more.
const SMALLEST: [f64; 2] = [4e-10, 1e-10];

/// The way back.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct SplinedBack {
    forward: Splined,
    /// Places of the lens's surface over pixels, nearly.
    start: Surface<f32>,
    /// Control points of the start in a pixel, and the one at pixel 0.
    per_pixel: [f64; 2],
    first: [f64; 2],
    /// Outside of these pixels, from the lowest to the highest, nothing of the field is imaged.
    bounds: [[f64; 2]; 2],
    /// The square of what may be missing, in intervals of the surface to the fourth power.
    smallest: f64,
}

impl SplinedBack {
    /// `None` where it does not come near.
    pub(super) fn new(lens: &KannalaBrandt, forward: &Splined) -> Option<Self> {
        /// Intervals of the start along the longer side: 128 bytes each, 2 MB at most.
        const INTERVALS: [f64; 4] = [32.0, 64.0, 88.0, 128.0];
        let bounds = bounds(lens)?;
        let longest = bounds.map(|[low, high]| high - low).into_iter().fold(0.0, f64::max);
        let with = |intervals: f64| Self::with_start(forward, bounds, longest / intervals);
        let needs_one_step = |prepared: &Self| prepared.start_error(lens) <= 0.9 * SMALLEST[0].sqrt();
        let [coarse @ .., finest] = INTERVALS;
        let prepared = coarse.into_iter().map(with).find(needs_one_step).unwrap_or_else(|| with(finest));
        SMALLEST.into_iter().map(|missing| prepared.clone().missing(missing)).find(|prepared| prepared.is_near(lens))
    }

    /// With so much missing at most, in units of the stereographic image.
    fn missing(mut self, missing: f64) -> Self {
        self.smallest = (missing * self.forward.per_unit * self.forward.per_unit).powi(2);
        self
    }

    /// With intervals of so many pixels.
    fn with_start(forward: &Splined, bounds: [[f64; 2]; 2], interval: f64) -> Self {
        // A control point beyond each edge acts inside.
        let counts = bounds.map(|[low, high]| ((high - low) / interval).ceil() as usize + 3);
        let per_pixel = [1.0 / interval; 2];
        let first = [0, 1].map(|axis| 1.0 - bounds[axis][0] / interval);
        let sample = |place: [usize; 2]| {
            before(forward, [0, 1].map(|axis| (place[axis] as f64 - 1.0 - first[axis]) / per_pixel[axis]))
        };
        let start = Surface::new(3, counts, &control(counts, sample));
        Self { forward: forward.clone(), start, per_pixel, first, bounds, smallest: 0.0 }
    }

    /// The largest error of the start, in units of the stereographic image.
    fn start_error(&self, lens: &KannalaBrandt) -> f64 {
        let error = |ray: UnitRay<Camera>| {
            let (pixel, d) = (lens.project(&ray).ok()?, ray.vector());
            let [[x], [y]] = self.started::<false, 1>(&[[pixel.u], [pixel.v]]);
            let (found, image) = ([x, y], [d.x, d.y].map(|along| 2.0 * along / (1.0 + d.z)));
            let off = |axis: usize| (found[axis] - self.forward.middle[axis]) / self.forward.per_unit - image[axis];
            Some(off(0).hypot(off(1)))
        };
        rays(lens).filter_map(error).fold(0.0, f64::max)
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

    /// Places of the lens's surface, nearly.
    #[inline(always)]
    fn started<const FUSED: bool, const W: usize>(&self, pixels: &[[f64; W]; 2]) -> [[f64; W]; 2] {
        let mut places = *pixels;
        for (places, (per_pixel, first)) in places.iter_mut().zip(self.per_pixel.into_iter().zip(self.first)) {
            for place in places {
                *place = multiply_add::<FUSED>(*place, per_pixel, first);
            }
        }
        self.start.values::<FUSED, W>(&self.start.located::<FUSED, W>(&places))
    }

    /// A step of Newton's method, with the slopes of the places where it begins.
    #[inline(always)]
    fn step<const FUSED: bool, const W: usize>(&self, wanted: &[[f64; W]; 2], found: &mut [[f64; W]; 2]) -> Step<W> {
        let surface = &self.forward.surface;
        let steep = surface.steep::<FUSED, W>(&surface.located::<FUSED, W>(found));
        let ([xx, yx], [xy, yy]) = (steep.across, steep.down);
        let mut inverse = [[[0.0; W]; 2]; 2];
        for j in 0..W {
            let over = 1.0 / (xx[j] * yy[j] - xy[j] * yx[j]);
            inverse[0][0][j] = yy[j] * over;
            inverse[0][1][j] = -xy[j] * over;
            inverse[1][0][j] = -yx[j] * over;
            inverse[1][1][j] = xx[j] * over;
        }
        let squared = go::<FUSED, W>(&inverse, wanted, &steep.values, found);
        Step { inverse, squared }
    }

    /// One more with the same slopes; the square of its length.
    #[inline(always)]
    fn chord<const FUSED: bool, const W: usize>(
        &self,
        step: &Step<W>,
        wanted: &[[f64; W]; 2],
        found: &mut [[f64; W]; 2],
    ) -> [f64; W] {
        let surface = &self.forward.surface;
        let values = surface.values::<FUSED, W>(&surface.located::<FUSED, W>(found));
        go::<FUSED, W>(&step.inverse, wanted, &values, found)
    }

    /// Moves places to where the pixels are the `wanted` ones, and returns the square of about what is missing then.
    #[inline(always)]
    fn search<const FUSED: bool, const W: usize>(&self, wanted: &[[f64; W]; 2], found: &mut [[f64; W]; 2]) -> [f64; W] {
        let mut missing = [0.0; W];
        for _ in 0..ROUNDS {
            let step = self.step::<FUSED, W>(wanted, found);
            for (missing, squared) in missing.iter_mut().zip(&step.squared) {
                *missing = squared * squared;
            }
            if self.all_found::<W>(&missing) {
                break;
            }
            let squared = self.chord::<FUSED, W>(&step, wanted, found);
            for (missing, (first, second)) in missing.iter_mut().zip(step.squared.iter().zip(&squared)) {
                *missing = first * second;
            }
            if self.all_found::<W>(&missing) {
                break;
            }
        }
        missing
    }

    /// Whether more steps would find no more.
    #[inline(always)]
    fn all_found<const W: usize>(&self, missing: &[f64; W]) -> bool {
        // The sign bits of all, together: comparisons would be counted one by one.
        let signs = missing.iter().fold(0, |signs, missing| signs | (self.smallest - missing).to_bits());
        signs >> 63 == 0
    }
}

/// A step of Newton's method.
#[repr(align(64))]
struct Step<const W: usize> {
    /// Derivatives of the place by the pixel.
    inverse: [[[f64; W]; 2]; 2],
    squared: [f64; W],
}

/// Moves places by what is missing to the `wanted` pixels; the square of how far.
#[inline(always)]
fn go<const FUSED: bool, const W: usize>(
    [[xx, xy], [yx, yy]]: &[[[f64; W]; 2]; 2],
    wanted: &[[f64; W]; 2],
    values: &[[f64; W]; 2],
    found: &mut [[f64; W]; 2],
) -> [f64; W] {
    let (fused, mut squared) = (multiply_add::<FUSED>, [0.0; W]);
    for j in 0..W {
        let (off_u, off_v) = (wanted[0][j] - values[0][j], wanted[1][j] - values[1][j]);
        let (step_x, step_y) = (fused(xx[j], off_u, xy[j] * off_v), fused(yx[j], off_u, yy[j] * off_v));
        found[0][j] += step_x;
        found[1][j] += step_y;
        squared[j] = fused(step_x, step_x, step_y * step_y);
    }
    squared
}

impl Kernel<2, 3> for SplinedBack {
    #[inline(always)]
    fn lanes<const FUSED: bool, const W: usize>(&self, pixels: [[f64; W]; 2]) -> [[f64; W]; 3] {
        let fused = multiply_add::<FUSED>;
        let (mut wanted, mut outside) = (pixels, [0.0; W]);
        let [[left, right], [top, bottom]] = self.bounds;
        for j in 0..W {
            let (u, v) = (pixels[0][j], pixels[1][j]);
            // What is no number is outside. Outside, nothing is sought.
            let is_inside = u >= left && u <= right && v >= top && v <= bottom;
            outside[j] = if is_inside { 0.0 } else { f64::NAN };
            wanted[0][j] = if is_inside { u } else { self.forward.pixel[0] };
            wanted[1][j] = if is_inside { v } else { self.forward.pixel[1] };
        }
        let mut found = self.started::<FUSED, W>(&wanted);
        let missing = self.search::<FUSED, W>(&wanted, &mut found);
        let inside = self.forward.surface.inside::<W>(&found);
        let ([mut x, mut y], mut z) = (found, [0.0; W]);
        let half = 0.5 / self.forward.per_unit;
        for j in 0..W {
            // Half the stereographic image.
            let (a, b) = ((x[j] - self.forward.middle[0]) * half, (y[j] - self.forward.middle[1]) * half);
            let squared = fused(a, a, b * b);
            let over = 1.0 / (1.0 + squared);
            (x[j], y[j], z[j]) = (2.0 * a * over, 2.0 * b * over, (1.0 - squared) * over);
            // Where nothing is found there may still be a ray.
            let is_told = missing[j] <= self.smallest && inside[j] > EDGE && z[j] - self.forward.end > RIM;
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

/// The lowest and highest pixels, across and down, of the field, and a margin.
fn bounds(lens: &KannalaBrandt) -> Option<[[f64; 2]; 2]> {
    const MARGIN: f64 = 0.05;
    let nothing = [[f64::INFINITY, f64::NEG_INFINITY]; 2];
    let seen = rays(lens).filter_map(|ray| lens.project(&ray).ok()).fold(nothing, |[across, down], Pixel { u, v }| {
        [[across[0].min(u), across[1].max(u)], [down[0].min(v), down[1].max(v)]]
    });
    let wider = seen.map(|[low, high]| [low - MARGIN * (high - low), high + MARGIN * (high - low)]);
    wider.as_flattened().iter().all(|bound| bound.is_finite()).then_some(wider)
}

/// Control points of a cubic surface near the samples, of which there is one more beyond each edge: c = (8 f - the sum of the neighbours) / 6 along
/// each axis, which is exact for cubic polynomials (C. de Boor, *A Practical Guide to Splines*, chapter XII).
fn control([columns, rows]: [usize; 2], sample: impl Fn([usize; 2]) -> [f64; 2]) -> Vec<[f64; 2]> {
    let samples: Vec<Vec<[f64; 2]>> =
        (0..rows + 2).map(|row| (0..columns + 2).map(|column| sample([column, row])).collect()).collect();
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

/// The place of a pixel on the lens's surface, by Newton's method; a little beyond its edge the surface goes on, farther out in a straight line.
fn before(forward: &Splined, wanted: [f64; 2]) -> [f64; 2] {
    const STEPS: usize = 12;
    const BEYOND: f64 = 0.5;
    let straight = [0, 1].map(|axis| (wanted[axis] - forward.pixel[axis]) / forward.scale[axis] + forward.middle[axis]);
    let mut found = straight;
    for _ in 0..STEPS {
        let kept = forward.surface.kept(found, BEYOND);
        let on = forward.surface.located::<false, 1>(&kept.map(|place| [place]));
        let steep = forward.surface.steep::<false, 1>(&on);
        let ([[xx], [yx]], [[xy], [yy]]) = (steep.across, steep.down);
        let off =
            [0, 1].map(|axis| wanted[axis] - steep.values[axis][0] - forward.scale[axis] * (found[axis] - kept[axis]));
        let over = 1.0 / (xx * yy - xy * yx);
        let step = [(yy * off[0] - xy * off[1]) * over, (xx * off[1] - yx * off[0]) * over];
        found = [found[0] + step[0], found[1] + step[1]];
        if step[0].abs() + step[1].abs() < 1e-12 {
            break;
        }
    }
    // Far outside nothing need be near.
    let is_near = [0, 1].iter().all(|axis| (found[*axis] - straight[*axis]).abs() < forward.per_unit);
    if is_near { found } else { straight }
}

over_rows!(splined_back_baseline, splined_back_best, SplinedBack, LANES, 2 => 3);
