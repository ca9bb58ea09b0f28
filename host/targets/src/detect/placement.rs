//! Assignment of a labelled patch to the corners of the target.
//!
//! A labelled patch may lie on the target in several ways: turned by quarters, and shifted if part of the target is
//! missing. A placement is possible if the patch lies on the target, if no side of the patch that shows the end of the
//! squares lies inside the target, and if the colours agree.

use vergence_vision::KannalaBrandt;

use super::DetectError;
use super::intensity::Intensity;
use super::lattice::{Lattice, Node, SIDES};
use super::predict::Predictor;
use super::saddle::{Quadrants, polarity};
use crate::labelling::{Relabelling, turned};

/// How certain the corner labels of a detection are beyond its own image.
///
/// The target's x axis turns clockwise into its y axis, as seen. Where columns + rows is odd the colours tell the first
/// corner: the square above and to the left of it is black. Where the sum is even a half turn maps the squares onto
/// squares of the same colour: then, and where part of the target is missing, several labellings are possible, and the
/// one whose x axis points most to the right in the image and whose y axis most down is taken.
///
/// One image's corners agree among themselves in every case, which is all that intrinsics need. Two cameras' views of
/// a target may be paired by index where both are [`Unique`](Self::Unique) only; for the others
/// `vergence_calibration::label_pairs` compares all labellings that the images allow.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum Placement {
    /// Only one labelling is possible.
    Unique,
    /// The whole target is seen, but turned targets look alike: each label may be that of the turned target.
    HalfTurn,
    /// Part of the target is seen, and several shifts are possible: labels are relative to one another only.
    Shifted,
}

/// A patch placed on a target.
pub struct Placed {
    /// The patch with columns and rows of the target as nodes.
    pub lattice: Lattice,
    pub placement: Placement,
    /// All labellings that the image allows, as changes of the labels in `lattice`; one of them changes nothing.
    pub labellings: Vec<Relabelling>,
}

/// The lattice placed on the target of `size`.
///
/// # Errors [`DetectError::WrongSize`] if it does not fit on the target.
pub fn place(
    lattice: &Lattice,
    image: &Intensity<'_>,
    hint: Option<&KannalaBrandt>,
    size: [u32; 2],
) -> Result<Placed, DetectError> {
    let predictor = Predictor::new(lattice, hint);
    let [low, high] = lattice.bounds().ok_or(DetectError::NoTarget { found: 0 })?;
    let patch = Patch {
        low,
        high,
        ends: SIDES.map(|side| shows_end(lattice, image, &predictor, side)),
        black_first: polarity(lattice, image, &predictor) < 0.0,
    };
    let ways = patch.ways(size);
    let wrong_size = || DetectError::WrongSize { found: patch.extent().map(i32::unsigned_abs), expected: size };
    let upright = [0, 1, 2, 3].map(|quarters| uprightness(lattice, quarters));
    let best = ways.iter().copied().reduce(
        |best, way| {
            if upright[way.quarters] > upright[best.quarters] { way } else { best }
        },
    );
    let best = best.ok_or_else(wrong_size)?;
    let whole = ways.iter().all(|way| {
        let extent = patch.extent();
        let [columns, rows] = if way.quarters % 2 == 0 { extent } else { [extent[1], extent[0]] };
        [columns, rows].map(i32::unsigned_abs) == size
    });
    let placement = match (ways.len(), whole) {
        (1, _) => Placement::Unique,
        (_, true) => Placement::HalfTurn,
        _ => Placement::Shifted,
    };
    let labellings = ways.iter().map(|way| best.inverse().then(*way)).collect();
    Ok(Placed { lattice: lattice.relabelled(|node| best.node(node)), placement, labellings })
}

/// Properties of a patch that determine its placement.
struct Patch {
    low: Node,
    high: Node,
    /// Whether the squares end beyond each of [`SIDES`].
    ends: [bool; 4],
    /// Whether the square behind node (0, 0) along both axes is black.
    black_first: bool,
}

impl Patch {
    /// Corners along the two axes.
    fn extent(&self) -> [i32; 2] {
        [0, 1].map(|axis| self.high[axis] - self.low[axis] + 1)
    }

    fn ways(&self, size: [u32; 2]) -> Vec<Relabelling> {
        let size = size.map(u32::cast_signed);
        let mut ways = Vec::new();
        for quarters in 0..4 {
            let [a, b] = [self.low, self.high].map(|node| turned(node, quarters));
            let low = [a[0].min(b[0]), a[1].min(b[1])];
            let high = [a[0].max(b[0]), a[1].max(b[1])];
            for column in -low[0]..size[0] - high[0] {
                for row in -low[1]..size[1] - high[1] {
                    let way = Relabelling { quarters, shift: [column, row] };
                    if self.ends_agree(way, size) && self.colours_agree(way, size) {
                        ways.push(way);
                    }
                }
            }
        }
        ways
    }

    /// Whether the target ends where its squares end along `way`.
    fn ends_agree(&self, way: Relabelling, size: [i32; 2]) -> bool {
        SIDES.iter().zip(self.ends).filter(|(_, ends)| *ends).all(|(&side, _)| {
            let outward = turned(side, way.quarters);
            let [a, b] = [self.low, self.high].map(|node| way.node(node));
            (0..2).all(|axis| match outward[axis] {
                1 => a[axis].max(b[axis]) == size[axis] - 1,
                -1 => a[axis].min(b[axis]) == 0,
                _ => true,
            })
        })
    }

    /// Above and to the left of corner (0, 0) is black. That is a choice of labels where turning the target changes
    /// that colour; where it does not, targets are printed either way, and the colours tell nothing.
    fn colours_agree(&self, way: Relabelling, size: [i32; 2]) -> bool {
        let [columns_odd, rows_odd] = size.map(|n| n % 2 != 0);
        let colours_tell = columns_odd != rows_odd || (size[0] == size[1] && columns_odd);
        let [i, j] = way.node([0, 0]);
        // A quarter turn brings a square of the other colour above and to the left of the same corner.
        let black = self.black_first != (way.quarters % 2 == 1);
        !colours_tell || black == ((i + j).rem_euclid(2) == 0)
    }
}

/// How far, after `quarters` of a turn, the x axis points to the right and the y axis down, in pixels, summed over all
/// cells.
fn uprightness(lattice: &Lattice, quarters: usize) -> f64 {
    let right = turned([1, 0], 4 - quarters);
    let down = turned([0, 1], 4 - quarters);
    let step =
        |[i, j]: Node, [di, dj]: Node| Some(lattice.get([i + di, j + dj])?.position - lattice.get([i, j])?.position);
    lattice
        .iter()
        .map(|(&node, _)| step(node, right).map_or(0.0, |s| s.x) + step(node, down).map_or(0.0, |s| s.y))
        .sum()
}

/// Whether the squares are seen to end beyond the patch's side in the direction `outward`: one step out there is one
/// more black and white square on the near side of most corners, and nothing but one shade on the far side.
fn shows_end(lattice: &Lattice, image: &Intensity<'_>, predictor: &Predictor<'_>, outward: Node) -> bool {
    const FEWEST: usize = 3;
    const PART_OF_CONTRAST: f64 = 0.5;
    let axis = usize::from(outward[1] != 0);
    let Some([low, high]) = lattice.bounds() else { return false };
    let edge = if outward[axis] > 0 { high[axis] } else { low[axis] };
    let (mut on_side, mut ends) = (0, 0);
    for (&node, found) in lattice.iter().filter(|(node, _)| node[axis] == edge) {
        on_side += 1;
        let beyond = [node[0] + outward[0], node[1] + outward[1]];
        let Some(expected) = predictor.predict(lattice, beyond) else { continue };
        let near_corner = Quadrants::read(image, found.position, &expected.steps);
        let (Some(here), Some(there)) = (near_corner, Quadrants::read(image, expected.position, &expected.steps))
        else {
            continue;
        };
        let [[a, b], [c, d]] = there.levels;
        let (behind, ahead) = if axis == 0 { ([a, b], [c, d]) } else { ([a, c], [b, d]) };
        let (near, far) = if outward[axis] > 0 { (behind, ahead) } else { (ahead, behind) };
        let contrast = PART_OF_CONTRAST * here.saddle().abs();
        if (near[0] - near[1]).abs() > contrast && (far[0] - far[1]).abs() < 0.5 * contrast {
            ends += 1;
        }
    }
    on_side >= FEWEST && 4 * ends >= 3 * on_side
}
