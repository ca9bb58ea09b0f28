//! The lens's point spread, applied to an image row by row, for images in real time.

use multiversion::multiversion;

use crate::blur::{SPOT_STEPS, add_numbers, discrete_gaussian, extremes};
use crate::quick_canvas::Canvas;

/// The weights of [`spread`](crate::blur::spread).
pub struct Spread {
    /// From the narrowest spot to the widest.
    steps: Vec<SpreadStep>,
}

/// One Gaussian, and the spots that it is for.
struct SpreadStep {
    /// At the distances 0, 1, 2, … pixels.
    weights: Vec<f32>,
    /// The spot, and the least and the most of them; their distance from step to step. `None` where all are alike.
    spot: Option<[f32; 4]>,
}

impl Spread {
    /// As [`spread`](crate::blur::spread) takes them.
    pub fn new(sigma: f64, spots: &[f32]) -> Self {
        let (low, high) = extremes(spots);
        let step = (high - low) / SPOT_STEPS as f32;
        if high == 0.0 || step == 0.0 {
            let weights = discrete_gaussian(sigma.mul_add(sigma, f64::from(high)).sqrt());
            return Self { steps: vec![SpreadStep { weights, spot: None }] };
        }
        let of_step = |number: usize| {
            let at = low + step * number as f32;
            let weights = discrete_gaussian(sigma.mul_add(sigma, f64::from(at)).sqrt());
            SpreadStep { weights, spot: Some([at, low, high, step]) }
        };
        Self { steps: (0..=SPOT_STEPS).map(of_step).collect() }
    }
}

/// Rows that are made again and again.
#[derive(Debug, Default)]
pub struct SpreadRows {
    /// Spread up and down, and then also to the sides.
    down: Vec<f32>,
    both: Vec<f32>,
    /// The light of a row of the image, spread.
    pub light: Vec<f32>,
}

impl Spread {
    /// One channel of row `y` of an image that is exposed like this, with each pixel spread over its neighbours, as the `spots` of that row say.
    /// Beyond the image there is no light.
    pub fn row(
        &self,
        (canvas, exposures): (&Canvas, &[f32]),
        (channel, y): (usize, usize),
        spots: &[f32],
        rows: &mut SpreadRows,
    ) {
        let row = |y: usize| (canvas.light(channel, y), &exposures[y * canvas.width()..]);
        let SpreadRows { down, both, light } = rows;
        clear(light, canvas.width());
        for SpreadStep { weights, spot } in &self.steps {
            clear(down, light.len());
            add_exposed(down, weights[0], row(y));
            for (distance, &weight) in weights.iter().enumerate().skip(1) {
                let sides = [y.checked_sub(distance), Some(y + distance).filter(|&y| y < canvas.height())];
                sides.into_iter().flatten().for_each(|y| add_exposed(down, weight, row(y)));
            }
            clear(both, light.len());
            add_numbers(both, weights[0], down);
            for (distance, &weight) in weights.iter().enumerate().take(down.len()).skip(1) {
                add_numbers(&mut both[distance..], weight, down);
                add_numbers(both, weight, &down[distance..]);
            }
            match spot {
                None => std::mem::swap(light, both),
                Some(spot) => add_shares(light, both, spots, *spot),
            }
        }
    }
}

/// Makes a row dark.
fn clear(row: &mut Vec<f32>, width: usize) {
    row.clear();
    row.resize(width, 0.0);
}

/// Adds a row times `weight`, each number by its exposure, by the instructions of this machine: the same numbers on all.
#[multiversion(targets("x86_64+avx512f+avx512dq+avx512vl+avx2", "x86_64+avx2"))]
fn add_exposed(sum: &mut [f32], weight: f32, (row, exposures): (&[f32], &[f32])) {
    let count = sum.len().min(row.len()).min(exposures.len());
    let (sum, row, exposures) = (&mut sum[..count], &row[..count], &exposures[..count]);
    for i in 0..count {
        sum[i] += weight * (row[i] * exposures[i]);
    }
}

/// Adds light that is spread by one Gaussian, as much of it as the pixels' spots are of this one.
fn add_shares(sum: &mut [f32], light: &[f32], spots: &[f32], [at, low, high, step]: [f32; 4]) {
    for (sum, (light, spot)) in sum.iter_mut().zip(light.iter().zip(spots)) {
        let steps_off = (spot.clamp(low, high) - at).abs() / step;
        *sum += (1.0 - steps_off).max(0.0) * light;
    }
}
