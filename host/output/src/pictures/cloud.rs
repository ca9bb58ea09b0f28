//! Pictures of a cloud as SVG: matches between both images, ranges beside the truth, and errors of the ranges.

use std::path::Path;

use image::{ImageError, ImageFormat, Rgb, RgbImage};
use vergence_files::{FileError, write_png};
use vergence_pipeline::{ColouredPoint, PairCloud, PairImages};
use vergence_vision::{Length, Pixel};

use super::panels::{ColourScale, Panels, light_grey};
use super::write_drawing;
use crate::points::write_cloud;

/// Most lines drawn between both images: more would hide each other.
const MOST_LINES: usize = 150;

/// The true range at a pixel of the left image, where there is one.
type TrueRange<'a> = &'a (dyn Fn(Pixel) -> Option<Length> + Sync);

/// Both images side by side; every point as a dot in each, coloured by range, some of them joined by a line.
///
/// # Errors
/// Where an image cannot be encoded.
pub fn match_svg(images: PairImages<'_>, cloud: &PairCloud) -> Result<String, ImageError> {
    let scale = ColourScale::of_ranges(cloud.points.iter().map(range_mm));
    let mut panels = Panels::new(images.left.dimensions(), &["left image", "right image"]);
    panels.image(0, &light_grey(images.left), ImageFormat::Jpeg)?;
    panels.image(1, &light_grey(images.right), ImageFormat::Jpeg)?;
    let every = cloud.points.len().div_ceil(MOST_LINES).max(1);
    for point in cloud.points.iter().step_by(every) {
        let pixels = point.point.pixels;
        panels.line((0, pixels.left), (1, pixels.right), scale.colour(range_mm(point)));
    }
    for point in &cloud.points {
        let (pixels, colour) = (point.point.pixels, scale.colour(range_mm(point)));
        panels.dot(0, pixels.left, colour);
        panels.dot(1, pixels.right, colour);
    }
    let lines = if every == 1 { String::new() } else { format!("; one line for every {every} points") };
    let note = format!("range of {} points of {} matches{lines}", cloud.points.len(), cloud.matches);
    Ok(panels.finish(&scale, &note))
}

/// The measured points on the left image, and beside it the true range of every pixel in the same colours.
///
/// # Errors
/// Where an image cannot be encoded.
pub fn depth_svg(left: &RgbImage, points: &[ColouredPoint], truth: TrueRange<'_>) -> Result<String, ImageError> {
    let scale = ColourScale::of_ranges(points.iter().map(range_mm));
    let mut panels = Panels::new(left.dimensions(), &["measured", "truth"]);
    panels.image(0, &light_grey(left), ImageFormat::Jpeg)?;
    let (width, height) = left.dimensions();
    let true_colours = RgbImage::from_fn(width, height, |x, y| {
        let range = truth(Pixel { u: f64::from(x), v: f64::from(y) });
        Rgb(range.map_or([255; 3], |range| scale.colour(range.mm())))
    });
    panels.image(1, &true_colours, ImageFormat::Png)?;
    for point in points {
        panels.dot(0, point.point.pixels.left, scale.colour(range_mm(point)));
    }
    Ok(panels.finish(&scale, &format!("range of {} points, and the true range of every pixel", points.len())))
}

/// The measured points on the left image, coloured by the relative error of their range.
///
/// # Errors
/// Where the image cannot be encoded.
pub fn error_svg(left: &RgbImage, points: &[ColouredPoint], truth: TrueRange<'_>) -> Result<String, ImageError> {
    const LOW: f64 = 1e-3;
    const HIGH: f64 = 1e-1;
    let scale = ColourScale::new(LOW, HIGH, |error| format!("{:.1} %", 100.0 * error));
    let mut panels = Panels::new(left.dimensions(), &["error of the range"]);
    panels.image(0, &light_grey(left), ImageFormat::Jpeg)?;
    let mut without_truth = 0;
    for point in points {
        let pixel = point.point.pixels.left;
        let Some(truth) = truth(pixel) else {
            without_truth += 1;
            continue;
        };
        panels.dot(0, pixel, scale.colour((range_mm(point) / truth.mm() - 1.0).abs()));
    }
    let shown = points.len() - without_truth;
    Ok(panels.finish(
        &scale,
        &format!("|measured - true| / true of {shown} points; the ends of the scale include all beyond"),
    ))
}

fn range_mm(point: &ColouredPoint) -> f64 {
    point.point.point.mm().norm()
}

/// Writes the files of a pair whose truth is known to `folder`, under names that begin with `name`: the cloud, both images,
/// and pictures of matches, ranges and errors.
///
/// # Errors
/// [`FileError::Write`].
pub fn write_scored_pair(
    folder: &Path,
    name: &str,
    images: PairImages<'_>,
    cloud: &PairCloud,
    truth: TrueRange<'_>,
) -> Result<(), FileError> {
    let file = |suffix: &str| folder.join(format!("{name}{suffix}"));
    write_cloud(&file(".ply"), &cloud.points, false, [])?;
    write_png(&file("-left.png"), images.left)?;
    write_png(&file("-right.png"), images.right)?;
    write_drawing(&file("-matches.svg"), match_svg(images, cloud))?;
    write_drawing(&file("-depth.svg"), depth_svg(images.left, &cloud.points, truth))?;
    write_drawing(&file("-error.svg"), error_svg(images.left, &cloud.points, truth))
}
