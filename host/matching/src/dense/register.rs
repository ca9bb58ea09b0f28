//! Dense registration: the remaining shift between the left view and the warped right view, to a fraction of a pixel.
//!
//! B. Lucas and T. Kanade, "An iterative image registration technique with an application to stereo vision", IJCAI
//! 1981, along the epipolar row alone, with gain and bias of the window as further unknowns: L = a R + b + g δ in a
//! window, with R the warped right view and g the mean derivative of both by the disparity. The standard deviation of δ
//! follows from the curvature of the sum of squares and from the residuals.

use multiversion::multiversion;
use rayon::prelude::*;

use super::surface::{SAME_SURFACE, offsets};
use super::window::{LANES, Lanes, Padded, for_blocks};
use crate::plane::{Plane, cubic_weights};

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

/// Registers the right view to the left one around `disparity` (NaN where there is none). The windows extend `reach`
/// pixels in each direction and contain the pixels of one surface.
pub(super) fn register([left, right]: [SampledView<'_>; 2], disparity: &[f32], reach: usize) -> Registration {
    let (width, count) = (left.plane.width(), disparity.len());
    let (mut warped, mut slope) = (vec![f32::NAN; count], vec![f32::NAN; count]);
    warped.par_chunks_mut(width).zip(slope.par_chunks_mut(width)).enumerate().for_each(|(y, (warped, slope))| {
        let row = y * width..(y + 1) * width;
        let seen = [&left.seen[row.clone()], &right.seen[row.clone()]];
        warp([left.plane.row(y), right.plane.row(y)], seen, &disparity[row], [warped, slope]);
    });
    let fields = [left.plane.values(), &warped, &slope, disparity].map(|values| Padded::new(values, width, reach));
    let mut out =
        Registration { shift: vec![f32::NAN; count], sigma: vec![f32::NAN; count], likeness: vec![0.0; count] };
    let Registration { shift, sigma, likeness } = &mut out;
    (shift.par_chunks_mut(width), sigma.par_chunks_mut(width), likeness.par_chunks_mut(width))
        .into_par_iter()
        .enumerate()
        .for_each(|(y, (shift, sigma, likeness))| solve_row(&fields, y, reach, [shift, sigma, likeness]));
    out
}

/// Samples the right row at the partners of the left row's pixels, and the mean derivative of both by the disparity.
fn warp(
    [left, right]: [&[f32]; 2],
    [left_seen, right_seen]: [&[bool]; 2],
    disparity: &[f32],
    [warped, slope]: [&mut [f32]; 2],
) {
    for x in 1..left.len().saturating_sub(1) {
        let at = x as f32 - disparity[x];
        let inside = at >= 1.0 && at < right.len() as f32 - 2.0;
        let column = at as usize;
        if !inside || !left_seen[x] || !right_seen[column] {
            continue;
        }
        let Some(taps) = right[column - 1..].first_chunk::<4>() else { continue };
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
fn solve_row(fields: &[Padded; 4], y: usize, reach: usize, [shift, sigma, likeness]: [&mut [f32]; 3]) {
    for_blocks(shift.len(), |x, lanes| {
        let at = |offset| -> [&Lanes; 4] { std::array::from_fn(|field| fields[field].lanes(x, y, offset)) };
        let centre = at([0, 0]);
        let mut sums = [[0.0; LANES]; 10];
        for offset in offsets(reach) {
            gather(&mut sums, centre, at(offset));
        }
        for k in 0..lanes {
            let Some(solved) = solve(std::array::from_fn(|sum| sums[sum][k])) else { continue };
            [shift[x + k], sigma[x + k], likeness[x + k]] = solved;
        }
    });
}

/// Adds 1, L, R, g and their products of a neighbour on the same surface. L and R are relative to the centre's values,
/// so that single precision suffices.
#[inline(always)]
fn gather(sums: &mut [Lanes; 10], centre: [&Lanes; 4], near: [&Lanes; 4]) {
    let [n, l1, r1, g1, ll, lr, lg, rr, rg, gg] = sums;
    for k in 0..LANES {
        let (l, r, g) = (near[0][k] - centre[0][k], near[1][k] - centre[1][k], near[2][k]);
        let off = near[3][k] - centre[3][k];
        // Comparisons with NaN fail.
        let counts = off.abs() <= SAME_SURFACE && r.abs() < f32::INFINITY && g.abs() < f32::INFINITY;
        let (one, l, r, g) = if counts { (1.0, l, r, g) } else { (0.0, 0.0, 0.0, 0.0) };
        n[k] += one;
        l1[k] += l;
        r1[k] += r;
        g1[k] += g;
        ll[k] += l * l;
        lr[k] += l * r;
        lg[k] += l * g;
        rr[k] += r * r;
        rg[k] += r * g;
        gg[k] += g * g;
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
