//! Small texts on pictures.

use font8x8::UnicodeFonts;
use image::{Rgb, RgbImage};

/// Height of a letter at scale 1, in pixels.
const LETTER: u32 = 8;

/// Writes `text` with its top-left corner at (`x`, `y`), each letter `8 * scale` pixels wide. What does not fit is cut off.
pub fn write_text(image: &mut RgbImage, (x, y): (u32, u32), scale: u32, text: &str) {
    for (letter, index) in text.chars().zip(0u32..) {
        let Some(rows) = font8x8::BASIC_FONTS.get(letter).or_else(|| font8x8::LATIN_FONTS.get(letter)) else {
            continue;
        };
        for (bits, row) in rows.into_iter().zip(0u32..) {
            for column in (0..LETTER).filter(|column| bits & (1 << column) != 0) {
                let left = x + (index * LETTER + column) * scale;
                fill(image, (left, y + row * scale), (scale, scale), [255; 3]);
            }
        }
    }
}

/// Fills a rectangle with one colour, as far as it lies in the image.
pub fn fill(image: &mut RgbImage, (x, y): (u32, u32), (width, height): (u32, u32), colour: [u8; 3]) {
    for row in y..(y + height).min(image.height()) {
        for column in x..(x + width).min(image.width()) {
            image.put_pixel(column, row, Rgb(colour));
        }
    }
}
