//! Smoothing of disparities by planes through the neighbours on the same surface.

use multiversion::multiversion;
use rayon::prelude::*;

use super::window::{LANES, Lanes, Padded, for_blocks};

/// Largest difference in disparity, in pixels, of neighbours on one surface.
pub(super) const SAME_SURFACE: f32 = 1.5;
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

/// Fits planes in windows that extend `reach` pixels in each direction. `disparities` are NaN where there are none.
pub(super) fn surface(disparities: &[f32], width: usize, reach: usize) -> Surface {
    let field = Padded::new(disparities, width, reach);
    let empty = vec![f32::NAN; disparities.len()];
    let mut out = Surface { disparity: empty.clone(), roughness: empty };
    let Surface { disparity, roughness } = &mut out;
    disparity
        .par_chunks_mut(width)
        .zip(roughness.par_chunks_mut(width))
        .enumerate()
        .for_each(|(y, (disparity, roughness))| fit_row(&field, y, reach, [disparity, roughness]));
    out
}

#[multiversion(targets("x86_64+avx512f+avx512dq+avx512vl+avx2+fma", "x86_64+avx2+fma"))]
fn fit_row(field: &Padded, y: usize, reach: usize, [disparity, roughness]: [&mut [f32]; 2]) {
    for_blocks(disparity.len(), |x, lanes| {
        let centre = field.lanes(x, y, [0, 0]);
        let mut sums = [[0.0; LANES]; 10];
        for [i, j] in offsets(reach) {
            gather(&mut sums, centre, field.lanes(x, y, [i, j]), [i as f32, j as f32]);
        }
        for k in 0..lanes {
            let Some(plane) = solve(std::array::from_fn(|sum| sums[sum][k])) else { continue };
            disparity[x + k] = centre[k] + plane.above_centre;
            roughness[x + k] = plane.roughness;
        }
    });
}

/// The offsets of the pixels of a window, row by row.
#[inline(always)]
pub(super) fn offsets(reach: usize) -> impl Iterator<Item = [isize; 2]> {
    let reach = reach as isize;
    (-reach..=reach).flat_map(move |j| (-reach..=reach).map(move |i| [i, j]))
}

/// Adds a neighbour at (i, j) on the same surface: 1, i, j, i², ij, j², d, id, jd, d².
#[inline(always)]
fn gather(sums: &mut [Lanes; 10], centre: &Lanes, near: &Lanes, [i, j]: [f32; 2]) {
    let [n, i1, j1, ii, ij, jj, d1, id, jd, dd] = sums;
    for k in 0..LANES {
        let off = near[k] - centre[k];
        let same = off.abs() <= SAME_SURFACE;
        let (one, d) = if same { (1.0, off) } else { (0.0, 0.0) };
        n[k] += one;
        i1[k] += one * i;
        j1[k] += one * j;
        ii[k] += one * i * i;
        ij[k] += one * i * j;
        jj[k] += one * j * j;
        d1[k] += d;
        id[k] += d * i;
        jd[k] += d * j;
        dd[k] += d * d;
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
