//! Finds a chessboard in a fisheye image, whole or in part, and measures its corners.
//!
//! `calib-targets-chessboard` searches for corners and labels a patch of them (`search`). From there on:
//!
//! 1. each corner is refined to a fraction of a pixel and must look like a corner (`refine`, `saddle`);
//! 2. the patch grows by predicting its missing neighbours and looking there (`grow`, `predict`);
//! 3. if the camera is known, at least roughly, each corner is refined again along edges bent by its distortion;
//! 4. corners that do not fit a smooth image of a target are flagged (`blunders`);
//! 5. the patch is placed on the target: which corner is the first (`placement`).
//!
//! A ChArUco board is found as a chessboard, and placed by its markers ([`detect_charuco`]). Grids of AprilTags have a search
//! of their own ([`detect_april_grid`]), and the same refinement.

mod april_grid;
mod blunders;
mod charuco;
mod grow;
mod intensity;
mod labelled;
mod lattice;
mod markers;
mod placement;
mod plane;
mod predict;
mod refine;
mod response;
mod saddle;
mod search;
mod searched;
mod tags;

use image::GrayImage;
use vergence_vision::{KannalaBrandt, Pixel};

use crate::{Corner, Relabelling, SeenTarget, TargetKind, TargetSpec, TargetView};
pub use april_grid::detect_april_grid;
pub use charuco::detect_charuco;
use intensity::Intensity;
use placement::Placed;
pub use placement::Placement;
pub use searched::SearchedImage;
pub use tags::{ReadCode, TagFamily};

/// Fewest corners taken for a target. Four determine a pose; a dozen in a grid are no coincidence.
const FEWEST_CORNERS: usize = 12;

/// Most corners along one side of a target; images resolve no more.
const MOST_ALONG_SIDE: u32 = 256;

/// A chessboard found in an image.
#[derive(Clone, Debug, PartialEq)]
pub struct Detection {
    /// Corners in ascending order of index, each at most once.
    pub corners: Vec<DetectedCorner>,
    /// Whether every corner of the target was found and is good.
    pub complete: bool,
    /// Whether the labels hold beyond this image.
    pub placement: Placement,
    /// All labellings that the image allows, as changes of the labels above. One of them changes nothing; it is the only one
    /// where the placement is unique.
    pub labellings: Vec<Relabelling>,
}

/// One corner of a target in an image.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DetectedCorner {
    /// Index on the target, row by row: column + row · columns.
    pub index: u32,
    /// Position in the image.
    pub pixel: Pixel,
    /// Standard deviation per axis in pixels, estimated from how well the surrounding grey levels fit one corner. On
    /// sharp images it is about four times the true error, since blurred edges count as misfit: use it as a weight, not
    /// a bound. 1 if the corner is unrefined.
    pub sigma_px: f64,
    /// Whether the search missed it and prediction from its neighbours found it.
    pub filled: bool,
    /// Quality of the corner.
    pub quality: CornerQuality,
}

/// Whether a corner is fit for calibration.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum CornerQuality {
    /// Measured to a fraction of a pixel and where its neighbours expect it.
    Good,
    /// The refinement left its bounds: the position is that of the search, accurate to about a pixel.
    Unrefined,
    /// Too far from where its neighbours predict it, or its grey levels fit a corner much less than theirs do: partly
    /// covered, or at the edge of the lens's field.
    Blunder,
}

/// Why no target was detected.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum DetectError {
    /// Targets of this size cannot be detected.
    #[error(
        "a target of {columns} × {rows} inner corners cannot be detected: \
         it takes 2 to {MOST_ALONG_SIDE} along a side and at least {FEWEST_CORNERS} in all"
    )]
    UnusableTarget {
        /// Inner corners along x.
        columns: u32,
        /// Inner corners along y.
        rows: u32,
    },
    /// The image shows no chessboard, or too little of one.
    #[error(
        "no chessboard found: {found} corners in a grid, at least {FEWEST_CORNERS} are needed; \
         show more of the target, sharper or closer"
    )]
    NoTarget {
        /// Corners of the largest grid in the image.
        found: usize,
    },
    /// Grids of so many tags cannot be detected.
    #[error(
        "a grid of {columns} × {rows} tags cannot be detected: it takes 1 to 587 tags, of a size, with gaps of up to a side"
    )]
    UnusableGrid {
        /// Tags along x.
        columns: u32,
        /// Tags along y.
        rows: u32,
    },
    /// The image shows too few tags of the grid.
    #[error(
        "no grid of tags found: {found} tags of it, at least 3 are needed; show more of the target, sharper or closer"
    )]
    NoTags {
        /// Number of tags found.
        found: usize,
    },
    /// Boards with so many markers cannot be detected.
    #[error(
        "a ChArUco board of {columns} × {rows} squares cannot be detected: it takes 3 squares along a side at least, markers \
         smaller than the squares, and at most the {most} markers of {dictionary}"
    )]
    UnusableBoard {
        /// Squares along x.
        columns: u32,
        /// Squares along y.
        rows: u32,
        /// Name of the dictionary.
        dictionary: &'static str,
        /// Number of its markers.
        most: usize,
    },
    /// The markers do not tell which corners of the board are seen.
    #[error(
        "{corners} corners of a board are seen, but its markers do not tell which: {read} of {dictionary} are read, and 2 at least \
         and most of them must agree; show more of the board, sharper or closer, and check size, dictionary and pattern"
    )]
    NoMarkers {
        /// Number of corners found.
        corners: usize,
        /// Number of markers read.
        read: usize,
        /// Name of the dictionary.
        dictionary: &'static str,
    },
    /// The image shows a chessboard of another size.
    #[error(
        "the chessboard in the image shows {} × {} inner corners, which does not fit one of {} × {}: \
         count the inner corners of the target in use", .found[0], .found[1], .expected[0], .expected[1]
    )]
    WrongSize {
        /// Inner corners seen along the two sides.
        found: [u32; 2],
        /// Columns and rows of the target asked for.
        expected: [u32; 2],
    },
}

/// Finds `target` in `image`.
///
/// `hint` is a camera calibrated roughly, if there is one: it predicts missing corners and outliers better than their
/// neighbours do, and the bend of edges. Without it, corners where edges have a radius of 600 px are off by 0.01 px,
/// all to the same side. Labels, and which of them are certain, are explained at [`Placement`].
///
/// # Errors [`DetectError`] if the image shows no such target.
pub fn detect(image: &GrayImage, target: &TargetSpec, hint: Option<&KannalaBrandt>) -> Result<Detection, DetectError> {
    detect_from(&SearchedImage::default(), image, target, hint)
}

/// As [`detect`], by what the search found in this image before.
///
/// # Errors [`DetectError`] if the image shows no such target.
pub fn detect_from(
    searched: &SearchedImage,
    image: &GrayImage,
    target: &TargetSpec,
    hint: Option<&KannalaBrandt>,
) -> Result<Detection, DetectError> {
    check_size(target)?;
    let TargetSpec { columns, rows, .. } = *target;
    let intensity = Intensity::new(image);
    let mut lattice = searched.patches(image).first().cloned().unwrap_or_default();
    saddle::keep_corners(&mut lattice, &intensity, hint);
    refine::refine_all(&mut lattice, &intensity, None);
    grow::grow(&mut lattice, &intensity, hint, [columns, rows]);
    if lattice.len() < FEWEST_CORNERS {
        return Err(DetectError::NoTarget { found: lattice.len() });
    }
    if hint.is_some() {
        refine::refine_all(&mut lattice, &intensity, hint);
    }
    blunders::flag(&mut lattice, hint);
    let placed = placement::place(&lattice, &intensity, hint, [columns, rows])?;
    Ok(Detection::new(placed, target))
}

fn check_size(&TargetSpec { columns, rows, .. }: &TargetSpec) -> Result<(), DetectError> {
    let sides = 2..=MOST_ALONG_SIDE;
    let is_usable = sides.contains(&columns) && sides.contains(&rows) && (columns * rows) as usize >= FEWEST_CORNERS;
    if is_usable { Ok(()) } else { Err(DetectError::UnusableTarget { columns, rows }) }
}

/// The good corners of `target` in `image`, which is called `name`, with all labellings that the image allows. `hint` is a
/// camera calibrated roughly, if there is one, as for [`detect`].
///
/// # Errors [`DetectError`] if the image shows no such target.
pub fn see(
    image: &GrayImage,
    target: &TargetKind,
    hint: Option<&KannalaBrandt>,
    name: &str,
) -> Result<SeenTarget, DetectError> {
    see_from(&SearchedImage::default(), image, target, hint, name)
}

/// As [`see`], by what the search found in this image before.
///
/// # Errors [`DetectError`] if the image shows no such target.
pub fn see_from(
    searched: &SearchedImage,
    image: &GrayImage,
    target: &TargetKind,
    hint: Option<&KannalaBrandt>,
    name: &str,
) -> Result<SeenTarget, DetectError> {
    match target {
        TargetKind::Chessboard(board) => Ok(detect_from(searched, image, board, hint)?.seen(name, board)),
        TargetKind::AprilGrid(grid) => {
            let corners = april_grid::detect_from(searched, image, grid, hint)?;
            let view = labelled_view(name, corners, |index| grid.corner_mm(index));
            Ok(SeenTarget::certain(view, grid.tag))
        }
        TargetKind::Charuco(board) => {
            let corners = charuco::detect_from(searched, image, board, hint)?;
            let view = labelled_view(name, corners, |index| board.corner_mm(index));
            Ok(SeenTarget::certain(view, board.square))
        }
    }
}

/// Corners whose labels are certain as a view for calibration.
fn labelled_view(name: &str, corners: Vec<DetectedCorner>, target_mm: impl Fn(u32) -> [f64; 2]) -> TargetView {
    let corner = |corner: DetectedCorner| Corner {
        target_mm: target_mm(corner.index),
        pixel: corner.pixel,
        relative_sigma: corner.sigma_px,
    };
    TargetView { name: name.to_owned(), corners: corners.into_iter().map(corner).collect() }
}

impl Detection {
    /// Detection from a lattice whose nodes are columns and rows of the target.
    fn new(Placed { lattice, placement, labellings }: Placed, target: &TargetSpec) -> Self {
        let mut corners: Vec<_> = lattice
            .iter()
            .map(|(&[column, row], found)| DetectedCorner {
                index: column.unsigned_abs() + row.unsigned_abs() * target.columns,
                pixel: Pixel { u: found.position.x, v: found.position.y },
                sigma_px: found.sigma_px,
                filled: found.filled,
                quality: found.quality,
            })
            .collect();
        corners.sort_by_key(|corner| corner.index);
        let good = corners.iter().filter(|corner| corner.quality == CornerQuality::Good).count();
        let complete = good as u64 == u64::from(target.columns) * u64::from(target.rows);
        Self { corners, complete, placement, labellings }
    }

    /// The good corners with all labellings that the image allows.
    #[must_use]
    pub fn seen(&self, name: &str, target: &TargetSpec) -> SeenTarget {
        SeenTarget { view: self.view(name, target), labellings: self.labellings.clone(), pitch: target.square }
    }

    /// The good corners as a view for calibration.
    #[must_use]
    pub fn view(&self, name: &str, target: &TargetSpec) -> TargetView {
        let good = self.corners.iter().filter(|corner| corner.quality == CornerQuality::Good);
        let corner = |corner: &DetectedCorner| Corner {
            target_mm: target.corner_mm(corner.index),
            pixel: corner.pixel,
            relative_sigma: corner.sigma_px,
        };
        TargetView { name: name.to_owned(), corners: good.map(corner).collect() }
    }
}
