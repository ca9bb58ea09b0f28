//! `vergence calibrate diff`: two calibrations of one camera.

use std::path::PathBuf;

use nalgebra::{Matrix3, Rotation3, Vector3};
use serde_json::json;
use vergence_vision::{Angle, Camera, KannalaBrandt, Pixel};

use crate::camera_files::read_camera;
use crate::console::Console;
use crate::failure::Failure;

/// Compares the rays of two camera files over the image. The rotation that fits them best is removed first: it is a
/// difference of pose, not of the lens.
#[derive(Debug, clap::Args)]
pub struct Args {
    /// One camera file.
    a: PathBuf,
    /// The other.
    b: PathBuf,
    /// Compare up to this angle from the optical axis; without it, wherever both cameras are valid.
    #[arg(long)]
    field: Option<Angle>,
    /// Fail if any ray differs by more than this angle.
    #[arg(long)]
    limit: Option<Angle>,
}

/// Number of columns, and of rows, of the grid of pixels whose rays are compared.
const GRID: u32 = 60;

pub fn run(args: &Args, console: Console) -> Result<(), Failure> {
    let (a, b) = (read_camera(&args.a)?, read_camera(&args.b)?);
    if a.size() != b.size() {
        return Err(Failure::usage(
            "the cameras have different image sizes: two calibrations of one camera have the same",
        ));
    }
    let rays = rays(&a, &b, args.field);
    if rays.len() < 10 {
        return Err(Failure::usage("the fields of the cameras hardly overlap: too few rays to compare"));
    }
    let turn = best_rotation(&rays);
    let mut angles: Vec<f64> = rays.iter().map(|(a, b)| (turn * b).cross(a).norm().atan2((turn * b).dot(a))).collect();
    angles.sort_by(f64::total_cmp);
    let at = |share: f64| angles.get(((angles.len() - 1) as f64 * share) as usize).copied().unwrap_or(0.0).to_degrees();
    let (median, p95, worst) = (at(0.5), at(0.95), at(1.0));
    let turned = turn.angle().to_degrees();
    console.say(format!(
        "rays differ by {median:.4}° (median), {p95:.4}° (95 %), {worst:.4}° (worst) at {} places, after a turn of {turned:.4}°",
        angles.len()
    ))?;
    console.result(&json!({
        "median_deg": median, "p95_deg": p95, "worst_deg": worst, "rotation_deg": turned, "rays": angles.len(),
    }))?;
    match args.limit {
        Some(limit) if worst > limit.deg() => Err(Failure::check(format!("the rays differ by more than {limit:.4}"))),
        _ => Ok(()),
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
