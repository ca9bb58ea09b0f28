//! How much the surroundings of each pixel look like the corner of four squares: the response of ChESS.
//!
//! S. Bennett and J. Lasenby, "ChESS: quick and robust detection of chess-target features", CVIU 118, 2014, section 2. The same numbers as of
//! `chess_corners_core::chess_response_u8`, for a row of pixels side by side in vector instructions.

use chess_corners_core::ResponseMap;
use image::GrayImage;
use multiversion::multiversion;

/// The ring about a pixel, clockwise from above.
const RING: [[isize; 2]; 16] = [
    [0, -5],
    [2, -5],
    [3, -3],
    [5, -2],
    [5, 0],
    [5, 2],
    [3, 3],
    [2, 5],
    [0, 5],
    [-2, 5],
    [-3, 3],
    [-5, 2],
    [-5, 0],
    [-5, -2],
    [-3, -3],
    [-2, -5],
];
/// The pixel and its neighbours.
const CROSS: [[isize; 2]; 5] = [[0, 0], [0, -1], [0, 1], [1, 0], [-1, 0]];
/// How far the ring reaches.
const REACH: usize = 5;
/// Pixels side by side.
const LANES: usize = 32;
/// The narrowest image whose rows fill all lanes.
const NARROWEST: usize = LANES + 2 * REACH;

/// The response of every pixel, zero where the ring leaves the image; `None` for an image too narrow for vectors.
pub fn response(image: &GrayImage) -> Option<ResponseMap> {
    let [width, height] = [image.width() as usize, image.height() as usize];
    if width < NARROWEST || height <= 2 * REACH {
        return None;
    }
    let mut response = vec![0.0; width * height];
    for y in REACH..height - REACH {
        let row = response.get_mut(y * width..)?.get_mut(REACH..width - REACH)?;
        respond(image.as_raw(), width, y * width + REACH, row);
    }
    Some(ResponseMap::new(width, height, response))
}

/// The responses of a row of pixels, the first of them at `first` of the image. The last lanes overlap those before.
#[multiversion(targets("x86_64+avx512f+avx512bw+avx512vl+avx2", "x86_64+avx2"))]
fn respond(image: &[u8], width: usize, first: usize, row: &mut [f32]) {
    let last = row.len() - LANES;
    for start in (0..last).step_by(LANES).chain([last]) {
        let pixels = |[x, y]: [isize; 2]| {
            let at = (first + start).wrapping_add_signed(y * width as isize + x);
            // Sums of these are whole numbers, and exact.
            let mut levels = [0.0f32; LANES];
            for (level, byte) in levels.iter_mut().zip(&image[at..at + LANES]) {
                *level = f32::from(*byte);
            }
            levels
        };
        let ring = RING.map(pixels);
        let cross = CROSS.map(pixels);
        let mut responses = [0.0f32; LANES];
        for i in 0..LANES {
            let s = |k: usize| -> f32 { ring[k][i] };
            let (mut sum, mut square, mut difference, mut middle) = (0.0, 0.0, 0.0, 0.0);
            for k in 0..4 {
                square += ((s(k) + s(k + 8)) - (s(k + 4) + s(k + 12))).abs();
            }
            for k in 0..8 {
                sum += s(k) + s(k + 8);
                difference += (s(k) - s(k + 8)).abs();
            }
            for pixels in &cross {
                middle += pixels[i];
            }
            let off: f32 = (sum / 16.0 - middle / 5.0f32).abs();
            responses[i] = square - difference - 16.0 * off;
        }
        row[start..start + LANES].copy_from_slice(&responses);
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::expect_used, reason = "a test fails loudly")]

    use chess_corners_core::{ChessParams, chess_response_u8};
    use image::Luma;

    use super::*;

    #[test]
    fn vectors_give_the_response_of_single_pixels() {
        for [width, height] in [[42, 11], [43, 12], [73, 40], [106, 17], [200, 33]] {
            let image = GrayImage::from_fn(width, height, |x, y| Luma([(x * x * 37 + y * 101 + x * y * 13) as u8]));
            let ours = response(&image).expect("wide enough");
            let theirs = chess_response_u8(image.as_raw(), width as usize, height as usize, &ChessParams::default());
            assert_eq!(ours.data(), theirs.data(), "{width} x {height}");
        }
        assert!(response(&GrayImage::new(41, 50)).is_none() && response(&GrayImage::new(50, 10)).is_none());
    }
}
