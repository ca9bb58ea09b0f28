//! Finds a chessboard in a fisheye image, whole or in part, and measures its corners.
//!
//! `calib-targets-chessboard` searches for corners and labels a patch of them (`search`). From there on:
//!
//! 1. each corner is refined to a fraction of a pixel and must look like one (`refine`, `saddle`);
//! 2. the patch grows by predicting its missing neighbours and looking there (`grow`, `predict`);
//! 3. if the camera is known, at least roughly, each corner is refined again along edges that bend as it says;
//! 4. corners that disagree with a smooth board are flagged (`blunders`);
//! 5. the patch is placed on the board: which corner is the first (`placement`).

mod blunders;
mod grow;
mod intensity;
mod lattice;
mod placement;
mod predict;
mod refine;
mod saddle;
mod search;

use image::GrayImage;
use vergence_vision::{KannalaBrandt, Pixel};

use crate::{BoardSpec, BoardView, Corner};
use intensity::Intensity;
use lattice::Lattice;
pub use placement::Placement;

/// Fewest corners that are taken for a board. Four give a pose; a dozen in line with one another are no accident.
const FEWEST_CORNERS: usize = 12;

/// Most corners along a side of a board. No image resolves more.
const MOST_ALONG_SIDE: u32 = 256;

/// A chessboard found in an image.
#[derive(Clone, Debug, PartialEq)]
pub struct Detection {
    /// In ascending order of index, each at most once.
    pub corners: Vec<DetectedCorner>,
    /// Whether every corner of the board is there and good.
    pub complete: bool,
    /// How far the labels can be trusted beyond this image.
    pub placement: Placement,
}

/// One corner of a board in an image.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DetectedCorner {
    /// Its number on the board, row by row: column + row · columns.
    pub index: u32,
    /// Where it is in the image.
    pub pixel: Pixel,
    /// Standard deviation per axis in pixels, as the grey levels about it tell: how well they agree with one corner. On
    /// sharp images it is some four times the true error, as blurred edges count as disagreement: a weight, no bound. 1
    /// where the corner is unrefined.
    pub sigma_px: f64,
    /// Whether the search missed it and it was found where its neighbours predict it.
    pub filled: bool,
    /// Whether to use it.
    pub quality: CornerQuality,
}

/// Whether a corner is fit for calibration.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum CornerQuality {
    /// Measured to a fraction of a pixel and where its neighbours expect it.
    Good,
    /// The refinement left its bounds: the place is that of the search, to a pixel or so.
    Unrefined,
    /// Too far from where its neighbours expect it, or its grey levels agree with one corner much less than theirs do:
    /// partly covered, or at the edge of the lens's field.
    Blunder,
}

/// Why no board is reported.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum DetectError {
    /// No board of the size asked for can be detected.
    #[error(
        "a board of {columns} × {rows} inner corners cannot be detected: \
         it takes 2 to {MOST_ALONG_SIDE} along a side and at least {FEWEST_CORNERS} in all"
    )]
    UnusableBoard {
        /// Inner corners along x.
        columns: u32,
        /// Inner corners along y.
        rows: u32,
    },
    /// There is no chessboard in the image, or too little of it.
    #[error(
        "no chessboard found: {found} corners in a grid, at least {FEWEST_CORNERS} are needed; \
         show more of the board, sharper or closer"
    )]
    NoBoard {
        /// Corners of the largest grid in the image.
        found: usize,
    },
    /// There is a chessboard, but of another size.
    #[error(
        "the chessboard in the image shows {} × {} inner corners, which does not fit one of {} × {}: \
         count the inner corners of the board in use", .found[0], .found[1], .expected[0], .expected[1]
    )]
    WrongSize {
        /// Inner corners seen along the two sides.
        found: [u32; 2],
        /// Columns and rows of the board asked for.
        expected: [u32; 2],
    },
}

/// Finds `board` in `image`.
///
/// `hint` is a camera calibrated roughly, if there is one: it predicts missing corners and tells blunders better than
/// their neighbours do, and knows how edges bend. Without, corners where edges have a radius of 600 px are off by a
/// hundredth of a pixel, all to the same side. Labels, and which of them are certain, are explained at [`Placement`].
///
/// # Errors
/// [`DetectError`] where there is no such board.
pub fn detect(image: &GrayImage, board: &BoardSpec, hint: Option<&KannalaBrandt>) -> Result<Detection, DetectError> {
    let BoardSpec { columns, rows, .. } = *board;
    let sides = 2..=MOST_ALONG_SIDE;
    if !sides.contains(&columns) || !sides.contains(&rows) || ((columns * rows) as usize) < FEWEST_CORNERS {
        return Err(DetectError::UnusableBoard { columns, rows });
    }
    let intensity = Intensity::new(image);
    let mut lattice = search::labelled_patch(image);
    saddle::keep_corners(&mut lattice, &intensity, hint);
    refine::refine_all(&mut lattice, &intensity, None);
    grow::grow(&mut lattice, &intensity, hint, [columns, rows]);
    if lattice.len() < FEWEST_CORNERS {
        return Err(DetectError::NoBoard { found: lattice.len() });
    }
    if hint.is_some() {
        refine::refine_all(&mut lattice, &intensity, hint);
    }
    blunders::flag(&mut lattice, hint);
    let (turned, placement) = placement::place(&lattice, &intensity, hint, [columns, rows])?;
    Ok(Detection::new(&turned, placement, board))
}

impl Detection {
    /// From a lattice whose nodes are columns and rows of the board.
    fn new(lattice: &Lattice, placement: Placement, board: &BoardSpec) -> Self {
        let mut corners: Vec<_> = lattice
            .iter()
            .map(|(&[column, row], found)| DetectedCorner {
                index: column.unsigned_abs() + row.unsigned_abs() * board.columns,
                pixel: Pixel { u: found.position.x, v: found.position.y },
                sigma_px: found.sigma_px,
                filled: found.filled,
                quality: found.quality,
            })
            .collect();
        corners.sort_by_key(|corner| corner.index);
        let good = corners.iter().filter(|corner| corner.quality == CornerQuality::Good).count();
        Self { corners, complete: good as u64 == u64::from(board.columns) * u64::from(board.rows), placement }
    }

    /// The good corners as a calibration takes them.
    #[must_use]
    pub fn view(&self, name: &str, board: &BoardSpec) -> BoardView {
        let good = self.corners.iter().filter(|corner| corner.quality == CornerQuality::Good);
        let corner = |corner: &DetectedCorner| Corner {
            board_mm: board.corner_mm(corner.index),
            pixel: corner.pixel,
            relative_sigma: corner.sigma_px,
        };
        BoardView { name: name.to_owned(), corners: good.map(corner).collect() }
    }
}
