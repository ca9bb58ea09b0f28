//! Dense registration: the remaining shift between the left view and the warped right view, to a fraction of a pixel.
//!
//! B. Lucas and T. Kanade, "An iterative image registration technique with an application to stereo vision", IJCAI
//! 1981, along the epipolar row alone, with gain and bias of the window as further unknowns: L = a R + b + g δ in a
//! window, with R the warped right view and g the mean derivative of both by the disparity. The standard deviation of δ
//! follows from the curvature of the sum of squares and from the residuals.

use multiversion::multiversion;
use multiversion::target::target_cfg_f;
use rayon::prelude::*;

use super::surface::SAME_PLANE;
use super::window::{BAND, LANES, Lanes, Padded, multiply_add};
use crate::plane::{Plane, cubic_weights};
use crate::pool::memory;

/// Smallest number of pixels of a window.
const LEAST: f32 = 16.0;
/// Number of unknowns of a window.
const UNKNOWNS: f32 = 3.0;

/// Variance that rounding to whole grey levels leaves in the difference of both views.
const ROUNDING: f32 = 2.0 / 12.0;

/// One camera's view: its brightness and the pixels that the camera sees.
#[derive(Clone, Copy)]
pub(super) struct SampledView<'a> {
    pub plane: &'a Plane,
    pub seen: &'a [bool],
}

/// The result of a registration for each pixel.
pub(super) struct Registration {
    /// Correction of the disparity in pixels; NaN where it is unknown.
    pub shift: Vec<f32>,
    /// Its standard deviation in pixels, if the window's pixels were independent.
    pub sigma: Vec<f32>,
    /// Fraction of the left window's contrast that the right one explains, 0 to 1.
    pub likeness: Vec<f32>,
}

impl Registration {
    /// Makes room for `count` pixels.
    pub(super) fn new(count: usize) -> Self {
        Self { shift: memory(count), sigma: memory(count), likeness: memory(count) }
    }

    /// Registers the right view to the left one around `disparity` (NaN where there is none). The windows extend `reach`
    /// pixels in each direction and contain the pixels of one surface.
    pub(super) fn run(&mut self, views: [SampledView<'_>; 2], disparity: &[f32], reach: usize) {
        let width = views[0].plane.width();
        let Self { shift, sigma, likeness } = self;
        let [shift, sigma, likeness] = [shift, sigma, likeness].map(|of| of.par_chunks_mut(BAND * width));
        (shift, sigma, likeness).into_par_iter().enumerate().for_each_init(
            || Fields::new(width, reach),
            |fields, (band, (shift, sigma, likeness))| {
                fields.fill(views, disparity, band * BAND);
                for (y, shift) in shift.chunks_exact_mut(width).enumerate() {
                    let row = y * width..(y + 1) * width;
                    solve_row(fields, y, reach, [shift, &mut sigma[row.clone()], &mut likeness[row]]);
                }
            },
        );
    }
}

/// What the windows of a band of rows need.
struct Fields {
    left: Padded,
    /// The right view at the partners.
    warped: Padded,
    /// The mean derivative of both by the disparity.
    slope: Padded,
    /// The disparity; NaN where one of the others is unknown.
    disparity: Padded,
}

impl Fields {
    fn new(width: usize, reach: usize) -> Self {
        let [left, warped, slope, disparity] = std::array::from_fn(|_| Padded::new(width, reach));
        Self { left, warped, slope, disparity }
    }

    fn fill(&mut self, [left, right]: [SampledView<'_>; 2], disparity: &[f32], top: usize) {
        self.left.fill(left.plane.values(), top);
        self.disparity.fill(disparity, top);
        let width = left.plane.width();
        for (row, y) in self.left.rows(top, left.plane.height()) {
            let Some(y) = y else { continue };
            let seen = [left, right].map(|view| &view.seen[y * width..][..width]);
            let out = [&mut self.warped, &mut self.slope, &mut self.disparity].map(|field| field.row_mut(row));
            warp([left.plane.row(y), right.plane.row(y)], seen, out);
        }
    }
}

/// Samples the right row at the partners of the left row's pixels, and the mean derivative of both by the disparity; where that is not
/// possible, there is no disparity.
fn warp(
    [left, right]: [&[f32]; 2],
    [left_seen, right_seen]: [&[bool]; 2],
    [warped, slope, disparity]: [&mut [f32]; 3],
) {
    for x in 0..left.len() {
        let at = x as f32 - disparity[x];
        let inside = x >= 1 && x + 1 < left.len() && at >= 1.0 && at < right.len() as f32 - 2.0;
        let column = at as usize;
        let taps = right.get(column.saturating_sub(1)..).and_then(|right| right.first_chunk::<4>());
        let Some(taps) = taps.filter(|_| inside && left_seen[x] && right_seen[column]) else {
            disparity[x] = f32::NAN;
            continue;
        };
        let t = at - column as f32;
        let dot = |weights: [f32; 4]| weights.iter().zip(taps).map(|(weight, tap)| weight * tap).sum::<f32>();
        warped[x] = dot(cubic_weights(t));
        slope[x] = -0.5 * (dot(cubic_slopes(t)) + 0.5 * (left[x + 1] - left[x - 1]));
    }
}

/// The derivatives of [`cubic_weights`].
fn cubic_slopes(t: f32) -> [f32; 4] {
    let t2 = t * t;
    [
        0.5 * (4.0 * t - 3.0 * t2 - 1.0),
        0.5 * (9.0 * t2 - 10.0 * t),
        0.5 * (8.0 * t - 9.0 * t2 + 1.0),
        0.5 * (3.0 * t2 - 2.0 * t),
    ]
}

#[multiversion(targets("x86_64+avx512f+avx512dq+avx512vl+avx2+fma", "x86_64+avx2+fma"))]
fn solve_row(fields: &Fields, y: usize, reach: usize, out: [&mut [f32]; 3]) {
    if target_cfg_f!(target_feature = "fma") {
        solve_blocks::<true>(fields, y, reach, out);
    } else {
        solve_blocks::<false>(fields, y, reach, out);
    }
}

#[inline(always)]
fn solve_blocks<const FUSED: bool>(
    Fields { left, warped, slope, disparity }: &Fields,
    y: usize,
    reach: usize,
    [shift, sigma, likeness]: [&mut [f32]; 3],
) {
    shift.fill(f32::NAN);
    sigma.fill(f32::NAN);
    likeness.fill(0.0);
    for x in (0..shift.len()).step_by(LANES) {
        let centre = [left, warped, slope, disparity].map(|field| *field.lanes(x, y, [0, 0]));
        if centre[3].iter().all(|disparity| disparity.is_nan()) {
            continue;
        }
        let (mut sums, reach) = ([[0.0; LANES]; 10], reach as isize);
        for j in -reach..=reach {
            for i in -reach..=reach {
                let (left, warped) = (left.lanes(x, y, [i, j]), warped.lanes(x, y, [i, j]));
                let (slope, disparity) = (slope.lanes(x, y, [i, j]), disparity.lanes(x, y, [i, j]));
                gather::<FUSED>(&mut sums, &centre, [left, warped, slope, disparity]);
            }
        }
        for k in 0..LANES.min(shift.len() - x) {
            let Some(solved) = solve(std::array::from_fn(|sum| sums[sum][k])) else { continue };
            [shift[x + k], sigma[x + k], likeness[x + k]] = solved;
        }
    }
}

/// Adds 1, L, R, g and their products of a neighbour on the same surface. L and R are relative to the centre's values,
/// so that single precision suffices.
#[inline(always)]
fn gather<const FUSED: bool>(sums: &mut [Lanes; 10], centre: &[Lanes; 4], near: [&Lanes; 4]) {
    let [n, l1, r1, g1, ll, lr, lg, rr, rg, gg] = sums;
    for k in 0..LANES {
        let (l, r, g) = (near[0][k] - centre[0][k], near[1][k] - centre[1][k], near[2][k]);
        let off = near[3][k] - centre[3][k];
        // Comparisons with NaN fail: where there is a disparity, the others are known too.
        let (one, l, r, g) = if off.abs() <= SAME_PLANE { (1.0, l, r, g) } else { (0.0, 0.0, 0.0, 0.0) };
        n[k] += one;
        l1[k] += l;
        r1[k] += r;
        g1[k] += g;
        ll[k] = multiply_add::<FUSED>(l, l, ll[k]);
        lr[k] = multiply_add::<FUSED>(l, r, lr[k]);
        lg[k] = multiply_add::<FUSED>(l, g, lg[k]);
        rr[k] = multiply_add::<FUSED>(r, r, rr[k]);
        rg[k] = multiply_add::<FUSED>(r, g, rg[k]);
        gg[k] = multiply_add::<FUSED>(g, g, gg[k]);
    }
}

/// Solves for shift, sigma and likeness from the sums of a window.
#[inline(always)]
fn solve([n, l, r, g, ll, lr, lg, rr, rg, gg]: [f32; 10]) -> Option<[f32; 3]> {
    if n < LEAST {
        return None;
    }
    let (ll, lr, lg) = (ll - l * l / n, lr - l * r / n, lg - l * g / n);
    let (rr, rg, gg) = (rr - r * r / n, rg - r * g / n, gg - g * g / n);
    // The part of g that a gain does not explain.
    let own = gg - rg * rg / rr;
    let solvable = own > 0.0 && rr > 0.0 && ll > 0.0;
    if !solvable {
        return None;
    }
    let shift = (lg - rg * lr / rr) / own;
    let gain = (lr - rg * shift) / rr;
    let remainder = (ll - gain * lr - shift * lg).max(0.0);
    let variance = remainder / (n - UNKNOWNS) + ROUNDING;
    Some([shift, (variance / own).sqrt(), (1.0 - remainder / ll).clamp(0.0, 1.0)])
}
