//! Edges of surfaces: where a pixel may belong to another surface than its disparity says.
//!
//! The windows of the search spread a near surface by some pixels over the farther one beside it, above all where the
//! right camera does not see the latter. What is that close to a farther surface is doubtful.

use rayon::prelude::*;

use super::levels::filled;

/// Difference in disparity, in pixels, from which neighbours are of different surfaces.
const STEP: f32 = 1.5;
/// Distances in pixels, to a farther and to a nearer surface, that count as close.
const CLOSE: [usize; 2] = [2, 1];
/// The reach of the windows in pixels.
const WINDOW: usize = 4;

/// Difference in disparity, in pixels, from which a pixel with another surface in its window may be that surface's: of smaller steps the
/// registration makes a mixture, whose error is within its standard deviation.
const WIDE_STEP: f32 = 5.0;

/// The other surfaces around a pixel.
#[derive(Clone, Copy, Debug)]
pub(super) struct Around {
    /// How near they are.
    pub beside: Beside,
    /// The disparity of the surface in the window that the pixel may belong to, the farther one where there are two; NaN where there is none.
    pub other: f32,
}

/// How near another surface is to a pixel.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Beside {
    /// A farther surface is the next pixel's.
    Edge,
    /// Another surface is close.
    Close,
    /// Another surface is in the window.
    Near,
    /// No other surface is near.
    Nothing,
}

/// Finds the other surfaces around each pixel. Disparities are NaN where there are none; gaps that the left camera sees
/// count as the farther of the surfaces beside them on their row.
pub(super) fn beside(disparities: &[f32], seen: &[bool], width: usize) -> Vec<Around> {
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
    let least = |reach| extremes(&surfaces, width, reach, f32::min);
    let most = |reach| extremes(&surfaces, width, reach, f32::max);
    let adjacent = least(1);
    let (behind, before) = ([least(CLOSE[0]), least(WINDOW)], [most(CLOSE[1]), most(WINDOW)]);
    (0..disparities.len())
        .into_par_iter()
        .map(|index| {
            let own = disparities[index];
            let is_behind = |surfaces: &[f32]| surfaces[index] < own - STEP;
            let is_other = |i: usize| is_behind(&behind[i]) || before[i][index] > own + STEP;
            let beside = if is_behind(&adjacent) {
                Beside::Edge
            } else if is_other(0) {
                Beside::Close
            } else if is_other(1) {
                Beside::Near
            } else {
                Beside::Nothing
            };
            let [farthest, nearest] = [behind[1][index], before[1][index]];
            let other = if farthest < own - WIDE_STEP {
                farthest
            } else if nearest > own + WIDE_STEP {
                nearest
            } else {
                f32::NAN
            };
            Around { beside, other }
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

    /// A near surface beside a far one, with a gap of four columns between them.
    #[test]
    fn a_gap_counts_as_the_farther_surface() {
        let row = |x: usize| match x {
            0..10 => 20.0,
            10..14 => f32::NAN,
            _ => 5.0,
        };
        let disparities: Vec<f32> = (0..5 * 24).map(|index| row(index % 24)).collect();
        let found = beside(&disparities, &[true; 5 * 24], 24);
        for (index, around) in found.iter().enumerate() {
            let (expected, other) = match index % 24 {
                9 => (Beside::Edge, 5.0),
                8 => (Beside::Close, 5.0),
                6 | 7 => (Beside::Near, 5.0),
                10..14 => continue,
                _ => (Beside::Nothing, f32::NAN),
            };
            assert_eq!(around.beside, expected, "column {}", index % 24);
            assert_eq!(around.other.to_bits(), other.to_bits(), "column {}", index % 24);
        }
    }
}
