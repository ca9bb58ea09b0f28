//! Pictures of a look: matches between both views, and range as colour beside the truth.

use image::{RgbImage, imageops};
use imageproc::drawing::{draw_antialiased_line_segment_mut, draw_filled_circle_mut};
use imageproc::pixelops::interpolate;
use vergence_vision::{Length, Pixel};

use super::range_scale::{BAR_HEIGHT, MARGIN, RangeScale, dimmed};
use super::text::write_text;
use crate::look::{ColouredPoint, Eyes};

/// More lines than this hide each other.
const MOST_LINES: usize = 150;
const DOT_RADIUS: i32 = 4;

/// A range map to compare with: for a pixel of the left image, the true range.
pub type TrueRange<'a> = &'a (dyn Fn(Pixel) -> Option<Length> + Sync);

/// What a depth picture shows.
pub struct DepthPicture<'a> {
    /// The left image.
    pub left: &'a RgbImage,
    /// The measured points.
    pub points: &'a [ColouredPoint],
    /// The truth, where it is known.
    pub truth: Option<TrueRange<'a>>,
}

/// Both views side by side; every point as a dot in each, some of them joined by a line, coloured by range.
#[must_use]
pub fn match_picture(eyes: Eyes<'_>, points: &[ColouredPoint]) -> RgbImage {
    let scale = RangeScale::of(points.iter().map(range));
    let (width, height) = eyes.left.dimensions();
    let mut canvas = RgbImage::new(2 * width, height + BAR_HEIGHT);
    imageops::replace(&mut canvas, &dimmed(eyes.left), 0, 0);
    imageops::replace(&mut canvas, &dimmed(eyes.right), i64::from(width), 0);
    let ends = |p: &ColouredPoint| {
        let (left, right) = (p.point.pixels.left, p.point.pixels.right);
        [rounded(left, 0), rounded(right, width)]
    };
    let stride = points.len().div_ceil(MOST_LINES).max(1);
    for point in points.iter().step_by(stride) {
        let [from, to] = ends(point);
        draw_antialiased_line_segment_mut(&mut canvas, from, to, scale.colour(range(point)), interpolate);
    }
    for point in points {
        for centre in ends(point) {
            draw_filled_circle_mut(&mut canvas, centre, DOT_RADIUS - 1, scale.colour(range(point)));
        }
    }
    scale.draw(&mut canvas, &format!("{} points", points.len()));
    canvas
}

/// The measured points on the left image, coloured by range; beside them the truth in the same colours.
#[must_use]
pub fn depth_picture(picture: &DepthPicture<'_>) -> RgbImage {
    let scale = RangeScale::of(picture.points.iter().map(range));
    let (width, height) = picture.left.dimensions();
    let panels = if picture.truth.is_some() { 2 } else { 1 };
    let mut canvas = RgbImage::new(panels * width, height + BAR_HEIGHT);
    imageops::replace(&mut canvas, &dimmed(picture.left), 0, 0);
    for point in picture.points {
        let centre = rounded(point.point.pixels.left, 0);
        draw_filled_circle_mut(&mut canvas, centre, DOT_RADIUS, scale.colour(range(point)));
    }
    write_text(&mut canvas, (MARGIN, MARGIN), 2, "measured");
    if let Some(truth) = picture.truth {
        for (x, y) in (0..height).flat_map(|y| (0..width).map(move |x| (x, y))) {
            if let Some(range) = truth(Pixel { u: f64::from(x), v: f64::from(y) }) {
                canvas.put_pixel(width + x, y, scale.colour(range));
            }
        }
        write_text(&mut canvas, (width + MARGIN, MARGIN), 2, "truth");
    }
    scale.draw(&mut canvas, "");
    canvas
}

fn range(point: &ColouredPoint) -> Length {
    Length::from_mm(point.point.point.mm().norm())
}

fn rounded(pixel: Pixel, shift: u32) -> (i32, i32) {
    (pixel.u.round() as i32 + shift.cast_signed(), pixel.v.round() as i32)
}
