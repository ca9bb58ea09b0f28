//! Single points through a lens: directions to pixels and back, as people write them.

use nalgebra::Vector3;
use serde_json::{Value, json};
use vergence_vision::{Camera, KannalaBrandt, Pixel, UnitRay};

/// What is said of a point that the lens does not map.
const OUTSIDE: &str = "outside the lens's valid cone";

/// Parses a direction such as `0.1,-0.2,-0.05`.
///
/// # Errors
/// A sentence that says what is expected.
pub fn parse_ray(text: &str) -> Result<UnitRay<Camera>, String> {
    let ray: [f64; 3] = numbers(text)?;
    let no_direction = || format!("({}, {}, {}) has no direction: give a ray other than zero", ray[0], ray[1], ray[2]);
    UnitRay::new(Vector3::from(ray)).ok_or_else(no_direction)
}

/// Parses a pixel such as `480,299.5`.
///
/// # Errors
/// A sentence that says what is expected.
pub fn parse_pixel(text: &str) -> Result<Pixel, String> {
    numbers(text).map(|[u, v]| Pixel { u, v })
}

/// `N` numbers between commas.
fn numbers<const N: usize>(text: &str) -> Result<[f64; N], String> {
    let numbers: Result<Vec<f64>, _> = text.split(',').map(|part| part.trim().parse::<f64>()).collect();
    let numbers = numbers.map_err(|error| format!("{error}: write {N} numbers between commas"))?;
    numbers.try_into().map_err(|numbers: Vec<f64>| format!("{} numbers where {N} are needed", numbers.len()))
}

/// The pixels of directions: a line for each, and all of them for programs.
#[must_use]
pub fn project(camera: &KannalaBrandt, rays: &[UnitRay<Camera>]) -> (Vec<String>, Value) {
    let pixels: Vec<_> = rays.iter().map(|ray| camera.project(ray).ok()).collect();
    let line = |pixel: &Option<Pixel>| pixel.map_or_else(|| OUTSIDE.into(), |p| format!("{:.6} {:.6}", p.u, p.v));
    let lines = pixels.iter().map(line).collect();
    (lines, json!({ "pixels": pixels.iter().map(|pixel| pixel.map(|p| [p.u, p.v])).collect::<Vec<_>>() }))
}

/// The directions of pixels: a line for each, and all of them with the origins of their rays for programs.
#[must_use]
pub fn unproject(camera: &KannalaBrandt, pixels: &[Pixel]) -> (Vec<String>, Value) {
    let rays: Vec<_> = pixels.iter().map(|&pixel| camera.unproject::<Camera>(pixel).ok()).collect();
    let origins: Vec<_> =
        rays.iter().map(|ray| ray.as_ref().map(|ray| camera.origin_of(ray).mm().as_slice().to_vec())).collect();
    let rays: Vec<_> = rays.into_iter().map(|ray| ray.map(|ray| ray.vector())).collect();
    let line = |ray: &Option<Vector3<f64>>| {
        ray.map_or_else(|| OUTSIDE.into(), |d| format!("{:.9} {:.9} {:.9}", d.x, d.y, d.z))
    };
    let lines = rays.iter().map(line).collect();
    (
        lines,
        json!({ "rays": rays.iter().map(|ray| ray.map(|d| [d.x, d.y, d.z])).collect::<Vec<_>>(), "origins_mm": origins }),
    )
}
