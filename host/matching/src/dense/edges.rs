//! Steps between surfaces: by how much a pixel may be off because another surface is in its window.
//!
//! The windows of the search spread a near surface by some pixels over the farther one beside it, above all where the
//! right camera does not see the latter, and of small steps they make a mixture.

use multiversion::multiversion;
use rayon::prelude::*;

use super::levels::filled;
use super::window::BAND;
use crate::pool::memory;

/// The reach of the windows in pixels.
const WINDOW: usize = 4;
/// The part of a step, in pixels, that the roughness of one surface makes.
const ROUGHNESS: f32 = 0.25;

/// The step in disparity to another surface in the window of each pixel, in pixels, negative to a farther one; NaN without a disparity.
///
/// On a plane the largest disparity of a window is as far above that of its middle as the least one is below. Beside a step it is not, by
/// the height of the step. `disparities` are NaN where there are none; gaps that the left camera sees count as the farther of the surfaces
/// beside them on their row.
pub(super) fn steps(disparities: &[f32], seen: &[bool], width: usize) -> Vec<f32> {
    let height = disparities.len() / width;
    let mut steps = memory(disparities.len());
    steps.par_chunks_mut(BAND * width).enumerate().for_each(|(band, steps)| {
        let top = band * BAND;
        let rows = top.saturating_sub(WINDOW)..(top + steps.len() / width + WINDOW).min(height);
        let along: Vec<[Vec<f32>; 2]> = rows
            .clone()
            .map(|y| extremes_along(&filled(&disparities[y * width..][..width]), &seen[y * width..][..width]))
            .collect();
        for (y, steps) in (top..).zip(steps.chunks_exact_mut(width)) {
            let window = &along[y.saturating_sub(WINDOW) - rows.start..(y + WINDOW + 1).min(height) - rows.start];
            steps_of_row(steps, &disparities[y * width..][..width], window);
        }
    });
    steps
}

/// The least and the largest value of each window along a row; infinite where nothing in it is seen.
fn extremes_along(values: &[f32], seen: &[bool]) -> [Vec<f32>; 2] {
    [(f32::INFINITY, smaller as fn(&mut [f32], usize)), (f32::NEG_INFINITY, larger)].map(|(none, spread)| {
        let mut padded = vec![none; values.len() + 2 * WINDOW];
        for ((padded, value), _) in padded[WINDOW..].iter_mut().zip(values).zip(seen).filter(|(_, seen)| **seen) {
            *padded = *value;
        }
        // Of 2, 4, 8 and 9 neighbours.
        for step in [1, 2, 4, 1] {
            spread(&mut padded, step);
        }
        padded.truncate(values.len());
        padded
    })
}

/// Takes the smaller one of each value and the one that is `step` behind it.
#[multiversion(targets("x86_64+avx512f+avx512dq+avx512vl+avx2+fma", "x86_64+avx2+fma"))]
fn smaller(values: &mut [f32], step: usize) {
    for x in 0..values.len() - step {
        values[x] = if values[x + step] < values[x] { values[x + step] } else { values[x] };
    }
}

/// Takes the larger one of each value and the one that is `step` behind it.
#[multiversion(targets("x86_64+avx512f+avx512dq+avx512vl+avx2+fma", "x86_64+avx2+fma"))]
fn larger(values: &mut [f32], step: usize) {
    for x in 0..values.len() - step {
        values[x] = if values[x + step] > values[x] { values[x + step] } else { values[x] };
    }
}

/// The steps of a row from its own disparities and the extremes along the rows of its windows.
#[multiversion(targets("x86_64+avx512f+avx512dq+avx512vl+avx2+fma", "x86_64+avx2+fma"))]
fn steps_of_row(steps: &mut [f32], disparities: &[f32], window: &[[Vec<f32>; 2]]) {
    let mut extremes = [vec![f32::INFINITY; steps.len()], vec![f32::NEG_INFINITY; steps.len()]];
    for [least, most] in window {
        let [lowest, highest] = &mut extremes;
        lowest
            .iter_mut()
            .zip(least)
            .for_each(|(lowest, least)| *lowest = if *least < *lowest { *least } else { *lowest });
        highest
            .iter_mut()
            .zip(most)
            .for_each(|(highest, most)| *highest = if *most > *highest { *most } else { *highest });
    }
    let [lowest, highest] = &extremes;
    for (((step, own), least), most) in steps.iter_mut().zip(disparities).zip(lowest).zip(highest) {
        let height = (most - own) - (own - least);
        // What is not seen has no disparity, and NaN remains.
        let beyond = (height.abs() - ROUGHNESS).max(0.0);
        *step = if height.is_nan() { f32::NAN } else { beyond.copysign(height) };
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const WIDTH: usize = 24;

    fn found(row: impl Fn(usize) -> f32) -> Vec<f32> {
        let disparities: Vec<f32> = (0..5 * WIDTH).map(|index| row(index % WIDTH)).collect();
        steps(&disparities, &[true; 5 * WIDTH], WIDTH)
    }

    /// A near surface beside a far one, with a gap of four columns between them, which counts as the farther surface.
    #[test]
    fn a_window_across_a_step_has_its_height() {
        let row = |x: usize| match x {
            0..10 => 20.0,
            10..14 => f32::NAN,
            _ => 5.0,
        };
        for (index, step) in found(row).iter().enumerate() {
            let expected = match index % WIDTH {
                6..=9 => -15.0 + ROUGHNESS,
                10..14 => f32::NAN,
                _ => 0.0,
            };
            let agrees = (step - expected).abs() < 1e-5 || step.is_nan() && expected.is_nan();
            assert!(agrees, "column {}: {step}", index % WIDTH);
        }
    }

    #[test]
    fn a_slanted_plane_has_no_step() {
        let found = found(|x| 10.0 + 0.5 * x as f32);
        // Beside the border of the view half of the window is missing.
        let inside = found.iter().enumerate().filter(|(index, _)| (WINDOW..WIDTH - WINDOW).contains(&(index % WIDTH)));
        inside.for_each(|(index, step)| assert!(step.abs() < 1e-6, "{index}: {step}"));
    }
}
