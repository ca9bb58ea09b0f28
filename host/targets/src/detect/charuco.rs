//! Finds a ChArUco board, whole or in part.
//!
//! 1. Its corners are found as a chessboard's (`search`, `grow`), but looked at more closely: the markers in the white squares
//!    begin not far from the corners.
//! 2. The markers tell where on the board the corners lie (`markers`).
//! 3. Corners that were missed are looked for where the others predict them, and those unlike the others are dropped
//!    (`labelled`).

use image::GrayImage;
use nalgebra::Vector2;
use vergence_vision::{KannalaBrandt, Pixel};

use super::intensity::Intensity;
use super::labelled::{Corners, LabelledTarget, Place};
use super::lattice::{Found, Lattice};
use super::saddle::parity;
use super::{CornerQuality, DetectError, DetectedCorner, FEWEST_CORNERS, SearchedImage};
use super::{blunders, grow, markers, refine, saddle};
use crate::CharucoSpec;

/// The corners of the board in `image`, in ascending order of index, as OpenCV counts them. `hint` is a camera calibrated
/// roughly, if there is one.
///
/// # Errors
/// [`DetectError`] if the image shows too few corners, or its markers do not tell which they are.
pub fn detect_charuco(
    image: &GrayImage,
    board: &CharucoSpec,
    hint: Option<&KannalaBrandt>,
) -> Result<Vec<DetectedCorner>, DetectError> {
    detect_from(&SearchedImage::default(), image, board, hint)
}

/// The same by what the search found in this image before.
pub fn detect_from(
    searched: &SearchedImage,
    image: &GrayImage,
    board: &CharucoSpec,
    hint: Option<&KannalaBrandt>,
) -> Result<Vec<DetectedCorner>, DetectError> {
    if !board.is_usable() {
        return Err(DetectError::UnusableBoard {
            columns: board.columns,
            rows: board.rows,
            dictionary: board.dictionary.name,
            most: board.dictionary.codes.len(),
        });
    }
    let intensity = Intensity::new(image);
    let target = LabelledTarget { image: &intensity, hint, places: places(board) };
    let (mut corners, mut problem) = (Corners::new(), None);
    for patches_of in [SearchedImage::patches, SearchedImage::patches_of_half] {
        if corners.len() as u32 == board.corners() {
            break;
        }
        // Something before the board may divide it.
        for patch in patches_of(searched, image) {
            match labelled(patch.clone(), &target, board) {
                Ok(found) => found.into_iter().for_each(|(index, corner)| {
                    corners.entry(index).or_insert(corner);
                }),
                Err(error) => problem = problem.or(Some(error)),
            }
        }
    }
    corners = target.judged(target.completed(corners));
    if corners.len() < FEWEST_CORNERS {
        return Err(problem.unwrap_or(DetectError::NoTarget { found: corners.len() }));
    }
    Ok(corners.into_values().collect())
}

/// The corners of a patch of the board, by index.
fn labelled(patch: Lattice, target: &LabelledTarget<'_>, board: &CharucoSpec) -> Result<Corners, DetectError> {
    let (image, hint) = (target.image, target.hint);
    let size = [board.columns - 1, board.rows - 1];
    let mut lattice = patch.looked_at_within(clear(board));
    saddle::keep_corners(&mut lattice, image, hint);
    refine::refine_all(&mut lattice, image, None);
    grow::grow(&mut lattice, image, hint, size);
    if hint.is_some() {
        refine::refine_all(&mut lattice, image, hint);
    }
    blunders::flag(&mut lattice, hint);
    let few = (lattice.len() < FEWEST_CORNERS).then_some(DetectError::NoTarget { found: lattice.len() });
    let way = markers::place(&lattice, image, hint, board).map_err(|error| few.unwrap_or(error))?;
    let good = lattice.iter().filter(|(_, found)| found.quality == CornerQuality::Good);
    let on_board = good.filter_map(|(&node, found)| {
        let [column, row] = way.node(node).map(|n| u32::try_from(n).ok());
        let (column, row) = (column.filter(|n| *n < size[0])?, row.filter(|n| *n < size[1])?);
        let index = column + row * size[0];
        Some((index, corner(index, found)))
    });
    Ok(on_board.collect())
}

/// Part of a square's side in which a corner's surroundings are as on a chessboard: about twice the way to the markers.
fn clear(board: &CharucoSpec) -> f64 {
    (2.2 * board.margin()).min(1.0)
}

fn corner(index: u32, found: &Found) -> DetectedCorner {
    let pixel = Pixel { u: found.position.x, v: found.position.y };
    DetectedCorner { index, pixel, sigma_px: found.sigma_px, filled: found.filled, quality: found.quality }
}

/// The inner corners by index, in cells.
fn places(board: &CharucoSpec) -> Vec<Place> {
    let first = if board.is_white_first() { 1.0 } else { -1.0 };
    let columns = board.columns - 1;
    let place = |index: u32| {
        let [column, row] = [index % columns, index / columns];
        let cell = Vector2::new(f64::from(column), f64::from(row)) / clear(board);
        Place { cell, colour: first * parity([column, row].map(u32::cast_signed)) }
    };
    (0..board.corners()).map(place).collect()
}
