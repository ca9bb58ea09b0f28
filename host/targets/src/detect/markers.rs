//! Where on a ChArUco board a lattice of corners lies, by the markers in its white squares.

use std::collections::BTreeMap;

use nalgebra::Vector2;
use vergence_vision::KannalaBrandt;

use super::DetectError;
use super::intensity::Intensity;
use super::lattice::{Lattice, Node};
use super::predict::Predictor;
use super::saddle::{contrast_near, parity, polarity};
use super::tags::{Quad, TagPlace, read_tag};
use crate::charuco::{CharucoSpec, MARKER_BORDER};
use crate::labelling::{Relabelling, turned};

/// A lattice whose squares are read.
struct Board<'a> {
    lattice: &'a Lattice,
    image: &'a Intensity<'a>,
    predictor: Predictor<'a>,
    spec: &'a CharucoSpec,
}

/// The change from the nodes of `lattice` to columns and rows of the inner corners of `spec`, on which the markers that are
/// read agree.
///
/// # Errors
/// [`DetectError::NoMarkers`] where fewer than two agree, or half as many on something else: a single marker may be read
/// wrongly.
pub fn place(
    lattice: &Lattice,
    image: &Intensity<'_>,
    hint: Option<&KannalaBrandt>,
    spec: &CharucoSpec,
) -> Result<Relabelling, DetectError> {
    const FEWEST: usize = 2;
    let board = Board { lattice, image, predictor: Predictor::new(lattice, hint), spec };
    let mut votes: BTreeMap<Relabelling, usize> = BTreeMap::new();
    for way in board.white_squares().filter_map(|square| board.read(square)) {
        *votes.entry(way).or_default() += 1;
    }
    let best = votes.iter().max_by_key(|(_, count)| **count);
    let others = |best: &Relabelling| votes.iter().filter(|(way, _)| *way != best).map(|(_, count)| *count).max();
    let agreed = best.filter(|(way, count)| **count >= FEWEST.max(2 * others(way).unwrap_or(0) + 1));
    agreed.map(|(way, _)| *way).ok_or_else(|| DetectError::NoMarkers {
        corners: lattice.len(),
        read: votes.values().sum(),
        dictionary: spec.dictionary.name,
    })
}

impl Board<'_> {
    /// The least nodes of the white squares that have two corners in the lattice at least.
    fn white_squares(&self) -> impl Iterator<Item = Node> + '_ {
        let white = polarity(self.lattice, self.image, &self.predictor).signum();
        let squares = self.lattice.bounds().into_iter().flat_map(|[low, high]| {
            (low[0] - 1..=high[0]).flat_map(move |i| (low[1] - 1..=high[1]).map(move |j| [i, j]))
        });
        squares.filter(move |&square| {
            let seen = corners_of(square).into_iter().filter(|node| self.lattice.get(*node).is_some()).count();
            seen >= 2 && parity(square) * white > 0.0
        })
    }

    /// The change of labels that the marker in a square tells.
    fn read(&self, square: Node) -> Option<Relabelling> {
        let place = TagPlace { border: MARKER_BORDER, margin: self.spec.margin() };
        let own = read_tag(self.image, &self.quad(square)?, &self.spec.dictionary, place, self.spec.markers())?;
        let [column, row] = self.spec.place(own.id)?.map(u32::cast_signed);
        // The corner at the marker's own upper left, and the one to its right.
        let mut corners = corners_of(square);
        corners.rotate_left(own.quarters);
        let [first, second, ..] = corners;
        let right = [second[0] - first[0], second[1] - first[1]];
        let quarters = (0..4).find(|quarters| turned(right, *quarters) == [1, 0])?;
        let [i, j] = turned(first, quarters);
        Some(Relabelling { quarters, shift: [column - 1 - i, row - 1 - j] })
    }

    /// A square as it lies in the image.
    fn quad(&self, square: Node) -> Option<Quad> {
        let [a, b, c, d] = corners_of(square);
        let corners = [self.at(a)?, self.at(b)?, self.at(c)?, self.at(d)?];
        let bows = [self.bow(a, b)?, self.bow(b, c)?, self.bow(c, d)?, self.bow(d, a)?];
        let contrast = corners_of(square).into_iter().find_map(|node| {
            let steps = self.predictor.predict(self.lattice, node)?.within(self.lattice.clear).steps;
            Some(contrast_near(self.lattice, self.image, node, &steps)).filter(|contrast| *contrast > 0.0)
        })?;
        Some(Quad { corners, bows, contrast })
    }

    /// Where a corner is, or is expected.
    fn at(&self, node: Node) -> Option<Vector2<f64>> {
        let found = self.lattice.get(node).map(|found| found.position);
        found.or_else(|| self.predictor.predict(self.lattice, node).map(|expected| expected.position))
    }

    /// How far the middle of the edge between two corners lies from the straight line: by the second differences of the
    /// corners on their line.
    fn bow(&self, from: Node, to: Node) -> Option<Vector2<f64>> {
        let [start, end] = [self.at(from)?, self.at(to)?];
        let known = |node: Node| self.lattice.get(node).map(|found| found.position);
        let before = known([2 * from[0] - to[0], 2 * from[1] - to[1]]).map(|before| before - 2.0 * start + end);
        let after = known([2 * to[0] - from[0], 2 * to[1] - from[1]]).map(|after| start - 2.0 * end + after);
        let bends: Vec<Vector2<f64>> = before.into_iter().chain(after).collect();
        let bow = bends.iter().sum::<Vector2<f64>>() / (-8.0 * bends.len().max(1) as f64);
        let along = (end - start).normalize();
        Some(bow - along * bow.dot(&along))
    }
}

/// The corners of a square, clockwise as seen from its least node.
const fn corners_of([i, j]: Node) -> [Node; 4] {
    [[i, j], [i + 1, j], [i + 1, j + 1], [i, j + 1]]
}
