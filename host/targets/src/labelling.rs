//! Labellings of the corners of a target, where an image allows several.

use vergence_vision::Length;

use crate::{TargetKind, TargetSpec, TargetView};

/// A change of labels: a turn of the target by quarters, which take its x axis to its y axis, then a shift by whole
/// squares.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub struct Relabelling {
    /// Number of quarters, 0 to 3.
    pub quarters: usize,
    /// Shift along x and y, in squares.
    pub shift: [i32; 2],
}

/// A target as one image shows it, with every labelling that the image allows.
#[derive(Clone, Debug, PartialEq)]
pub struct SeenTarget {
    /// The corners, under one of the labellings.
    pub view: TargetView,
    /// All labellings that the image allows, as changes of that in `view`; one of them changes nothing.
    pub labellings: Vec<Relabelling>,
    /// Distance of neighbouring corners: the side of a square.
    pub pitch: Length,
}

/// `node` after `quarters` of a turn that takes the first axis to the second.
pub(crate) fn turned([i, j]: [i32; 2], quarters: usize) -> [i32; 2] {
    match quarters % 4 {
        0 => [i, j],
        1 => [-j, i],
        2 => [-i, -j],
        _ => [j, -i],
    }
}

impl Relabelling {
    /// The change that changes nothing.
    pub const SAME: Self = Self { quarters: 0, shift: [0, 0] };

    /// The new label of the corner in column and row `node`.
    #[must_use]
    pub fn node(self, node: [i32; 2]) -> [i32; 2] {
        let [i, j] = turned(node, self.quarters);
        [i + self.shift[0], j + self.shift[1]]
    }

    /// The same for a position on a target with squares of the side `pitch_mm`, in millimetres.
    #[must_use]
    pub fn target_mm(self, [x, y]: [f64; 2], pitch_mm: f64) -> [f64; 2] {
        let [x, y] = match self.quarters % 4 {
            0 => [x, y],
            1 => [-y, x],
            2 => [-x, -y],
            _ => [y, -x],
        };
        let [columns, rows] = self.shift.map(|squares| f64::from(squares) * pitch_mm);
        [x + columns, y + rows]
    }

    /// This change, then `next`.
    #[must_use]
    pub fn then(self, next: Self) -> Self {
        Self { quarters: (self.quarters + next.quarters) % 4, shift: next.node(self.shift) }
    }

    /// The change that takes this one back.
    #[must_use]
    pub fn inverse(self) -> Self {
        let quarters = (4 - self.quarters % 4) % 4;
        let [i, j] = turned(self.shift, quarters);
        Self { quarters, shift: [-i, -j] }
    }
}

impl SeenTarget {
    /// A target whose corners are all labelled for certain.
    #[must_use]
    pub fn certain(view: TargetView, pitch: Length) -> Self {
        Self { view, labellings: vec![Relabelling::SAME], pitch }
    }

    /// Whether the image allows one labelling only.
    #[must_use]
    pub fn is_certain(&self) -> bool {
        self.labellings.len() == 1
    }

    /// Whether the image tells where the corners lie on `target`, but for a half turn of the whole: enough where the target's
    /// shape counts, such as its bow.
    #[must_use]
    pub fn is_placed(&self, target: &TargetKind) -> bool {
        let TargetKind::Chessboard(TargetSpec { columns, rows, .. }) = target else { return self.is_certain() };
        let half_turn = Relabelling { quarters: 2, shift: [columns, rows].map(|corners| corners.cast_signed() - 1) };
        self.labellings.iter().all(|change| *change == Relabelling::SAME || *change == half_turn)
    }

    /// The view under another labelling.
    #[must_use]
    pub fn relabelled(&self, change: Relabelling) -> TargetView {
        let mut view = self.view.clone();
        if change != Relabelling::SAME {
            for corner in &mut view.corners {
                corner.target_mm = change.target_mm(corner.target_mm, self.pitch.mm());
            }
        }
        view
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn changes_of_labels_form_a_group_and_act_on_positions_as_on_nodes() {
        let changes =
            (0..4).flat_map(|quarters| [[0, 0], [3, -1], [-2, 5]].map(|shift| Relabelling { quarters, shift }));
        let changes: Vec<_> = changes.collect();
        for &a in &changes {
            assert_eq!(a.then(a.inverse()), Relabelling::SAME);
            assert_eq!(a.inverse().then(a), Relabelling::SAME);
            let [i, j] = a.node([4, 7]);
            let moved = a.target_mm([80.0, 140.0], 20.0).map(|mm| (mm / 20.0).round() as i32);
            assert_eq!(moved, [i, j]);
            for &b in &changes {
                assert_eq!(a.then(b).node([4, 7]), b.node(a.node([4, 7])));
            }
        }
    }
}
