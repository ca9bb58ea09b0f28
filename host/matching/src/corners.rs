//! Detection of corners at several resolutions, spread over a view or over a single image.
//!
//! M. Brown, R. Szeliski and S. Winder, "Multi-image matching using multi-scale oriented patches", CVPR 2005, §2:
//! corners are maxima of the harmonic mean of the structure tensor's eigenvalues in each level of a pyramid, located by
//! a quadratic fit. To spread them, the strongest corner of every cell of the view is taken first, then the second, and
//! so on.

use std::ops::Range;

use image::GrayImage;
use multiversion::multiversion;
use rayon::prelude::*;
use vergence_vision::{Camera, KannalaBrandt, Pixel};

use crate::ViewPixel;
use crate::plane::{Plane, Pyramid};
use crate::smoothing::Gaussian;

/// A position that is compared.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Keypoint {
    /// Position in pixels of the view.
    pub at: ViewPixel,
    /// Pyramid level of its detection.
    pub level: usize,
}

/// A local maximum of the corner response.
#[derive(Clone, Copy)]
struct Corner {
    keypoint: Keypoint,
    strength: f32,
}

/// Smoothing of the structure tensor, in pixels of its level (Brown et al.: σ_i = 1.5).
const INTEGRATION_SIGMA: f32 = 1.5;
/// Least harmonic mean, in squared grey levels per pixel: noise of 2 grey levels stays below it.
const LEAST_STRENGTH: f32 = 1.5;
/// Half side of the square in which a corner must be the strongest, in pixels of its level.
const SUPPRESSION_RADIUS: usize = 2;
/// Side of the cells over which corners are spread, in pixels of the view.
const CELL: f64 = 48.0;

/// Pyramid levels of a single image: the finest only.
const IMAGE_LEVELS: usize = 1;
/// Smallest distance of a corner of a single image to the edge of the lens's field in pixels; nearer ones may be the
/// edge itself.
const FIELD_MARGIN: f64 = 8.0;

/// Detects at most `budget` corners that `compared` accepts, sorted by rows. Half of the budget is for the finest
/// level, a quarter for the next, and so on.
pub(crate) fn detect(pyramid: &Pyramid, budget: usize, compared: impl Fn(&Keypoint) -> bool + Sync) -> Vec<Keypoint> {
    let height = pyramid.levels().first().map_or(0, Plane::height);
    detect_within(pyramid, 0..height, budget, compared)
}

/// The same within some rows of the view.
pub(crate) fn detect_within(
    pyramid: &Pyramid,
    rows: Range<usize>,
    budget: usize,
    compared: impl Fn(&Keypoint) -> bool + Sync,
) -> Vec<Keypoint> {
    let levels = pyramid.levels();
    let mut keypoints = Vec::with_capacity(budget);
    for (level, plane) in levels.iter().enumerate() {
        let share = budget >> (level + 1).min(levels.len() - 1);
        let found: Vec<Corner> = maxima(plane, rows.start >> level..(rows.end >> level) + 1, level)
            .into_par_iter()
            .filter(|corner| compared(&corner.keypoint))
            .collect();
        keypoints.extend(spread(found, share).iter().map(|corner| corner.keypoint));
    }
    keypoints.sort_by(|p, q| p.at.y.total_cmp(&q.at.y).then(p.at.x.total_cmp(&q.at.x)).then(p.level.cmp(&q.level)));
    keypoints
}

/// Detects at most `most` corners of `image`, spread over the field of `camera`, sorted by rows.
///
/// They still give bearings where the other camera has failed. Empty where the image does not have the size that the
/// camera is calibrated for.
#[must_use]
pub fn image_corners(image: &GrayImage, camera: &KannalaBrandt, most: usize) -> Vec<Pixel> {
    let (width, height) = image.dimensions();
    if (width, height) != (camera.size().width, camera.size().height) {
        return Vec::new();
    }
    let plane = Plane::new(width as usize, height as usize, image.iter().map(|&level| f32::from(level)).collect());
    let inside = |keypoint: &Keypoint| {
        [-FIELD_MARGIN, 0.0, FIELD_MARGIN].iter().all(|dv| {
            [-FIELD_MARGIN, 0.0, FIELD_MARGIN]
                .iter()
                .all(|du| camera.unproject::<Camera>(Pixel { u: keypoint.at.x + du, v: keypoint.at.y + dv }).is_ok())
        })
    };
    detect(&Pyramid::new(&plane, IMAGE_LEVELS), most, inside)
        .into_iter()
        .map(|keypoint| Pixel { u: keypoint.at.x, v: keypoint.at.y })
        .collect()
}

/// The harmonic mean det/trace of the structure tensor at each pixel of some rows.
fn response(plane: &Plane, rows: Range<usize>) -> Plane {
    let (width, height) = (plane.width(), plane.height());
    let mut values = vec![0.0; width * rows.len()];
    let products = |y: usize, rows: [&mut [f32]; 3]| match (1..height.saturating_sub(1)).contains(&y) {
        true => gradient_products([plane.row(y - 1), plane.row(y), plane.row(y + 1)], rows),
        false => rows.into_iter().for_each(|row| row.fill(0.0)),
    };
    let smoothing = Gaussian::new(INTEGRATION_SIGMA);
    let count = rows.len();
    smoothing.smooth([width, height], rows, &mut values, products, harmonic_means);
    Plane::new(width, count, values)
}

/// The products of the central differences in a row, by columns first, by rows, and both; 0 at the ends.
#[multiversion(targets("x86_64+avx512f+avx512dq+avx512bw+avx512vl+avx2", "x86_64+avx2"))]
fn gradient_products([above, row, below]: [&[f32]; 3], [xx, xy, yy]: [&mut [f32]; 3]) {
    for products in [&mut *xx, &mut *xy, &mut *yy] {
        products.first_mut().into_iter().for_each(|first| *first = 0.0);
        products.last_mut().into_iter().for_each(|last| *last = 0.0);
    }
    let inner = row.len().saturating_sub(2);
    let (above, below, left, right) = (&above[1..][..inner], &below[1..][..inner], &row[..inner], &row[2..][..inner]);
    let (xx, xy, yy) = (&mut xx[1..][..inner], &mut xy[1..][..inner], &mut yy[1..][..inner]);
    for x in 0..inner {
        let (gx, gy) = (0.5 * (right[x] - left[x]), 0.5 * (below[x] - above[x]));
        (xx[x], xy[x], yy[x]) = (gx * gx, gx * gy, gy * gy);
    }
}

#[multiversion(targets("x86_64+avx512f+avx512dq+avx512bw+avx512vl+avx2", "x86_64+avx2"))]
fn harmonic_means([xx, xy, yy]: [&[f32]; 3], out: &mut [f32]) {
    let (xx, xy, yy) = (&xx[..out.len()], &xy[..out.len()], &yy[..out.len()]);
    for x in 0..out.len() {
        let (a, b, c) = (xx[x], xy[x], yy[x]);
        out[x] = (a * c - b * b) / (a + c).max(f32::MIN_POSITIVE);
    }
}

/// Finds the maxima of the response within [`SUPPRESSION_RADIUS`] in `rows` of a level, sorted by rows. The outermost rows have none.
fn maxima(plane: &Plane, rows: Range<usize>, level: usize) -> Vec<Corner> {
    const R: usize = SUPPRESSION_RADIUS;
    let around = rows.start.saturating_sub(R)..(rows.end + R).min(plane.height());
    let (top, response) = (around.start, response(plane, around));
    let inner = R..response.width().saturating_sub(R);
    let in_row = |highest: &mut Vec<bool>, y: usize| {
        highest.resize(response.width(), false);
        are_highest([response.row(y - 1), response.row(y), response.row(y + 1)], highest);
        let found = inner.clone().filter(|x| highest[*x]);
        found.filter_map(|x| maximum_at(&response, (x, y), level, top)).collect::<Vec<_>>()
    };
    let rows = (R..response.height().saturating_sub(R)).into_par_iter();
    rows.map_init(Vec::new, in_row).flatten_iter().collect()
}

/// Which pixels of a row are high and no lower than those beside, above and below them. Most are no maximum already by that.
#[multiversion(targets("x86_64+avx512f+avx512dq+avx512bw+avx512vl+avx2", "x86_64+avx2"))]
fn are_highest([above, row, below]: [&[f32]; 3], highest: &mut [bool]) {
    let inner = row.len().saturating_sub(2);
    let (left, here, right) = (&row[..inner], &row[1..][..inner], &row[2..][..inner]);
    let (above, below, highest) = (&above[1..][..inner], &below[1..][..inner], &mut highest[1..][..inner]);
    for x in 0..inner {
        let centre = here[x];
        let beside = (right[x] <= centre) & (left[x] < centre);
        highest[x] = beside & (centre >= LEAST_STRENGTH) & (below[x] <= centre) & (above[x] < centre);
    }
}

/// The corner at (x, y), if the response is largest there and the quadratic through its neighbours peaks nearby. The first row of the
/// response is row `top` of the level.
fn maximum_at(response: &Plane, (x, y): (usize, usize), level: usize, top: usize) -> Option<Corner> {
    const R: usize = SUPPRESSION_RADIUS;
    let centre = response.at(x, y);
    // Of equal neighbours the first by rows counts as the maximum.
    let beaten = (y - R..=y + R).flat_map(|j| (x - R..=x + R).map(move |i| (i, j))).any(|(i, j)| {
        let other = response.at(i, j);
        other > centre || (other >= centre && (j, i) < (y, x))
    });
    if beaten {
        return None;
    }
    let at = |i: isize, j: isize| f64::from(response.at(x.wrapping_add_signed(i), y.wrapping_add_signed(j)));
    let (gx, gy) = (0.5 * (at(1, 0) - at(-1, 0)), 0.5 * (at(0, 1) - at(0, -1)));
    let (hxx, hyy) = (at(1, 0) + at(-1, 0) - 2.0 * at(0, 0), at(0, 1) + at(0, -1) - 2.0 * at(0, 0));
    let hxy = 0.25 * (at(1, 1) + at(-1, -1) - at(1, -1) - at(-1, 1));
    let det = hxx * hyy - hxy * hxy;
    let (dx, dy) = ((hxy * gy - hyy * gx) / det, (hxy * gx - hxx * gy) / det);
    let scale = (1_usize << level) as f64;
    (det > 0.0 && dx.abs() <= 1.0 && dy.abs() <= 1.0).then_some(Corner {
        keypoint: Keypoint { at: ViewPixel { x: (x as f64 + dx) * scale, y: ((top + y) as f64 + dy) * scale }, level },
        strength: centre,
    })
}

/// Takes `budget` corners: the strongest of every cell, then the second strongest, and so on.
fn spread(mut corners: Vec<Corner>, budget: usize) -> Vec<Corner> {
    let cell = |corner: &Corner| {
        let at = corner.keypoint.at;
        ((at.y / CELL) as usize, (at.x / CELL) as usize)
    };
    // The sort is stable, so that equal strengths stay in the order of rows.
    corners.sort_by(|p, q| cell(p).cmp(&cell(q)).then(q.strength.total_cmp(&p.strength)));
    let mut ranked: Vec<(usize, Corner)> =
        corners.chunk_by(|p, q| cell(p) == cell(q)).flat_map(|in_cell| in_cell.iter().copied().enumerate()).collect();
    ranked.sort_by(|(i, p), (j, q)| i.cmp(j).then(q.strength.total_cmp(&p.strength)));
    ranked.into_iter().take(budget).map(|(_, corner)| corner).collect()
}
