//! Boards and what was seen of them.

use vergence_vision::{Frame, Length, Pixel};

/// The frame of a board: x along its rows of corners, y along its columns, the board is the plane z = 0.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Board;

impl Frame for Board {}

/// A chessboard, counted by its inner corners.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct BoardSpec {
    /// Inner corners along x.
    pub columns: u32,
    /// Inner corners along y.
    pub rows: u32,
    /// Side of a square.
    pub square: Length,
}

/// One corner of a board seen in an image.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Corner {
    /// Where it is on the board, x and y in millimetres; the board is the plane z = 0.
    pub board_mm: [f64; 2],
    /// Where the image shows it.
    pub pixel: Pixel,
}

/// What one image shows of the board; corners may be missing.
#[derive(Clone, Debug, PartialEq)]
pub struct BoardView {
    /// The image's name, for reports.
    pub name: String,
    /// In any order.
    pub corners: Vec<Corner>,
}

impl BoardSpec {
    /// The board position of corner `index`, counted row by row, in millimetres.
    #[must_use]
    pub fn corner_mm(&self, index: u32) -> [f64; 2] {
        let columns = self.columns.max(1);
        [index % columns, index / columns].map(|n| f64::from(n) * self.square.mm())
    }
}
