//! How far two calibrations of one camera differ.

use nalgebra::{Matrix3, Rotation3, Vector3};
use vergence_vision::{Angle, Camera, KannalaBrandt, Pixel};

/// Number of columns, and of rows, of the grid of pixels whose rays are compared.
const GRID: u32 = 60;
/// Fewer rays say nothing.
const FEWEST_RAYS: usize = 10;

/// Angles between the rays of two calibrations of one camera for the same pixels, on a grid over the image. The rotation that
/// fits the rays best is removed first: it is a difference of pose, not of the lens.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LensDifference {
    /// Median.
    pub median: Angle,
    /// 95 % of the rays differ by no more.
    pub p95: Angle,
    /// Largest.
    pub worst: Angle,
    /// Angle of the rotation that was removed.
    pub turn: Angle,
    /// Number of rays compared.
    pub places: usize,
}

/// Why two cameras cannot be compared.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum LensDifferenceError {
    /// They have images of different sizes.
    #[error("the cameras have different image sizes: two calibrations of one camera have the same")]
    Sizes,
    /// There are too few pixels at which both are valid.
    #[error("the fields of the cameras hardly overlap: too few rays to compare")]
    FewRays,
}

impl LensDifference {
    /// Compares `a` and `b` up to the angle `field` from the optical axis; without it, wherever both are valid.
    ///
    /// # Errors
    /// [`LensDifferenceError`].
    pub fn between(a: &KannalaBrandt, b: &KannalaBrandt, field: Option<Angle>) -> Result<Self, LensDifferenceError> {
        if a.size() != b.size() {
            return Err(LensDifferenceError::Sizes);
        }
        let rays = rays(a, b, field);
        if rays.len() < FEWEST_RAYS {
            return Err(LensDifferenceError::FewRays);
        }
        let turn = best_rotation(&rays);
        let mut angles: Vec<f64> =
            rays.iter().map(|(a, b)| (turn * b).cross(a).norm().atan2((turn * b).dot(a))).collect();
        angles.sort_by(f64::total_cmp);
        let at = |share: f64| {
            Angle::from_rad(angles.get(((angles.len() - 1) as f64 * share) as usize).copied().unwrap_or(0.0))
        };
        let (median, p95, worst) = (at(0.5), at(0.95), at(1.0));
        Ok(Self { median, p95, worst, turn: Angle::from_rad(turn.angle()), places: angles.len() })
    }
}

/// Rays of both cameras for the same pixels, on a grid.
fn rays(a: &KannalaBrandt, b: &KannalaBrandt, field: Option<Angle>) -> Vec<(Vector3<f64>, Vector3<f64>)> {
    let size = a.size();
    let inside = |ray: &Vector3<f64>| field.is_none_or(|field| ray.z.acos() <= field.rad());
    let position = |index: u32, extent: u32| (f64::from(index) + 0.5) * f64::from(extent) / f64::from(GRID) - 0.5;
    (0..GRID * GRID)
        .filter_map(|index| {
            let pixel = Pixel { u: position(index % GRID, size.width), v: position(index / GRID, size.height) };
            let of = |camera: &KannalaBrandt| camera.unproject::<Camera>(pixel).ok().map(|ray| ray.vector());
            Some((of(a)?, of(b)?)).filter(|(ray, _)| inside(ray))
        })
        .collect()
}

/// The rotation that turns the second rays onto the first (Kabsch 1976; all rays weigh the same).
fn best_rotation(rays: &[(Vector3<f64>, Vector3<f64>)]) -> Rotation3<f64> {
    let correlation: Matrix3<f64> = rays.iter().map(|(a, b)| a * b.transpose()).sum();
    Rotation3::from_matrix_eps(&correlation, 1e-12, 100, Rotation3::identity())
}
