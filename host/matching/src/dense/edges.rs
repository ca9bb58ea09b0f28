//! Steps between surfaces: by how much a pixel may be off because another surface is in its window.
//!
//! The windows of the search spread a near surface by some pixels over the farther one beside it, above all where the
//! right camera does not see the latter, and of small steps they make a mixture.

use rayon::prelude::*;

use super::levels::filled;

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
    let mut surfaces = vec![f32::NAN; disparities.len()];
    surfaces.par_chunks_mut(width).zip(disparities.par_chunks(width)).zip(seen.par_chunks(width)).for_each(
        |((surfaces, disparities), seen)| {
            for ((surface, filled), _) in
                surfaces.iter_mut().zip(filled(disparities)).zip(seen).filter(|(_, seen)| **seen)
            {
                *surface = filled;
            }
        },
    );
    let [least, most] = [f32::min, f32::max].map(|choose| extremes(&surfaces, width, WINDOW, choose));
    let ends = least.par_iter().zip(&most).zip(disparities);
    ends.map(|((least, most), own)| {
        let step = (most - own) - (own - least);
        step.signum() * (step.abs() - ROUGHNESS).max(0.0)
    })
    .collect()
}

/// The least or the largest value, by `choose`, within `reach` pixels in each direction; NaN counts as no value.
fn extremes(values: &[f32], width: usize, reach: usize, choose: impl Fn(f32, f32) -> f32 + Sync) -> Vec<f32> {
    let mut along = vec![f32::NAN; values.len()];
    along.par_chunks_mut(width).zip(values.par_chunks(width)).for_each(|(along, row)| {
        along.copy_from_slice(row);
        for step in 1..=reach.min(width - 1) {
            along.iter_mut().zip(&row[step..]).for_each(|(chosen, other)| *chosen = choose(*chosen, *other));
            along[step..].iter_mut().zip(row).for_each(|(chosen, other)| *chosen = choose(*chosen, *other));
        }
    });
    let height = values.len() / width;
    let mut chosen = vec![f32::NAN; values.len()];
    chosen.par_chunks_mut(width).enumerate().for_each(|(y, chosen)| {
        for other in y.saturating_sub(reach)..(y + reach + 1).min(height) {
            let row = &along[other * width..][..width];
            chosen.iter_mut().zip(row).for_each(|(chosen, other)| *chosen = choose(*chosen, *other));
        }
    });
    chosen
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
