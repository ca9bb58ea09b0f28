//! Calibration targets and their observed corners.

use std::fmt;

use vergence_vision::{Frame, Length, Pixel};

use crate::{AprilGridSpec, CharucoSpec};

/// The frame of a target: x along its rows of corners, y along its columns, the target is the plane z = 0.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Target;

impl Frame for Target {}

/// A chessboard, counted by its inner corners.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TargetSpec {
    /// Inner corners along x.
    pub columns: u32,
    /// Inner corners along y.
    pub rows: u32,
    /// Side of a square.
    pub square: Length,
}

/// A calibration target of one of the kinds that are detected.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum TargetKind {
    /// A chessboard.
    Chessboard(TargetSpec),
    /// A grid of AprilTags, as Kalibr prints it.
    AprilGrid(AprilGridSpec),
    /// A chessboard with markers, as OpenCV prints it.
    Charuco(CharucoSpec),
}

/// A target as it is printed.
#[derive(Clone, Debug, PartialEq)]
pub struct TargetPrint {
    /// Black rectangles: x, y, width and height in millimetres, from the upper left corner of the white border.
    pub black: Vec<[f64; 4]>,
    /// Width and height with the white border that the detector needs, in millimetres.
    pub size_mm: [f64; 2],
}

/// One corner of a target, observed in an image.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Corner {
    /// Position on the target, x and y in millimetres; the target is the plane z = 0.
    pub target_mm: [f64; 2],
    /// Observed position in the image.
    pub pixel: Pixel,
    /// Standard deviation of `pixel` per axis, up to a factor common to all corners: a calibration weights corners by
    /// it and estimates the factor. Positive; 1 if unknown.
    pub relative_sigma: f64,
}

/// The corners that one image shows of the target; some may be missing.
#[derive(Clone, Debug, PartialEq)]
pub struct TargetView {
    /// Name of the image, for reports.
    pub name: String,
    /// Observed corners, in any order.
    pub corners: Vec<Corner>,
}

impl Corner {
    /// A corner of relative sigma 1: no better or worse than others.
    #[must_use]
    pub const fn new(target_mm: [f64; 2], pixel: Pixel) -> Self {
        Self { target_mm, pixel, relative_sigma: 1.0 }
    }

    /// `error_px` divided by the corner's relative sigma.
    #[must_use]
    pub fn deviation(&self, error_px: f64) -> f64 {
        error_px / self.relative_sigma
    }

    /// Whether all coordinates are finite and the relative sigma is finite and positive.
    #[must_use]
    pub fn is_usable(&self) -> bool {
        let [x, y] = self.target_mm;
        let numbers = [x, y, self.pixel.u, self.pixel.v, self.relative_sigma];
        numbers.iter().all(|number| number.is_finite()) && self.relative_sigma > 0.0
    }
}

impl TargetSpec {
    /// Position of corner `index`, counted row by row, on the target in millimetres.
    #[must_use]
    pub fn corner_mm(&self, index: u32) -> [f64; 2] {
        let columns = self.columns.max(1);
        [index % columns, index / columns].map(|n| f64::from(n) * self.square.mm())
    }
}

impl fmt::Display for TargetKind {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Chessboard(TargetSpec { columns, rows, square }) => {
                write!(f, "{columns} × {rows} inner corners, {square}")
            }
            Self::AprilGrid(AprilGridSpec { columns, rows, tag, spacing }) => {
                write!(f, "{columns} × {rows} AprilTags of {tag}, spacing {spacing}")
            }
            Self::Charuco(CharucoSpec { columns, rows, square, marker, dictionary, legacy }) => {
                let pattern = if *legacy { ", legacy pattern" } else { "" };
                let name = dictionary.name;
                write!(f, "ChArUco board of {columns} × {rows} squares, {square}, markers {name} of {marker}{pattern}")
            }
        }
    }
}

impl TargetKind {
    /// The length that a person measures: the side of a square or of a tag.
    #[must_use]
    pub const fn side(&self) -> Length {
        match self {
            Self::Chessboard(board) => board.square,
            Self::AprilGrid(grid) => grid.tag,
            Self::Charuco(board) => board.square,
        }
    }

    /// The target as it is printed.
    #[must_use]
    pub fn print(&self) -> TargetPrint {
        match self {
            Self::Chessboard(board) => board.print(),
            Self::AprilGrid(grid) => grid.print(),
            Self::Charuco(board) => board.print(),
        }
    }
}

impl TargetSpec {
    /// Squares, the upper left one black, and white of half a square around them.
    fn print(&self) -> TargetPrint {
        let side = self.square.mm();
        let squares = (0..=self.rows).flat_map(|row| (0..=self.columns).map(move |column| (column, row)));
        let place = |squares: u32| side * (f64::from(squares) + 0.5);
        let black = squares.filter(|(column, row)| (column + row).is_multiple_of(2));
        TargetPrint {
            black: black.map(|(column, row)| [place(column), place(row), side, side]).collect(),
            size_mm: [self.columns, self.rows].map(|corners| side * (f64::from(corners) + 2.0)),
        }
    }
}
