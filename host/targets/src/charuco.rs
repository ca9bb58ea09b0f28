//! ChArUco boards as OpenCV prints them.

use vergence_vision::Length;

use crate::{TagFamily, TargetPrint};

/// A chessboard with ArUco markers in its white squares, as OpenCV's `CharucoBoard` draws it since version 4.6.
///
/// The squares are counted, as OpenCV counts them, and the square at the upper left is black. Markers are numbered row by
/// row from the upper left. A corner's index is OpenCV's: the inner corners row by row from the upper left. In the target's
/// frame x points right and y down, as on a chessboard; its origin is the first inner corner, which OpenCV has one square
/// right of and one below its own origin.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CharucoSpec {
    /// Squares along x.
    pub columns: u32,
    /// Squares along y.
    pub rows: u32,
    /// Side of a square.
    pub square: Length,
    /// Side of a marker, its black border included.
    pub marker: Length,
    /// The dictionary of the markers.
    pub dictionary: TagFamily,
    /// Whether the board is as OpenCV before 4.6 drew it: with an even number of rows the square at the upper left is white.
    pub legacy: bool,
}

/// Width of the black border of a marker, in cells.
pub const MARKER_BORDER: u32 = 1;

impl CharucoSpec {
    /// Number of markers: the white squares.
    #[must_use]
    pub const fn markers(&self) -> u32 {
        let squares = self.columns.saturating_mul(self.rows);
        if self.is_white_first() { squares.div_ceil(2) } else { squares / 2 }
    }

    /// Number of inner corners.
    #[must_use]
    pub const fn corners(&self) -> u32 {
        self.columns.saturating_sub(1).saturating_mul(self.rows.saturating_sub(1))
    }

    /// Whether the dictionary has so many markers, and the lengths are some: a marker is smaller than a square.
    #[must_use]
    pub fn is_usable(&self) -> bool {
        self.columns.min(self.rows) >= 3
            && (self.markers() as usize) <= self.dictionary.codes.len()
            && self.square.mm().is_finite()
            && self.marker.mm() > 0.0
            && self.marker < self.square
    }

    /// Whether the square at the upper left is white.
    #[must_use]
    pub const fn is_white_first(&self) -> bool {
        self.legacy && self.rows.is_multiple_of(2)
    }

    /// Whether the square in `column` and `row` is black.
    const fn is_black(&self, column: u32, row: u32) -> bool {
        (column + row).is_multiple_of(2) != self.is_white_first()
    }

    /// Column and row of the square of marker `id`.
    #[must_use]
    pub fn place(&self, id: u32) -> Option<[u32; 2]> {
        self.white_squares().nth(id as usize)
    }

    /// The white squares in the order of their markers.
    fn white_squares(&self) -> impl Iterator<Item = [u32; 2]> + '_ {
        let squares = (0..self.rows).flat_map(|row| (0..self.columns).map(move |column| [column, row]));
        squares.filter(|[column, row]| !self.is_black(*column, *row))
    }

    /// Position of inner corner `index` on the target in millimetres.
    #[must_use]
    pub fn corner_mm(&self, index: u32) -> [f64; 2] {
        let columns = self.columns.saturating_sub(1).max(1);
        [index % columns, index / columns].map(|n| f64::from(n) * self.square.mm())
    }

    /// White between a square's edge and its marker, as a part of the square's side.
    pub(crate) fn margin(&self) -> f64 {
        0.5 * (1.0 - self.marker.mm() / self.square.mm())
    }

    /// The squares with their markers, and white of half a square around them.
    pub(crate) fn print(&self) -> TargetPrint {
        let (side, marker) = (self.square.mm(), self.marker.mm());
        let place = |square: [u32; 2]| square.map(|squares| side * (f64::from(squares) + 0.5));
        let squares = (0..self.rows).flat_map(|row| (0..self.columns).map(move |column| [column, row]));
        let black = squares.filter(|[column, row]| self.is_black(*column, *row)).map(place);
        let mut black: Vec<[f64; 4]> = black.map(|[x, y]| [x, y, side, side]).collect();
        let cell = marker / f64::from(self.dictionary.side + 2 * MARKER_BORDER);
        for (square, &code) in self.white_squares().zip(self.dictionary.codes) {
            let [left, top] = place(square).map(|at| at + side * self.margin());
            let cells = self.dictionary.black_cells(code, MARKER_BORDER).into_iter();
            black.extend(
                cells.map(|[x, y, width, height]| [left + x * cell, top + y * cell, width * cell, height * cell]),
            );
        }
        TargetPrint { black, size_mm: [self.columns, self.rows].map(|squares| side * (f64::from(squares) + 1.0)) }
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used, reason = "a test may fail")]

    use super::*;

    fn board(columns: u32, rows: u32, legacy: bool) -> CharucoSpec {
        let dictionary = TagFamily::dictionary("DICT_4X4_50").unwrap();
        let [square, marker] = [10.0, 6.0].map(Length::from_mm);
        CharucoSpec { columns, rows, square, marker, dictionary, legacy }
    }

    /// The places that `cv2.aruco.CharucoBoard((5, 4), ...)` gives, and with `setLegacyPattern(True)`.
    #[test]
    fn markers_lie_where_opencv_has_them() {
        let places = |board: CharucoSpec| (0..board.markers()).filter_map(|id| board.place(id)).collect::<Vec<_>>();
        let new = [[1, 0], [3, 0], [0, 1], [2, 1], [4, 1], [1, 2], [3, 2], [0, 3], [2, 3], [4, 3]];
        let old = [[0, 0], [2, 0], [4, 0], [1, 1], [3, 1], [0, 2], [2, 2], [4, 2], [1, 3], [3, 3]];
        assert_eq!((places(board(5, 4, false)), places(board(5, 4, true))), (new.to_vec(), old.to_vec()));
        // With an odd number of rows both are the same.
        assert_eq!(places(board(4, 5, true)), places(board(4, 5, false)));
        assert_eq!((board(5, 5, false).markers(), board(5, 4, true).markers()), (12, 10));
        assert_eq!(board(5, 4, false).corner_mm(6).map(|mm| mm.round() as i32), [20, 10]);
    }

    /// Marker 0 of DICT_4X4_50 is 0xb532, with white cells for ones.
    #[test]
    fn the_drawing_has_every_black_square_and_cell_once() {
        let drawn = board(3, 3, false).print();
        let area: f64 = drawn.black.iter().map(|[_, _, width, height]| width * height).sum();
        let white: u32 = board(3, 3, false).dictionary.codes.iter().take(4).map(|code| code.count_ones()).sum();
        assert!((area - 500.0 - 4.0 * 36.0 + f64::from(white)).abs() < 1e-9, "{area}");
        // The upper border of marker 0, in the second square of the first row, and the cells of its first row: 1011.
        let row =
            |y: f64| drawn.black.iter().filter(move |[x, top, ..]| (top - y).abs() < 1e-9 && (15.0..25.0).contains(x));
        let cells =
            |y: f64| row(y).map(|[x, _, width, _]| [x.round() as i32, width.round() as i32]).collect::<Vec<_>>();
        assert_eq!((cells(7.0), cells(8.0)), (vec![[17, 6]], vec![[17, 1], [19, 1], [22, 1]]));
    }
}
