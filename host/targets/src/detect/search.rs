//! The first patch of corners: ChESS features labelled by topology.
//!
//! S. Bennett and J. Lasenby, "ChESS: quick and robust detection of chess-target features", CVIU 118, 2014.

use calib_targets_chessboard::{
    ChessCorner, ChessboardDetection, ChessboardDetector, ChessboardParams, default_chess_config,
};
use chess_corners_core::{
    CenterOfMassRefiner, CornerDescriptor, CornerRefiner, chess_response_u8, describe_corners,
    detect_peaks_from_response_with_refine_radius, merge_corners_simple, refine_corners_on_image,
};
use image::GrayImage;
use image::imageops::thumbnail;
use nalgebra::Vector2;

use super::CornerQuality;
use super::lattice::{Found, Lattice};
use super::response::response;

/// Standard deviation of a corner found by the search alone, in pixels.
const SEARCH_SIGMA_PX: f64 = 1.0;

/// Everything in the image that looks like a corner of squares, whatever it belongs to.
pub fn features(image: &GrayImage) -> Vec<ChessCorner> {
    // The search itself panics on an empty image; nothing this small holds a dozen corners.
    const SMALLEST_PX: u32 = 16;
    if image.width().min(image.height()) < SMALLEST_PX {
        return Vec::new();
    }
    let (config, [width, height]) = (default_chess_config(), [image.width() as usize, image.height() as usize]);
    let params = config.chess_params();
    let response = response(image).unwrap_or_else(|| chess_response_u8(image.as_raw(), width, height, &params));
    let mut refiner = CenterOfMassRefiner::new(params.center_of_mass);
    let peaks = detect_peaks_from_response_with_refine_radius(&response, &params, refiner.radius());
    let mut corners = refine_corners_on_image(peaks, None, Some(&response), &mut refiner);
    let merged = merge_corners_simple(&mut corners, config.merge_radius);
    let method = params.orientation_method;
    describe_corners(image.as_raw(), width, height, params.ring_radius(), merged, method).iter().map(feature).collect()
}

fn feature(found: &CornerDescriptor) -> ChessCorner {
    let mut feature = ChessCorner::new(nalgebra::Point2::new(found.x, found.y), Default::default(), found.response);
    for (axis, found) in feature.axes.iter_mut().zip(found.axes.iter().flatten()) {
        (axis.angle, axis.fit_std_error) = (found.angle, found.fit_std_error);
    }
    feature
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

#[cfg(test)]
mod tests {
    use calib_targets_chessboard::{GrayImageView, detect_corners};
    use image::Luma;

    use super::*;

    /// Squares with noise: hundreds of features, wanted and unwanted.
    #[test]
    fn features_are_those_of_the_library() {
        for [width, height] in [[240, 190], [40, 300]] {
            let level = |x: u32, y: u32| {
                let noise = (x * x * 31 + y * 57 + x * y * 13) % 41;
                if (x / 17 + y / 17).is_multiple_of(2) { 30 + noise } else { 170 + noise }
            };
            let image = GrayImage::from_fn(width, height, |x, y| Luma([level(x, y) as u8]));
            let view = GrayImageView { width: width as usize, height: height as usize, data: image.as_raw() };
            let (ours, theirs) = (features(&image), detect_corners(&view, &default_chess_config()));
            assert!(theirs.len() > 20, "{} features", theirs.len());
            assert_eq!(ours, theirs, "{width} x {height}");
        }
    }
}
