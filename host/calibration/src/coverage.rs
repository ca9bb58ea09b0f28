//! What a set of target views covers and still needs: advice for the person who holds the target.

use std::fmt;

use vergence_targets::TargetView;
use vergence_vision::{ImageSize, Pixel};

/// Columns and rows of cells that the image is divided into.
const CELLS: usize = 3;
/// Views that each cell needs with a fair part of the target in it.
const VIEWS_PER_CELL: usize = 2;
/// Share of the views that must show the target tilted: otherwise focal length and distance are not separable.
const TILTED_SHARE: f64 = 0.5;
/// Share of a view's corners that must lie in a cell for the view to count there.
const FAIR_PART: f64 = 0.15;
/// Ratio of opposite sides of the outline above which a target counts as tilted.
const TILT_RATIO: f64 = 1.12;

/// Share of the field of view that the views taken so far cover.
#[derive(Clone, Debug, PartialEq)]
pub struct Coverage {
    size: ImageSize,
    cells: [[usize; CELLS]; CELLS],
    /// Cells in which a target can be shown.
    within_reach: [[bool; CELLS]; CELLS],
    tilted: usize,
    views: usize,
}

/// The view that a person should show next.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Advice {
    column: usize,
    row: usize,
    tilted: bool,
}

impl Coverage {
    /// An empty set of views, for images of `size`.
    #[must_use]
    pub fn new(size: ImageSize) -> Self {
        Self { size, cells: [[0; CELLS]; CELLS], within_reach: [[true; CELLS]; CELLS], tilted: 0, views: 0 }
    }

    /// As [`Self::new`], but only cells with a pixel for which `reaches` holds are needed, such as those that the other
    /// camera sees too.
    #[must_use]
    pub fn within(size: ImageSize, reaches: impl Fn(Pixel) -> bool) -> Self {
        /// Pixels tried along each side of a cell.
        const TRIES: usize = 5;
        let position = |cell: usize, part: usize, extent: u32| {
            f64::from(extent) * (cell as f64 + (part as f64 + 0.5) / TRIES as f64) / CELLS as f64 - 0.5
        };
        let any = |row: usize, column: usize| {
            (0..TRIES * TRIES).any(|i| {
                let (u, v) = (position(column, i % TRIES, size.width), position(row, i / TRIES, size.height));
                reaches(Pixel { u, v })
            })
        };
        let within_reach = std::array::from_fn(|row| std::array::from_fn(|column| any(row, column)));
        Self { within_reach, ..Self::new(size) }
    }

    /// Number of views taken.
    #[must_use]
    pub fn views(&self) -> usize {
        self.views
    }

    /// How far each cell is covered, by rows from the upper left: the share of the views that it needs, 1 where it has them; `None` where no target can
    /// be shown.
    #[must_use]
    pub fn cells(&self) -> [[Option<f64>; CELLS]; CELLS] {
        let share = |views: usize| (views as f64 / VIEWS_PER_CELL as f64).min(1.0);
        std::array::from_fn(|row| {
            std::array::from_fn(|column| self.within_reach[row][column].then(|| share(self.cells[row][column])))
        })
    }

    /// Whether `view` shows the target at a place or tilt of which more views are needed.
    #[must_use]
    pub fn is_news(&self, view: &TargetView) -> bool {
        let somewhere_new = self.touched(view).any(|(row, column)| self.cells[row][column] < VIEWS_PER_CELL);
        somewhere_new || (self.wants_tilt() && is_tilted(view))
    }

    /// Adds a view to the set.
    pub fn add(&mut self, view: &TargetView) {
        let touched: Vec<_> = self.touched(view).collect();
        for (row, column) in touched {
            self.cells[row][column] += 1;
        }
        self.views += 1;
        self.tilted += usize::from(is_tilted(view));
    }

    /// The view to show next; `None` if the set is complete.
    #[must_use]
    pub fn advice(&self) -> Option<Advice> {
        let places = (0..CELLS).flat_map(|row| (0..CELLS).map(move |column| (row, column)));
        let places = places.filter(|&(row, column)| self.within_reach[row][column]);
        let (row, column) = places.min_by_key(|&(row, column)| self.cells[row][column])?;
        let complete = self.cells[row][column] >= VIEWS_PER_CELL;
        (!complete || self.wants_tilt()).then(|| Advice { column, row, tilted: self.wants_tilt() })
    }

    fn wants_tilt(&self) -> bool {
        (self.tilted as f64) < TILTED_SHARE * (self.views.max(1) as f64)
    }

    /// Cells (row, column) that hold a fair part of the view's corners.
    fn touched<'a>(&self, view: &'a TargetView) -> impl Iterator<Item = (usize, usize)> + use<'a> {
        let (width, height) = (f64::from(self.size.width), f64::from(self.size.height));
        let cell =
            move |position: f64, extent: f64| ((position + 0.5) / extent * CELLS as f64).clamp(0.0, 2.0) as usize;
        let mut counts = [[0usize; CELLS]; CELLS];
        for corner in &view.corners {
            counts[cell(corner.pixel.v, height)][cell(corner.pixel.u, width)] += 1;
        }
        let fair = (FAIR_PART * view.corners.len() as f64).max(1.0);
        let places = (0..CELLS).flat_map(|row| (0..CELLS).map(move |column| (row, column)));
        places.filter(move |&(row, column)| counts[row][column] as f64 >= fair)
    }
}

/// Whether opposite sides of the target's outline differ in length by more than lens distortion explains.
fn is_tilted(view: &TargetView) -> bool {
    let along = |axis: usize| {
        let values = || view.corners.iter().map(|corner| corner.target_mm[axis]);
        let (low, high) = values().fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), x| (low.min(x), high.max(x)));
        let [first, last] = [low, high].map(|edge| edge_length(view, axis, edge));
        (first > 0.0 && last > 0.0).then(|| (first / last).max(last / first))
    };
    [0, 1].into_iter().filter_map(along).any(|ratio| ratio > TILT_RATIO)
}

/// Length in the image of the row or column of corners at `edge`, per millimetre of target.
fn edge_length(view: &TargetView, axis: usize, edge: f64) -> f64 {
    let mut line: Vec<_> = view.corners.iter().filter(|corner| (corner.target_mm[axis] - edge).abs() < 1e-6).collect();
    line.sort_by(|a, b| a.target_mm[1 - axis].total_cmp(&b.target_mm[1 - axis]));
    let (Some(first), Some(last)) = (line.first(), line.last()) else { return 0.0 };
    let mm = last.target_mm[1 - axis] - first.target_mm[1 - axis];
    let px = (last.pixel.u - first.pixel.u).hypot(last.pixel.v - first.pixel.v);
    if mm > 0.0 { px / mm } else { 0.0 }
}

impl fmt::Display for Advice {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        const PLACES: [[&str; CELLS]; CELLS] = [
            ["upper left", "at the top", "upper right"],
            ["on the left", "in the middle", "on the right"],
            ["lower left", "at the bottom", "lower right"],
        ];
        let place = PLACES.get(self.row).and_then(|row| row.get(self.column)).unwrap_or(&"");
        write!(f, "show the target {place}{}", if self.tilted { ", tilted" } else { "" })
    }
}
