//! OCamCalib's `calib_results.txt`.

use vergence_vision::{ImageSize, OCam};

use crate::rig::Place;
use crate::{ExchangeError, ForeignCamera, Format};

/// Reads the camera: the polynomial, its inverse, which is not needed, the centre, the affine parameters and the size, one a line.
pub fn read(text: &str) -> Result<Vec<ForeignCamera>, ExchangeError> {
    let wrong = |problem: &str| ExchangeError::Wrong { format: Format::OCam, problem: problem.to_owned() };
    let is_said = |line: &&str| !line.trim().is_empty() && !line.trim_start().starts_with('#');
    let numbers = |line: &str| {
        let numbers: Option<Vec<f64>> =
            line.split_whitespace().map(|word| word.parse().ok().filter(|n: &f64| n.is_finite())).collect();
        numbers.ok_or_else(|| wrong(&format!("'{line}' are no numbers")))
    };
    let lines = text.lines().filter(is_said).map(numbers).collect::<Result<Vec<Vec<f64>>, _>>()?;
    let [direct, _, centre, affine, size] = &lines[..] else {
        return Err(wrong(&format!("it has {} lines of numbers, not five", lines.len())));
    };
    let Some((count, polynomial)) = direct.split_first().filter(|(count, rest)| **count == rest.len() as f64) else {
        return Err(wrong("the polynomial has not as many coefficients as its line says"));
    };
    let (&[row, column], &[c, d, e], &[height, width]) = (&centre[..], &affine[..], &size[..]) else {
        return Err(wrong("the centre must have two numbers, the affine parameters three, the size two"));
    };
    let is_side = |side: f64| (1.0..=100_000.0).contains(&side) && side.fract() == 0.0;
    if *count < 3.0 || !is_side(width) || !is_side(height) {
        return Err(wrong("the polynomial has too few coefficients, or the size is none of an image"));
    }
    let place = Place { format: Format::OCam, camera: "camera" };
    let model = OCam::new(polynomial, [row, column], [c, d, e]).map_err(|lens| place.invalid(lens))?;
    let size = ImageSize { width: width as u32, height: height as u32 };
    Ok(vec![ForeignCamera::new("camera", place.central(model)?, size)])
}
