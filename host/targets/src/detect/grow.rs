//! Finds corners that the search missed, mostly along the border of the target.

use std::collections::BTreeSet;

use nalgebra::Vector2;
use vergence_vision::KannalaBrandt;

use super::CornerQuality;
use super::intensity::Intensity;
use super::lattice::{Found, Lattice, Node, SIDES};
use super::predict::{Prediction, Predictor};
use super::refine::refine;
use super::saddle::{Quadrants, contrast_near, parity, polarity};

/// The neighbouring corners are a cell away; anything further off than this part of it is not the one predicted.
const FARTHEST_PART: f64 = 0.35;
/// Part of that within which no cell of a marker looks like a corner.
const TO_MARKERS: f64 = 0.6;

/// Adds corners next to those known until no more are found. `size` is that of the target in corners; one more row and
/// column are searched, so that a larger target is noticed.
pub fn grow(lattice: &mut Lattice, image: &Intensity<'_>, hint: Option<&KannalaBrandt>, size: [u32; 2]) {
    let longest = size[0].max(size[1]).cast_signed() + 1;
    lattice.drop_loose();
    loop {
        let predictor = Predictor::new(lattice, hint);
        let polarity = polarity(lattice, image, &predictor).signum();
        let Some([low, high]) = lattice.bounds() else { return };
        let within = |node: Node| (0..2).all(|a| high[a].max(node[a]) - low[a].min(node[a]) < longest);
        let candidates: BTreeSet<Node> = lattice
            .iter()
            .flat_map(|(&[i, j], _)| [[i - 1, j], [i + 1, j], [i, j - 1], [i, j + 1]])
            .filter(|&node| lattice.get(node).is_none() && within(node))
            .collect();
        // All candidates of a round are judged by the same lattice: their order does not matter.
        let found: Vec<(Node, Found)> = candidates
            .into_iter()
            .filter_map(|node| {
                let expected = predictor.predict(lattice, node)?;
                let close = expected.within(lattice.clear);
                let contrast = contrast_near(lattice, image, node, &close.steps);
                let colour = polarity * parity(node);
                // As far as the cells of a marker, whatever part of a step is clear.
                let farthest = expected.spacing() * FARTHEST_PART * lattice.clear.max(TO_MARKERS);
                let corner = find(image, &close, colour, contrast, farthest)?;
                edges_reach(lattice, image, node, corner.position, &close.steps, colour * contrast)
                    .then_some((node, corner))
            })
            .collect();
        let before = lattice.len();
        for (node, corner) in found {
            lattice.insert(node, corner);
        }
        lattice.drop_loose();
        if lattice.len() <= before {
            return;
        }
    }
}

/// The corner up to `farthest` pixels from a prediction whose saddle has the sign `colour`; `None` if there is none as clear as its
/// neighbours, whose contrast is given.
fn find(image: &Intensity<'_>, expected: &Prediction, colour: f64, contrast: f64, farthest: f64) -> Option<Found> {
    const LEAST_PART_OF_CONTRAST: f64 = 0.4;
    const SMALLEST_CELL_PX: f64 = 4.0;
    let spacing = expected.spacing();
    if spacing.is_nan() || spacing < SMALLEST_CELL_PX || image.margin(expected.position) < 0.0 {
        return None;
    }
    let start = strongest_saddle(image, expected, colour, farthest)?;
    // Overexposed white erodes the corners of large black squares and moves the strongest saddle aside.
    let refined = refine(image, start, expected).or_else(|| refine(image, expected.position, expected))?;
    let quadrants = Quadrants::read(image, refined.position, &expected.steps)?;
    let near = (refined.position - expected.position).norm() <= farthest;
    let clear = quadrants.is_corner(LEAST_PART_OF_CONTRAST * contrast) && quadrants.saddle() * colour > 0.0;
    (near && clear).then_some(Found {
        position: refined.position,
        sigma_px: refined.sigma_px,
        filled: true,
        quality: CornerQuality::Good,
    })
}

/// Whether black meets white all along the edges between a corner at `node` and its neighbours in the lattice.
/// `saddle` is the corner's, with its sign: at the end of a sheet cut through its squares the edges stop halfway.
fn edges_reach(
    lattice: &Lattice,
    image: &Intensity<'_>,
    node: Node,
    corner: Vector2<f64>,
    steps: &[Vector2<f64>; 2],
    saddle: f64,
) -> bool {
    const ALONG: [f64; 4] = [0.15, 0.35, 0.55, 0.75];
    const ASIDE: f64 = 0.2;
    const LEAST_PART: f64 = 0.3;
    SIDES.iter().all(|&[di, dj]| {
        let Some(neighbour) = lattice.get([node[0] + di, node[1] + dj]) else { return true };
        let aside = ASIDE * if di == 0 { steps[0] } else { steps[1] };
        let expected = LEAST_PART * saddle * f64::from(di + dj);
        ALONG.iter().all(|part| {
            let place = corner + *part * (neighbour.position - corner);
            let step = image.between(place + aside).zip(image.between(place - aside));
            step.is_some_and(|(ahead, behind)| (ahead - behind) * expected.signum() > expected.abs())
        })
    })
}

/// The place up to `radius` from the prediction, in whole pixels, with the strongest saddle.
fn strongest_saddle(image: &Intensity<'_>, expected: &Prediction, colour: f64, radius: f64) -> Option<Vector2<f64>> {
    let reach = radius.floor() as i32;
    let side = (2 * reach + 1).unsigned_abs() as usize;
    let mut saddles = vec![0.0; side * side];
    for (offset, part) in Quadrants::close_saddle(&expected.steps) {
        image.add_around(expected.position + offset, colour * part, reach, &mut saddles);
    }
    let offsets =
        (-reach..=reach).flat_map(|y| (-reach..=reach).map(move |x| Vector2::new(f64::from(x), f64::from(y))));
    let mut best: Option<(f64, Vector2<f64>)> = None;
    for (saddle, offset) in saddles.into_iter().zip(offsets).filter(|(_, offset)| offset.norm() <= radius) {
        // Not a number where it needs pixels outside the image.
        if !saddle.is_nan() && best.is_none_or(|(strongest, _)| saddle > strongest) {
            best = Some((saddle, expected.position + offset));
        }
    }
    best.map(|(_, place)| place)
}
