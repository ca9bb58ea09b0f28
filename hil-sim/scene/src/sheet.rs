//! Printed sheets: everything that may stand before a camera as a calibration target.

use nalgebra::{UnitQuaternion, Vector3};
use vergence_vision::{Frame, Length, Point, Transform};

use crate::Target;
use crate::target::{BACK, BLACK, WHITE};
use crate::texture::Rgb;

/// A flat sheet of no thickness with a printed pattern. Its frame is that of [`Target`]: x to the right, y down, z into the
/// sheet, which is printed on the side of negative z.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Sheet {
    /// A checkerboard.
    Checkerboard(Target),
    /// A grid of coded tags.
    Tags(TagGrid),
    /// A checkerboard with coded markers.
    Markers(MarkerBoard),
}

/// A grid of square tags with black borders and small black squares at their corners, which fill the gaps' crossings. The
/// origin of its frame is the upper left corner of the upper left tag.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TagGrid {
    /// Tags along x.
    pub columns: u32,
    /// Tags along y.
    pub rows: u32,
    /// Side of a tag, its border included.
    pub tag: Length,
    /// Space between tags.
    pub gap: Length,
    /// What is printed in the tags.
    pub code: TagPrint,
}

/// A checkerboard with coded markers in the middle of its white squares, numbered row by row from the upper left, and a white
/// border of half a square. The origin of its frame is the first inner corner, as on a checkerboard.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct MarkerBoard {
    /// Squares along x.
    pub columns: u32,
    /// Squares along y.
    pub rows: u32,
    /// Side of a square.
    pub square: Length,
    /// Side of a marker, its border included.
    pub marker: Length,
    /// Whether the square at the upper left is white.
    pub white_first: bool,
    /// What is printed in the markers.
    pub code: TagPrint,
}

/// The inside of tags.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TagPrint {
    /// Cells along a side, without the border.
    pub side: u32,
    /// Cells of the black border.
    pub border: u32,
    /// The codes by number: cells row by row from the upper left, the first one the highest bit, 1 is white.
    pub codes: &'static [u64],
}

impl TagPrint {
    /// Whether tag `id` is black at (x, y), 0 to 1 from its upper left corner.
    fn is_black(&self, id: usize, x: f64, y: f64) -> bool {
        let across = f64::from(self.side + 2 * self.border);
        let cell = |part: f64| ((part * across) as u32).checked_sub(self.border).filter(|cell| *cell < self.side);
        let (Some(column), Some(row)) = (cell(x), cell(y)) else { return true };
        let code = self.codes.get(id).copied().unwrap_or_default();
        code >> (self.side * self.side - 1 - row * self.side - column) & 1 == 0
    }
}

impl TagGrid {
    /// Whether the place, in millimetres in the frame of the grid, is black.
    fn is_black(&self, x: f64, y: f64) -> bool {
        let (tag, gap) = (self.tag.mm(), self.gap.mm());
        let pitch = tag + gap;
        let inside = |at: f64, tags: u32| (-gap..f64::from(tags) * pitch).contains(&at);
        if !inside(x, self.columns) || !inside(y, self.rows) {
            return false;
        }
        let (column, row) = ((x / pitch).floor(), (y / pitch).floor());
        let (right, down) = (x - column * pitch, y - row * pitch);
        match (right < tag, down < tag) {
            (false, false) => true,
            (true, true) => {
                // Tags are numbered row by row from the lower left.
                let id = (f64::from(self.rows) - 1.0 - row) * f64::from(self.columns) + column;
                self.code.is_black(id as usize, right / tag, down / tag)
            }
            _ => false,
        }
    }
}

impl MarkerBoard {
    /// Whether the place, in millimetres in the frame of the board, is black.
    fn is_black(&self, x: f64, y: f64) -> bool {
        let (column, row) = (x / self.square.mm() + 1.0, y / self.square.mm() + 1.0);
        let printed = (0.0..f64::from(self.columns)).contains(&column) && (0.0..f64::from(self.rows)).contains(&row);
        let is_white = |column: u32, row: u32| (column + row).is_multiple_of(2) == self.white_first;
        if !printed || !is_white(column as u32, row as u32) {
            return printed;
        }
        let part = self.marker.mm() / self.square.mm();
        let [right, down] = [column, row].map(|at| (at.fract() - 0.5) / part + 0.5);
        if !(0.0..1.0).contains(&right) || !(0.0..1.0).contains(&down) {
            return false;
        }
        // The white squares before this one: those of full rows, then those in its row.
        let before = |row: u32, columns: u32| (0..columns).filter(|column| is_white(*column, row)).count();
        let full: usize = (0..row as u32).map(|row| before(row, self.columns)).sum();
        self.code.is_black(full + before(row as u32, column as u32), right, down)
    }
}

impl From<Target> for Sheet {
    fn from(target: Target) -> Self {
        Self::Checkerboard(target)
    }
}

impl Sheet {
    /// The middle of the sheet.
    #[must_use]
    pub fn centre(&self) -> Point<Target> {
        match self {
            Self::Checkerboard(target) => target.centre(),
            Self::Tags(_) | Self::Markers(_) => {
                let [[left, top], [right, bottom]] = self.outermost();
                Point::from_mm(Vector3::new(left + right, top + bottom, 0.0) * 0.5)
            }
        }
    }

    /// Width and height including the white border.
    #[must_use]
    pub fn size(&self) -> [Length; 2] {
        match self {
            Self::Checkerboard(target) => target.size(),
            // The small squares, and white as wide around them.
            Self::Tags(grid) => {
                [grid.columns, grid.rows].map(|tags| (grid.tag + grid.gap) * f64::from(tags) + grid.gap * 3.0)
            }
            Self::Markers(board) => {
                [board.columns, board.rows].map(|squares| board.square * (f64::from(squares) + 1.0))
            }
        }
    }

    /// The upper left and the lower right corner that cameras measure, x and y in millimetres.
    #[must_use]
    pub fn outermost(&self) -> [[f64; 2]; 2] {
        let far = match self {
            Self::Checkerboard(target) => {
                [target.columns, target.rows].map(|n| f64::from(n.saturating_sub(1)) * target.square.mm())
            }
            Self::Tags(grid) => {
                [grid.columns, grid.rows].map(|n| f64::from(n) * (grid.tag + grid.gap).mm() - grid.gap.mm())
            }
            Self::Markers(board) => [board.columns, board.rows].map(|n| (f64::from(n) - 2.0) * board.square.mm()),
        };
        [[0.0, 0.0], far]
    }

    /// The pose of a sheet turned by `rotation` with its middle at `middle`, in millimetres.
    #[must_use]
    pub fn placed<F: Frame>(&self, rotation: UnitQuaternion<f64>, middle: Vector3<f64>) -> Transform<F, Target> {
        Transform::new(rotation, middle - rotation * self.centre().mm())
    }

    /// The ink at a place in millimetres about the middle of the sheet, seen from before or from behind. Edges are sharp:
    /// the lens alone blurs them.
    pub(crate) fn ink(&self, place: [f64; 2], from_behind: bool) -> Rgb {
        if from_behind {
            return BACK;
        }
        let from_origin = || {
            let middle = self.centre().mm();
            (place[0] + middle.x, place[1] + middle.y)
        };
        let is_black = match self {
            Self::Checkerboard(target) => target.is_black(place),
            Self::Tags(grid) => {
                let (x, y) = from_origin();
                grid.is_black(x, y)
            }
            Self::Markers(board) => {
                let (x, y) = from_origin();
                board.is_black(x, y)
            }
        };
        if is_black { BLACK } else { WHITE }
    }
}
