//! COLMAP's `cameras.txt`: one camera a line. There the centre of the first pixel is at 0.5. Its poses have no unit and are not read.

use vergence_vision::{CameraModel, ImageSize, Pinhole, Radtan};

use crate::rig::Place;
use crate::{ExchangeError, ForeignCamera, Format};

/// COLMAP's models, and how many parameters each has.
const MODELS: [(&str, usize); 11] = [
    ("SIMPLE_PINHOLE", 3),
    ("PINHOLE", 4),
    ("SIMPLE_RADIAL", 4),
    ("RADIAL", 5),
    ("OPENCV", 8),
    ("OPENCV_FISHEYE", 8),
    ("FULL_OPENCV", 12),
    ("FOV", 5),
    ("SIMPLE_RADIAL_FISHEYE", 4),
    ("RADIAL_FISHEYE", 5),
    ("THIN_PRISM_FISHEYE", 12),
];

/// Whether a line is that of a camera.
pub fn is_camera(line: &str) -> bool {
    let mut words = line.split_whitespace();
    let is_number = words.next().is_some_and(|id| id.parse::<u32>().is_ok());
    is_number && words.next().is_some_and(|model| MODELS.iter().any(|(name, _)| *name == model))
}

/// Reads all cameras.
pub fn read(text: &str) -> Result<Vec<ForeignCamera>, ExchangeError> {
    let is_said = |line: &&str| !line.trim().is_empty() && !line.trim_start().starts_with('#');
    text.lines().filter(is_said).map(camera).collect()
}

fn camera(line: &str) -> Result<ForeignCamera, ExchangeError> {
    let wrong = |problem: &str| ExchangeError::Wrong { format: Format::Colmap, problem: format!("'{line}' {problem}") };
    let words: Vec<_> = line.split_whitespace().collect();
    let [id, model, width, height, values @ ..] = &words[..] else { return Err(wrong("is no line of a camera")) };
    let Some((_, count)) = MODELS.iter().find(|(name, _)| name == model) else {
        return Err(wrong("is of an unknown model"));
    };
    let side = |text: &str| text.parse().ok().filter(|pixels| (1..=100_000).contains(pixels));
    let (Some(width), Some(height)) = (side(width), side(height)) else { return Err(wrong("has no size of images")) };
    let size = ImageSize { width, height };
    let values: Option<Vec<f64>> =
        values.iter().map(|value| value.parse().ok().filter(|v: &f64| v.is_finite())).collect();
    let values = values
        .filter(|values| values.len() == *count)
        .ok_or_else(|| wrong(&format!("must have {count} numbers after the size of images")))?;
    let place = Place { format: Format::Colmap, camera: id };
    let model = self::model(model, &values, size, &place)?.ok_or_else(|| {
        wrong("is of a model that is not read: the pinhole, radial, OpenCV and radial fisheye models are")
    })?;
    Ok(ForeignCamera::new(*id, model, size))
}

/// The model; `None` of one that is not read.
fn model(
    name: &str,
    values: &[f64],
    size: ImageSize,
    place: &Place<'_>,
) -> Result<Option<Box<dyn CameraModel>>, ExchangeError> {
    let pinhole = |[fx, fy, cx, cy]: [f64; 4]| [fx, fy, cx - 0.5, cy - 0.5];
    let plane = |at: [f64; 4], coefficients: &[f64]| {
        let distortion = Radtan::new(coefficients);
        distortion.map(|distortion| place.central(Pinhole { pinhole: pinhole(at), distortion })).transpose()
    };
    let fisheye = |at: [f64; 4], k: [f64; 4]| place.fisheye(pinhole(at), k, size, None).map(Some);
    match (name, values) {
        ("SIMPLE_PINHOLE", &[f, cx, cy]) => plane([f, f, cx, cy], &[]),
        ("PINHOLE", &[fx, fy, cx, cy]) => plane([fx, fy, cx, cy], &[]),
        ("SIMPLE_RADIAL", &[f, cx, cy, k]) => plane([f, f, cx, cy], &[k, 0.0, 0.0, 0.0]),
        ("RADIAL", &[f, cx, cy, k1, k2]) => plane([f, f, cx, cy], &[k1, k2, 0.0, 0.0]),
        ("OPENCV", &[fx, fy, cx, cy, ref distortion @ ..]) => plane([fx, fy, cx, cy], distortion),
        ("FULL_OPENCV", &[fx, fy, cx, cy, ref distortion @ ..]) => plane([fx, fy, cx, cy], distortion),
        ("OPENCV_FISHEYE", &[fx, fy, cx, cy, k1, k2, k3, k4]) => fisheye([fx, fy, cx, cy], [k1, k2, k3, k4]),
        ("SIMPLE_RADIAL_FISHEYE", &[f, cx, cy, k]) => fisheye([f, f, cx, cy], [k, 0.0, 0.0, 0.0]),
        ("RADIAL_FISHEYE", &[f, cx, cy, k1, k2]) => fisheye([f, f, cx, cy], [k1, k2, 0.0, 0.0]),
        _ => Ok(None),
    }
}
