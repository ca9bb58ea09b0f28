//! Outliers among the corners: unlike the others, or not where a smooth image of a target has them.

use vergence_vision::{KannalaBrandt, median};

use super::CornerQuality;
use super::lattice::{Lattice, Node};
use super::predict::Predictor;

/// Flags bad corners, by their grey levels and by their position.
pub fn flag(lattice: &mut Lattice, hint: Option<&KannalaBrandt>) {
    flag_unclear(lattice);
    flag_misplaced(lattice, hint);
}

/// Flags corners whose standard deviation is far above that of nearby corners; only nearby, since sharpness varies over
/// the image.
fn flag_unclear(lattice: &mut Lattice) {
    // On 79 real photographs the greatest is 1.6 times the image's median.
    const MEDIANS: f64 = 1.8;
    const REACH: i32 = 2;
    let usual = |node: Node| median(lattice.around(node, REACH).map(|(_, found)| found.sigma_px).collect());
    let unclear: Vec<Node> = lattice
        .iter()
        .filter(|(_, found)| found.quality == CornerQuality::Good)
        .filter(|(node, found)| usual(**node).is_some_and(|usual| found.sigma_px > MEDIANS * usual))
        .map(|(&node, _)| node)
        .collect();
    for node in unclear {
        if let Some(found) = lattice.get_mut(node) {
            found.quality = CornerQuality::Blunder;
        }
    }
}

/// Flags corners that are much further from their prediction than the others, the worst first: one wrong corner spoils
/// the predictions of its neighbours, which are repeated without it.
fn flag_misplaced(lattice: &mut Lattice, hint: Option<&KannalaBrandt>) {
    // In multiples of the median error. The worst good corner of 79 real photographs, near and strongly curved targets
    // among them, is 7.9 off where the image curves most, 4 elsewhere.
    const MEDIANS: f64 = 10.0;
    const LEAST_PART_OF_CELL: f64 = 0.03;
    for _ in 0..lattice.len() {
        let errors = errors(lattice, &Predictor::new(lattice, hint));
        let scale = MEDIANS * median(errors.iter().map(|error| error.normalised).collect()).unwrap_or(0.0);
        let worst = errors
            .iter()
            .filter(|error| error.normalised > scale && error.part_of_cell > LEAST_PART_OF_CELL)
            .max_by(|a, b| a.normalised.total_cmp(&b.normalised));
        let Some(found) = worst.and_then(|error| lattice.get_mut(error.node)) else { return };
        found.quality = CornerQuality::Blunder;
    }
}

struct Error {
    node: Node,
    /// Distance to the prediction in its standard deviations, up to a common factor.
    normalised: f64,
    /// Distance from the predicted position as a part of the cell's side.
    part_of_cell: f64,
}

fn errors(lattice: &Lattice, predictor: &Predictor<'_>) -> Vec<Error> {
    let good = lattice.iter().filter(|(_, found)| found.quality != CornerQuality::Blunder);
    good.filter_map(|(&node, found)| {
        let expected = predictor.predict(lattice, node)?;
        let distance = (found.position - expected.position).norm();
        Some(Error {
            node,
            normalised: distance / (1.0 + expected.variance).sqrt(),
            part_of_cell: distance / expected.spacing(),
        })
    })
    .collect()
}
