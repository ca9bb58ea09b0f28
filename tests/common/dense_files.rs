//! Ranges and sigmas of every pixel, read from the images that a command wrote, beside the truth.

use std::path::Path;

/// Pixels from the nearest edge of the scene from which no window of the dense search reaches it.
const FAR: i64 = 9;
/// Parallax in pixels of neighbours beyond which an edge lies between them.
const EDGE: f64 = 0.3;

/// Numbers of measured pixels, and shares of them within one and two sigma.
#[derive(Clone, Copy, Debug, Default)]
pub struct Within {
    pub pixels: usize,
    pub one: f64,
    pub two: f64,
}

/// What the images `dense-range.png` and `dense-sigma.png` of a folder say: all pixels, and those far from edges. `truth` has the ranges by rows in
/// millimetres, NaN where there is none; `parallax` is that of a pixel at a millimetre of range: baseline by focal length.
pub fn within_sigma(folder: &Path, truth: &[f64], parallax: f64) -> [Within; 2] {
    let read = |name: &str| image::open(folder.join(name)).expect("it is written").into_luma16();
    let (ranges, sigmas) = (read("dense-range.png"), read("dense-sigma.png"));
    let (width, height) = (i64::from(ranges.width()), i64::from(ranges.height()));
    let at = |x: i64, y: i64| {
        let inside = (0..width).contains(&x) && (0..height).contains(&y);
        if inside { truth[(y * width + x) as usize] } else { f64::NAN }
    };
    let is_edge = |x: i64, y: i64| {
        let jump = |other: f64| (parallax / at(x, y) - parallax / other).abs() > EDGE;
        jump(at(x + 1, y)) || jump(at(x, y + 1))
    };
    let edges: Vec<[i64; 2]> =
        (0..width * height).map(|i| [i % width, i / width]).filter(|[x, y]| is_edge(*x, *y)).collect();
    let mut near = vec![false; truth.len()];
    for [x, y] in edges {
        for row in (y - FAR + 1).max(0)..(y + FAR).min(height) {
            for column in (x - FAR + 1).max(0)..(x + FAR).min(width) {
                near[(row * width + column) as usize] = true;
            }
        }
    }
    // Whole millimetres and tenths of sigma.
    let measured = ranges.enumerate_pixels().filter(|(_, _, range)| !matches!(range.0[0], 0 | u16::MAX));
    let errors: Vec<(f64, bool)> = measured
        .map(|(u, v, range)| {
            let (index, sigma) = ((v * ranges.width() + u) as usize, f64::from(sigmas.get_pixel(u, v).0[0]) / 10.0);
            ((f64::from(range.0[0]) - truth[index]).abs() / sigma.hypot(0.3), near[index])
        })
        .filter(|(error, _)| !error.is_nan())
        .collect();
    [true, false].map(|with_edges| {
        let chosen: Vec<f64> = errors.iter().filter(|(_, near)| with_edges || !near).map(|(error, _)| *error).collect();
        let share = |most: f64| chosen.iter().filter(|z| **z <= most).count() as f64 / chosen.len().max(1) as f64;
        Within { pixels: chosen.len(), one: share(1.0), two: share(2.0) }
    })
}
