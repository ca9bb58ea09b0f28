//! Tests whether a position looks like the corner of four squares.

use nalgebra::Vector2;
use vergence_vision::KannalaBrandt;

use super::intensity::Intensity;
use super::lattice::{Lattice, Node};
use super::predict::{Prediction, Predictor, cell};

/// Least difference between black and white, in grey levels.
const LEAST_CONTRAST: f64 = 8.0;

/// Mean grey levels of the four squares about a place, by the signs of the steps: `quadrants[i][j]` lies ahead along
/// the first axis if i = 1, and ahead along the second if j = 1.
#[derive(Clone, Copy, Debug)]
pub struct Quadrants {
    pub levels: [[f64; 2]; 2],
}

impl Quadrants {
    /// Means of the four squares that meet at `position`; `None` at the image's border.
    pub fn read(image: &Intensity<'_>, position: Vector2<f64>, steps: &[Vector2<f64>; 2]) -> Option<Self> {
        // Means over the places with these offsets in cells, each along both axes.
        const OFFSETS: [f64; 3] = [0.18, 0.28, 0.38];
        let cell = cell(steps);
        let mut levels = [[0.0; 2]; 2];
        for (level, along) in levels.iter_mut().zip([-1.0, 1.0]) {
            for (level, across) in level.iter_mut().zip([-1.0, 1.0]) {
                for x in OFFSETS {
                    for y in OFFSETS {
                        *level += image.between(position + cell * Vector2::new(along * x, across * y))? / 9.0;
                    }
                }
            }
        }
        Some(Self { levels })
    }

    /// The places about a corner whose grey levels, each times its part, sum up to its saddle. They are closer to the edges than those of
    /// [`Self::read`], so that the saddle falls off on all sides of a corner.
    pub fn close_saddle(steps: &[Vector2<f64>; 2]) -> impl Iterator<Item = (Vector2<f64>, f64)> {
        const OFFSETS: [f64; 3] = [0.06, 0.14, 0.24];
        const SIDES: [f64; 2] = [-1.0, 1.0];
        let cell = cell(steps);
        let quadrants = SIDES.into_iter().flat_map(|along| SIDES.map(|across| [along, across]));
        let places = OFFSETS.into_iter().flat_map(|x| OFFSETS.map(|y| [x, y]));
        quadrants.flat_map(move |[along, across]| {
            let place = move |[x, y]: [f64; 2]| (cell * Vector2::new(along * x, across * y), along * across / 18.0);
            places.clone().map(place)
        })
    }

    /// How much brighter the square ahead along both axes and its opposite are than the other two.
    pub fn saddle(&self) -> f64 {
        let [[a, b], [c, d]] = self.levels;
        0.5 * (a + d - b - c)
    }

    /// Whether opposite squares are alike, adjacent ones differ, and the difference is at least `contrast`.
    pub fn is_corner(&self, contrast: f64) -> bool {
        // Shading and vignette tilt a corner by less than half its contrast; the outer corner of the target's last
        // square, three parts white and one black, does by twice its contrast.
        const LARGEST_TILT: f64 = 0.7;
        let [[a, b], [c, d]] = self.levels;
        let saddle = self.saddle().abs();
        saddle >= contrast.max(LEAST_CONTRAST) && (a - d).abs().max((b - c).abs()) <= LARGEST_TILT * saddle
    }
}

/// 1 or -1: the sign that [`Quadrants::saddle`] has at every corner of a target that has it at node (0, 0).
pub fn parity(node: Node) -> f64 {
    if (node[0] + node[1]).rem_euclid(2) == 0 { 1.0 } else { -1.0 }
}

/// Saddle at node (0, 0), averaged over all corners: positive if the square ahead along both axes is white.
pub fn polarity(lattice: &Lattice, image: &Intensity<'_>, predictor: &Predictor<'_>) -> f64 {
    let saddles = lattice.iter().filter_map(|(&node, found)| {
        let prediction = predictor.predict(lattice, node)?.within(lattice.clear);
        Some(parity(node) * Quadrants::read(image, found.position, &prediction.steps)?.saddle())
    });
    saddles.sum()
}

/// The contrast near `node`: the mean over the corners one step away, or that of all corners if there is none.
pub fn contrast_near(lattice: &Lattice, image: &Intensity<'_>, node: Node, steps: &[Vector2<f64>; 2]) -> f64 {
    let saddles = lattice
        .around(node, 1)
        .filter_map(|(_, found)| Some(Quadrants::read(image, found.position, steps)?.saddle().abs()));
    let (sum, count) = saddles.fold((0.0, 0.0), |(sum, count), saddle| (sum + saddle, count + 1.0));
    if count > 0.0 { sum / count } else { 0.0 }
}

/// Drops false corners of the search: places without a saddle, or with one of the wrong colours.
pub fn keep_corners(lattice: &mut Lattice, image: &Intensity<'_>, hint: Option<&KannalaBrandt>) {
    let predictor = Predictor::new(lattice, hint);
    let polarity = polarity(lattice, image, &predictor).signum();
    let fits = |node: Node, position: Vector2<f64>, expected: &Prediction| {
        Quadrants::read(image, position, &expected.within(lattice.clear).steps)
            .is_some_and(|quadrants| quadrants.is_corner(0.0) && quadrants.saddle() * parity(node) * polarity > 0.0)
    };
    let wrong: Vec<Node> = lattice
        .iter()
        .filter(|(node, found)| {
            !predictor.predict(lattice, **node).is_some_and(|expected| fits(**node, found.position, &expected))
        })
        .map(|(&node, _)| node)
        .collect();
    for node in wrong {
        lattice.remove(node);
    }
}
