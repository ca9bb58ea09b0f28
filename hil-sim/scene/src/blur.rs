//! The lens's point spread, applied to the linear image.

use multiversion::multiversion;
use rayon::prelude::*;

/// Widest point spread of a lens, in pixels.
const MAX_SIGMA_PX: f64 = 5.0;

/// Convolves an image of rows of `width` pixels of `N` channels with the discrete Gaussian of deviation `sigma` px. Beyond
/// the image there is no light.
pub fn blurred<const N: usize>(image: &[[f32; N]], width: usize, sigma: f64) -> Vec<[f32; N]> {
    let weights = discrete_gaussian(sigma);
    let (width, height) = (width.max(1), image.len() / width.max(1));
    let mut across = vec![[0.0; N]; image.len()];
    across.par_chunks_exact_mut(width).zip(image.par_chunks_exact(width)).for_each(|(out, row)| {
        add(out, weights[0], row);
        for (distance, &weight) in weights.iter().enumerate().take(width).skip(1) {
            add(&mut out[distance..], weight, row);
            add(out, weight, &row[distance..]);
        }
    });
    let mut both = vec![[0.0; N]; image.len()];
    both.par_chunks_exact_mut(width).enumerate().for_each(|(y, out)| {
        let row = |y: usize| &across[y * width..(y + 1) * width];
        add(out, weights[0], row(y));
        for (distance, &weight) in weights.iter().enumerate().skip(1) {
            let sides = [y.checked_sub(distance), Some(y + distance).filter(|&y| y < height)];
            sides.into_iter().flatten().for_each(|y| add(out, weight, row(y)));
        }
    });
    both
}

/// Steps from the narrowest to the widest spot of an image; between them it is interpolated, which is exact in the variance.
pub const SPOT_STEPS: usize = 4;

/// Convolves an image as [`blurred`] does, with a Gaussian whose variance in square pixels is that of `sigma` plus that of the pixel's spot.
pub fn spread<const N: usize>(image: &[[f32; N]], width: usize, sigma: f64, spots: &[f32]) -> Vec<[f32; N]> {
    let (low, high) = extremes(spots);
    if high == 0.0 {
        return blurred(image, width, sigma);
    }
    let step = (high - low) / SPOT_STEPS as f32;
    let mut sum = vec![[0.0; N]; image.len()];
    for number in 0..=SPOT_STEPS {
        let at = low + step * number as f32;
        let of_step = blurred(image, width, sigma.mul_add(sigma, f64::from(at)).sqrt());
        sum.par_iter_mut().zip(of_step.par_iter().zip(spots)).for_each(|(sum, (light, spot))| {
            let steps_off = if step > 0.0 { (spot.clamp(low, high) - at).abs() / step } else { number as f32 };
            let weight = (1.0 - steps_off).max(0.0);
            for (sum, light) in sum.iter_mut().zip(light) {
                *sum += weight * light;
            }
        });
    }
    sum
}

/// The least and the most of the spots that there are.
pub fn extremes(spots: &[f32]) -> (f32, f32) {
    let lit = spots.iter().copied().filter(|spot| *spot > 0.0);
    lit.fold((f32::INFINITY, 0.0), |(low, high): (f32, f32), spot| (low.min(spot), high.max(spot)))
}

/// Adds `row` times `weight` as far as both reach. Whole rows let the compiler use vector instructions.
fn add<const N: usize>(sum: &mut [[f32; N]], weight: f32, row: &[[f32; N]]) {
    add_numbers(sum.as_flattened_mut(), weight, row.as_flattened());
}

/// [`add`] by the instructions of this machine: the same numbers on all.
#[multiversion(targets("x86_64+avx512f+avx512dq+avx512vl+avx2", "x86_64+avx2"))]
pub fn add_numbers(sum: &mut [f32], weight: f32, row: &[f32]) {
    let count = sum.len().min(row.len());
    let (sum, row) = (&mut sum[..count], &row[..count]);
    for i in 0..count {
        sum[i] += weight * row[i];
    }
}

/// Weights at the distances 0, 1, 2, … of the discrete Gaussian exp(-t) In(t), t = sigma², whose variance is exactly
/// sigma² on the pixel grid (T. Lindeberg, "Scale-space for discrete signals", PAMI 12(3), 1990, eq. 19).
pub fn discrete_gaussian(sigma: f64) -> Vec<f32> {
    const NEGLIGIBLE: f64 = 1e-6;
    const TERMS: u32 = 80;
    let t = sigma.clamp(0.0, MAX_SIGMA_PX).powi(2);
    let t = if t.is_nan() { 0.0 } else { t };
    // In(t) = sum over k of (t/2)^(2k+n) / (k! (k+n)!).
    let weight = |n: u32| {
        let mut term = (1..=n).fold((-t).exp(), |product, i| product * 0.5 * t / f64::from(i));
        let mut sum = term;
        for k in 1..TERMS {
            term *= 0.25 * t * t / (f64::from(k) * f64::from(k + n));
            sum += term;
        }
        sum
    };
    let weights: Vec<f64> = (0..).map(weight).take_while(|&w| w > NEGLIGIBLE).collect();
    let total = weights[0] + 2.0 * weights[1..].iter().sum::<f64>();
    weights.into_iter().map(|w| (w / total) as f32).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_spread_has_the_stated_variance() {
        for sigma in [0.0, 0.2, 0.5, 1.0, 2.5, 5.0] {
            let weights = discrete_gaussian(sigma);
            let moment = |power: i32| {
                let side = |(i, w): (usize, &f32)| 2.0 * (i as f64).powi(power) * f64::from(*w);
                weights.iter().enumerate().skip(1).map(side).sum::<f64>()
            };
            assert!((f64::from(weights[0]) + moment(0) - 1.0).abs() < 1e-6);
            assert!((moment(2) - sigma * sigma).abs() < 2e-3 * sigma * sigma + 1e-9, "{} at {sigma}", moment(2));
        }
    }

    /// Points whose spots differ, each far from the next: each is as wide as stated, and keeps its light.
    #[test]
    fn a_spot_has_the_variance_of_its_place() {
        const SIDE: usize = 61;
        for (column, spot) in [(10, 0.1_f32), (30, 0.35), (50, 0.93)] {
            let mut image = vec![[0.0]; SIDE * SIDE];
            image[30 * SIDE + column] = [1.0];
            let spots: Vec<f32> = (0..SIDE * SIDE)
                .map(|i| match i % SIDE {
                    ..20 => 0.1,
                    20..40 => 0.35,
                    _ => 0.93,
                })
                .collect();
            let soft = spread(&image, SIDE, 0.5, &spots);
            let moment = |power: i32| {
                let along = |(i, [light]): (usize, &[f32; 1])| {
                    ((i % SIDE) as f64 - column as f64).powi(power) * f64::from(*light)
                };
                soft.iter().enumerate().map(along).sum::<f64>()
            };
            assert!((moment(0) - 1.0).abs() < 1e-3 && moment(1).abs() < 1e-3, "{}", moment(0));
            assert!((moment(2) - 0.25 - f64::from(spot)).abs() < 0.01, "{} at {spot}", moment(2));
        }
    }

    #[test]
    fn a_point_is_spread_evenly_to_all_sides() {
        let mut image = vec![[0.0; 3]; 11 * 9];
        image[4 * 11 + 5] = [1.0, 2.0, 0.5];
        let soft = blurred(&image, 11, 0.7);
        for (i, pixel) in soft.iter().enumerate() {
            let (x, y) = (i % 11, i / 11);
            let same = |other: [f32; 3]| pixel.iter().zip(other).all(|(a, b)| (a - b).abs() < 1e-6);
            assert!(same(soft[y * 11 + (10 - x)]) && same(soft[(8 - y) * 11 + x]), "({x}, {y})");
        }
        assert!((soft.iter().map(|pixel| pixel[1]).sum::<f32>() - 2.0).abs() < 1e-4);
    }
}
