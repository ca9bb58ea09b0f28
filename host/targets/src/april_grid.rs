//! Grids of AprilTags as Kalibr prints them.

use vergence_vision::Length;

use crate::{TagFamily, TargetPrint};

/// A grid of AprilTags with small black squares at the corners of the tags, as `kalibr_create_target_pdf` draws it and
/// Kalibr's `aprilgrid.yaml` describes it.
///
/// Tags are numbered row by row from the lower left. A corner's index is four times its tag's number, plus 0 at the tag's
/// lower left, 1 at its lower right, 2 at its upper right, 3 at its upper left. In the target's frame x points right and y
/// down, as on a chessboard; its origin is the upper left corner of the upper left tag.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct AprilGridSpec {
    /// Tags along x.
    pub columns: u32,
    /// Tags along y.
    pub rows: u32,
    /// Side of a tag, its black border included.
    pub tag: Length,
    /// Space between tags as a part of their side: `tagSpacing`.
    pub spacing: f64,
}

/// Width of the black border of a tag in cells, as Kalibr prints it.
pub const TAG_BORDER: u32 = 2;

impl AprilGridSpec {
    /// The family of the tags.
    pub const FAMILY: TagFamily = TagFamily::TAG_36H11;

    /// Number of tags.
    #[must_use]
    pub const fn tags(&self) -> u32 {
        self.columns.saturating_mul(self.rows)
    }

    /// Whether there are that many tags, and the lengths are some: the spacing is more than 0 and at most a side.
    #[must_use]
    pub fn is_usable(&self) -> bool {
        (1..=Self::FAMILY.codes.len()).contains(&(self.tags() as usize))
            && self.tag.mm() > 0.0
            && self.tag.mm().is_finite()
            && self.spacing > 0.0
            && self.spacing <= 1.0
    }

    /// Column and row of a tag, counted from the upper left.
    #[must_use]
    pub fn place(&self, id: u32) -> [i32; 2] {
        let columns = self.columns.max(1);
        let from_below = id / columns;
        [(id % columns).cast_signed(), self.rows.cast_signed() - 1 - from_below.cast_signed()]
    }

    /// Position of corner `index` on the target in millimetres.
    #[must_use]
    pub fn corner_mm(&self, index: u32) -> [f64; 2] {
        let pitch = self.tag.mm() * (1.0 + self.spacing);
        let [x, y] = self.place(index / 4).map(|n| f64::from(n) * pitch);
        let (right, below) = (matches!(index % 4, 1 | 2), index % 4 < 2);
        let side = |is_far: bool| if is_far { self.tag.mm() } else { 0.0 };
        [x + side(right), y + side(below)]
    }

    /// The tags, the small squares at their corners, and white as wide as these around the outermost.
    pub(crate) fn print(&self) -> TargetPrint {
        let gap = self.tag.mm() * self.spacing;
        let shifted = |[x, y, width, height]: [f64; 4]| [x + 2.0 * gap, y + 2.0 * gap, width, height];
        TargetPrint {
            black: self.black().into_iter().map(shifted).collect(),
            size_mm: [self.columns, self.rows].map(|tags| f64::from(tags) * (self.tag.mm() + gap) + 3.0 * gap),
        }
    }

    /// The black rectangles: x, y, width and height in millimetres in the target's frame.
    fn black(&self) -> Vec<[f64; 4]> {
        let (family, tag, gap) = (Self::FAMILY, self.tag.mm(), self.tag.mm() * self.spacing);
        let cell = tag / f64::from(family.side + 2 * TAG_BORDER);
        let mut black = Vec::new();
        for (id, &bits) in (0..self.tags()).zip(family.codes) {
            let [left, top] = self.corner_mm(4 * id + 3);
            let cells = family.black_cells(bits, TAG_BORDER).into_iter();
            black.extend(
                cells.map(|[x, y, width, height]| [left + x * cell, top + y * cell, width * cell, height * cell]),
            );
        }
        // The small squares lie between the tags and outside the outermost.
        for row in 0..=self.rows {
            for column in 0..=self.columns {
                let [x, y] = [column, row].map(|n| f64::from(n) * (tag + gap) - gap);
                black.push([x, y, gap, gap]);
            }
        }
        black
    }
}

impl AprilGridSpec {
    /// Part of a tag's side in which a corner's surroundings are as a chessboard's about its corner: twice the way to what
    /// differs, the code along the diagonal or the end of the small square.
    pub(crate) fn cell(&self) -> f64 {
        const TO_CODE: f64 = 0.25;
        1.8 * TO_CODE.min(self.spacing)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn tags_are_numbered_from_the_lower_left_and_corners_against_the_clock() {
        let grid = AprilGridSpec { columns: 6, rows: 4, tag: Length::from_mm(40.0), spacing: 0.25 };
        assert_eq!((grid.place(0), grid.place(5), grid.place(6), grid.place(23)), ([0, 3], [5, 3], [0, 2], [5, 0]));
        let corners = [0, 1, 2, 3].map(|corner| grid.corner_mm(4 * 7 + corner).map(|mm| mm.round() as i32));
        assert_eq!(corners, [[50, 140], [90, 140], [90, 100], [50, 100]]);
        assert!(grid.is_usable() && !AprilGridSpec { columns: 147, ..grid }.is_usable());
        assert!(!AprilGridSpec { spacing: f64::NAN, ..grid }.is_usable());
    }

    /// Kalibr's tag 0 is 0xd5d628584 with bit 35 at the upper left and 0 for black.
    #[test]
    fn the_drawing_has_every_black_cell_once() {
        let grid = AprilGridSpec { columns: 1, rows: 1, tag: Length::from_mm(10.0), spacing: 0.3 };
        let black = grid.black();
        let area: f64 = black.iter().map(|[_, _, width, height]| width * height).sum();
        let white = f64::from(0xd_5d62_8584_u64.count_ones());
        assert!((area - (100.0 - white + 4.0 * 9.0)).abs() < 1e-9, "{area}");
        // The first row of the code, 110101, has black cells at 2 and 4.
        let row: Vec<_> =
            black.iter().filter(|[_, y, ..]| (y - 2.0).abs() < 1e-9).map(|[x, _, w, _]| [*x, *w]).collect();
        let expected = [[0.0, 2.0], [4.0, 1.0], [6.0, 1.0], [8.0, 2.0]];
        for (found, expected) in row.iter().zip(expected) {
            assert!((found[0] - expected[0]).abs() + (found[1] - expected[1]).abs() < 1e-9, "{row:?}");
        }
        assert_eq!(row.len(), 4);
    }
}
