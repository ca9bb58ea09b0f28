//! Smoothing of disparities by planes through the neighbours on the same surface.

use multiversion::multiversion;
use multiversion::target::target_cfg_f;
use rayon::prelude::*;

use super::window::{BAND, LANES, Lanes, Padded, multiply_add};
use crate::pool::memory;

/// Largest difference in disparity, in pixels, of neighbours on one surface.
pub(super) const SAME_SURFACE: f32 = 1.5;
/// The same of the pixels of a window that is smoothed or registered as one plane. A window that holds both sides of a small step makes a mixture of
/// them; one that is much smaller than this cuts slanted surfaces.
pub(super) const SAME_PLANE: f32 = 1.0;
/// Smallest number of neighbours for a plane.
const LEAST: f32 = 8.0;
/// Smallest relative spread of neighbours across their main direction; nearly collinear ones determine no plane.
const LEAST_AREA: f32 = 0.05;

/// The planes through the disparities around each pixel, in pixels; NaN where there is no plane.
pub(super) struct Surface {
    /// Disparity of the plane at the pixel.
    pub disparity: Vec<f32>,
    /// RMS distance of the disparities from the plane.
    pub roughness: Vec<f32>,
}

impl Surface {
    /// Makes room for `count` pixels.
    pub(super) fn new(count: usize) -> Self {
        Self { disparity: memory(count), roughness: memory(count) }
    }

    /// Fits planes in windows that extend `reach` pixels in each direction. `disparities` are NaN where there are none.
    pub(super) fn fit(&mut self, disparities: &[f32], width: usize, reach: usize) {
        let bands = self.disparity.par_chunks_mut(BAND * width).zip(self.roughness.par_chunks_mut(BAND * width));
        bands.enumerate().for_each_init(
            || Padded::new(width, reach),
            |field, (band, (disparity, roughness))| {
                field.fill(disparities, band * BAND);
                let rows = disparity.chunks_exact_mut(width).zip(roughness.chunks_exact_mut(width));
                rows.enumerate()
                    .for_each(|(y, (disparity, roughness))| fit_row(field, y, reach, [disparity, roughness]));
            },
        );
    }
}

#[multiversion(targets("x86_64+avx512f+avx512dq+avx512vl+avx2+fma", "x86_64+avx2+fma"))]
fn fit_row(field: &Padded, y: usize, reach: usize, out: [&mut [f32]; 2]) {
    if target_cfg_f!(target_feature = "fma") {
        fit_blocks::<true>(field, y, reach, out);
    } else {
        fit_blocks::<false>(field, y, reach, out);
    }
}

#[inline(always)]
fn fit_blocks<const FUSED: bool>(field: &Padded, y: usize, reach: usize, [disparity, roughness]: [&mut [f32]; 2]) {
    disparity.fill(f32::NAN);
    roughness.fill(f32::NAN);
    let reach = reach as isize;
    for x in (0..disparity.len()).step_by(LANES) {
        let centre = *field.lanes(x, y, [0, 0]);
        if centre.iter().all(|disparity| disparity.is_nan()) {
            continue;
        }
        let mut sums = [[0.0; LANES]; 10];
        for j in -reach..=reach {
            let mut along = [[0.0; LANES]; 6];
            for i in -reach..=reach {
                gather::<FUSED>(&mut along, &centre, field.lanes(x, y, [i, j]), i as f32);
            }
            gather_row::<FUSED>(&mut sums, &along, j as f32);
        }
        for k in 0..LANES.min(disparity.len() - x) {
            let Some(plane) = solve(std::array::from_fn(|sum| sums[sum][k])) else { continue };
            disparity[x + k] = centre[k] + plane.above_centre;
            roughness[x + k] = plane.roughness;
        }
    }
}

/// Adds a neighbour at i of its row on the same surface: 1, i, i², d, id, d².
#[inline(always)]
fn gather<const FUSED: bool>(sums: &mut [Lanes; 6], centre: &Lanes, near: &Lanes, i: f32) {
    let [n, i1, ii, d1, id, dd] = sums;
    for k in 0..LANES {
        let off = near[k] - centre[k];
        let (one, d) = if off.abs() <= SAME_PLANE { (1.0, off) } else { (0.0, 0.0) };
        n[k] += one;
        i1[k] = multiply_add::<FUSED>(one, i, i1[k]);
        ii[k] = multiply_add::<FUSED>(one, i * i, ii[k]);
        d1[k] += d;
        id[k] = multiply_add::<FUSED>(d, i, id[k]);
        dd[k] = multiply_add::<FUSED>(d, d, dd[k]);
    }
}

/// Adds the sums of row j of a window: 1, i, j, i², ij, j², d, id, jd, d².
#[inline(always)]
fn gather_row<const FUSED: bool>(sums: &mut [Lanes; 10], of_row: &[Lanes; 6], j: f32) {
    let [n, i1, j1, ii, ij, jj, d1, id, jd, dd] = sums;
    for k in 0..LANES {
        let [one, i, i_i, d, i_d, d_d] = of_row.each_ref().map(|of_row| of_row[k]);
        n[k] += one;
        i1[k] += i;
        j1[k] = multiply_add::<FUSED>(one, j, j1[k]);
        ii[k] += i_i;
        ij[k] = multiply_add::<FUSED>(i, j, ij[k]);
        jj[k] = multiply_add::<FUSED>(one, j * j, jj[k]);
        d1[k] += d;
        id[k] += i_d;
        jd[k] = multiply_add::<FUSED>(d, j, jd[k]);
        dd[k] += d_d;
    }
}

struct Plane {
    above_centre: f32,
    roughness: f32,
}

/// Solves for the least-squares plane from the sums, by the normal equations about the mean.
#[inline(always)]
fn solve([n, i, j, ii, ij, jj, d, id, jd, dd]: [f32; 10]) -> Option<Plane> {
    if n < LEAST {
        return None;
    }
    let (mean_i, mean_j, mean_d) = (i / n, j / n, d / n);
    let (ii, ij, jj) = (ii - i * mean_i, ij - i * mean_j, jj - j * mean_j);
    let (id, jd, dd) = (id - d * mean_i, jd - d * mean_j, dd - d * mean_d);
    let determinant = ii * jj - ij * ij;
    if determinant <= LEAST_AREA * ii * jj {
        return None;
    }
    let (by_i, by_j) = ((jj * id - ij * jd) / determinant, (ii * jd - ij * id) / determinant);
    Some(Plane {
        above_centre: mean_d - by_i * mean_i - by_j * mean_j,
        roughness: ((dd - by_i * id - by_j * jd).max(0.0) / n).sqrt(),
    })
}
