//! The first patch of corners: ChESS features labelled by topology.
//!
//! S. Bennett and J. Lasenby, "ChESS: quick and robust detection of chess-target features", CVIU 118, 2014.

use calib_targets_chessboard::{
    ChessCorner, ChessboardDetection, ChessboardDetector, ChessboardParams, GrayImageView, default_chess_config,
    detect_corners,
};
use image::GrayImage;
use image::imageops::thumbnail;
use nalgebra::Vector2;

use super::CornerQuality;
use super::lattice::{Found, Lattice};

/// Standard deviation of a corner found by the search alone, in pixels.
const SEARCH_SIGMA_PX: f64 = 1.0;

/// Everything in the image that looks like a corner of squares, whatever it belongs to.
pub fn features(image: &GrayImage) -> Vec<ChessCorner> {
    // The search itself panics on an empty image; nothing this small holds a dozen corners.
    const SMALLEST_PX: u32 = 16;
    if image.width().min(image.height()) < SMALLEST_PX {
        return Vec::new();
    }
    let view = GrayImageView { width: image.width() as usize, height: image.height() as usize, data: image.as_raw() };
    detect_corners(&view, &default_chess_config())
}

/// The labelled patches in the image, the largest first. The first axis turns clockwise into the second as they are seen, as x
/// into y on the printed side of a target.
pub fn labelled_patches(image: &GrayImage) -> Vec<Lattice> {
    let features = features(image);
    let detector = ChessboardDetector::new(ChessboardParams::default());
    let patches = detector.map(|detector| detector.detect_all(&features)).unwrap_or_default();
    let lattice = |patch: &ChessboardDetection| {
        let mut lattice = Lattice::default();
        for corner in &patch.corners {
            let position = Vector2::new(f64::from(corner.position.x), f64::from(corner.position.y));
            let found = Found { position, sigma_px: SEARCH_SIGMA_PX, filled: false, quality: CornerQuality::Unrefined };
            lattice.insert([corner.grid.u, corner.grid.v], found);
        }
        if winding(&lattice) < 0.0 { lattice.relabelled(|[i, j]| [j, i]) } else { lattice }
    };
    patches.iter().map(lattice).collect()
}

/// The same in an image of half the size, in pixels of `image`: there the cells of markers are too small to look like corners.
pub fn labelled_patches_of_half(image: &GrayImage) -> Vec<Lattice> {
    let [width, height] = [image.width() / 2, image.height() / 2];
    if width.min(height) == 0 {
        return Vec::new();
    }
    let mut patches = labelled_patches(&thumbnail(image, width, height));
    let scale =
        Vector2::new(f64::from(image.width()) / f64::from(width), f64::from(image.height()) / f64::from(height));
    for patch in &mut patches {
        patch.move_each(|position| position.add_scalar(0.5).component_mul(&scale).add_scalar(-0.5));
    }
    patches
}

/// Sum of the signed areas of the cells.
fn winding(lattice: &Lattice) -> f64 {
    let area = |&[i, j]: &[i32; 2], found: &Found| {
        let right = lattice.get([i + 1, j])?.position - found.position;
        let down = lattice.get([i, j + 1])?.position - found.position;
        Some(right.perp(&down))
    };
    lattice.iter().filter_map(|(node, found)| area(node, found)).sum()
}
