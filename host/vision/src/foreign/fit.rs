//! The lens of this program that comes nearest to a camera of another model.

use nalgebra::{SMatrix, SVector, Vector2};

use super::CameraModel;
use crate::{Angle, Camera, ImageSize, InvalidLens, KannalaBrandt, Length, Pixel, UnitRay};

/// The part of an image in which a camera model counts.
#[derive(Clone, Copy, Debug)]
pub struct SightRegion<'a> {
    /// Size of the image.
    pub size: ImageSize,
    /// Corners of a polygon in the image outside of which the model was not measured; empty where it is good for the whole image.
    pub outline: &'a [Pixel],
}

/// A lens in place of a camera model, and how far it is off.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LensFit {
    /// The lens. Its field is that of the model, as far as the image shows it.
    pub lens: KannalaBrandt,
    /// Root mean square of the distances between the pixels of equal rays, over the image, in pixels. Zero where the model is the lens's own.
    pub rms_px: f64,
    /// The largest of these distances.
    pub largest_px: f64,
    /// The angle to the axis where it is.
    pub largest_at: Angle,
}

/// Why no lens comes near a camera model.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum NoFit {
    /// Hardly a pixel of the image has a ray.
    #[error("only {0} of some thousand places of the image have a ray: the image size is not that of this camera")]
    Unseen(usize),
    /// The nearest polynomial describes no lens.
    #[error("no lens of five radial coefficients comes near it: {0}")]
    Lens(InvalidLens),
}

/// A ray, by its angle to the axis and the direction of its image, and its pixel.
struct Sample {
    ray: UnitRay<Camera>,
    theta: f64,
    radial: Vector2<f64>,
    pixel: Pixel,
}

/// Number of samples across, and around the rim of the field.
const ACROSS: u32 = 80;
const AROUND: u32 = 144;
/// The fewest samples that tell a lens.
const FEWEST: usize = 100;
/// Five radial coefficients, the aspect ratio, and the centre.
const UNKNOWNS: usize = 8;
type Unknowns = SVector<f64, UNKNOWNS>;

/// Fits the five radial coefficients, the aspect ratio and the centre of a [`KannalaBrandt`] lens to `model` by least squares over the image.
///
/// With `distance`, the lens images points at that distance from the origin as the model does, so that a model whose rays do not go through
/// one point has a central one in its place. Without it, equal directions have equal pixels, and a model that is a `KannalaBrandt` lens
/// stays what it is.
///
/// # Errors
/// [`NoFit`].
pub fn fit_lens(model: &dyn CameraModel, region: SightRegion<'_>, distance: Option<Length>) -> Result<LensFit, NoFit> {
    if let (Some(lens), None) = (model.as_kannala_brandt(), distance) {
        return Ok(LensFit { lens, rms_px: 0.0, largest_px: 0.0, largest_at: Angle::default() });
    }
    let samples = samples(model, region, distance);
    if samples.len() < FEWEST {
        return Err(NoFit::Unseen(samples.len()));
    }
    let lens = fitted(&samples, region.size).map_err(NoFit::Lens)?;
    compared(lens, &samples)
}

/// How far `lens` is off in place of `model`: over the image, for points at `distance` from the origin, or far away without one.
///
/// # Errors
/// [`NoFit::Unseen`].
pub fn compare_lens(
    model: &dyn CameraModel,
    lens: KannalaBrandt,
    region: SightRegion<'_>,
    distance: Option<Length>,
) -> Result<LensFit, NoFit> {
    let samples = samples(model, region, distance);
    compared(lens, &samples)
}

fn compared(lens: KannalaBrandt, samples: &[Sample]) -> Result<LensFit, NoFit> {
    let off = |sample: &Sample| {
        let pixel = lens.project(&sample.ray).ok()?;
        Some(((pixel.u - sample.pixel.u).hypot(pixel.v - sample.pixel.v), sample.theta))
    };
    // Where the points are nearer or farther than those of the fit, the rim of the field is seen by one of both only.
    let off: Vec<_> = samples.iter().filter_map(off).collect();
    if off.len() < FEWEST {
        return Err(NoFit::Unseen(off.len()));
    }
    let (largest_px, at) = off.iter().copied().fold((0.0, 0.0), |most, one| if one.0 > most.0 { one } else { most });
    let rms_px = (off.iter().map(|(off, _)| off * off).sum::<f64>() / off.len() as f64).sqrt();
    Ok(LensFit { lens, rms_px, largest_px, largest_at: Angle::from_rad(at) })
}

/// Rays of pixels all over the region, and rays around the rim of the model's field.
fn samples(model: &dyn CameraModel, region: SightRegion<'_>, distance: Option<Length>) -> Vec<Sample> {
    let ImageSize { width, height } = region.size;
    let step = f64::from(width.max(height)) / f64::from(ACROSS);
    let along = |pixels: u32| {
        let count = (f64::from(pixels) / step).round().max(1.0) as u32;
        (0..=count).map(move |index| f64::from(pixels) * f64::from(index) / f64::from(count) - 0.5)
    };
    let grid = along(height).flat_map(|v| along(width).map(move |u| Pixel { u, v }));
    let rim = (0..AROUND).filter_map(|index| {
        let (phi, theta) = (std::f64::consts::TAU * f64::from(index) / f64::from(AROUND), model.half_field().rad());
        let (sine, cosine) = theta.sin_cos();
        let ray = UnitRay::new(nalgebra::Vector3::new(sine * phi.cos(), sine * phi.sin(), cosine * (1.0 + 1e-12)))?;
        model.project(&ray).ok()
    });
    grid.chain(rim).filter(|pixel| region.contains(*pixel)).filter_map(|pixel| sample(model, pixel, distance)).collect()
}

impl SightRegion<'_> {
    fn contains(&self, pixel: Pixel) -> bool {
        self.size.contains(pixel) && (self.outline.len() < 3 || inside(self.outline, pixel))
    }
}

/// Whether a line from `pixel` to the right crosses the outline an odd number of times.
fn inside(outline: &[Pixel], pixel: Pixel) -> bool {
    let next = outline.iter().cycle().skip(1);
    let crossed = outline.iter().zip(next).filter(|(a, b)| {
        (a.v > pixel.v) != (b.v > pixel.v) && pixel.u < a.u + (b.u - a.u) * (pixel.v - a.v) / (b.v - a.v)
    });
    crossed.count() % 2 == 1
}

fn sample(model: &dyn CameraModel, pixel: Pixel, distance: Option<Length>) -> Option<Sample> {
    let seen = model.unproject(pixel).ok()?;
    let ray = match distance {
        None => seen.ray,
        Some(distance) => {
            // The point on the ray that is that far from the origin of the frame.
            let (start, along) = (seen.origin.mm(), seen.ray.vector());
            let (ahead, mm) = (start.dot(&along), distance.mm());
            let rest = ahead * ahead + mm * mm - start.norm_squared();
            UnitRay::new(start + along * (rest.sqrt() - ahead))?
        }
    };
    let d = ray.vector();
    let rho = d.x.hypot(d.y);
    let radial = if rho > 0.0 { Vector2::new(d.x / rho, d.y / rho) } else { Vector2::zeros() };
    Some(Sample { ray, theta: ray.angle_to_axis().rad(), radial, pixel })
}

/// Gauss-Newton over the radial coefficients, for angles in units of the largest, the aspect ratio and the centre.
fn fitted(samples: &[Sample], size: ImageSize) -> Result<KannalaBrandt, InvalidLens> {
    const STEPS: usize = 50;
    let largest = samples.iter().map(|sample| sample.theta).fold(0.0, f64::max);
    let middle = Pixel { u: f64::from(size.width) / 2.0, v: f64::from(size.height) / 2.0 };
    let radius = samples.iter().map(|at| (at.pixel.u - middle.u).hypot(at.pixel.v - middle.v)).fold(0.0, f64::max);
    let mut unknowns = Unknowns::from_column_slice(&[radius, 0.0, 0.0, 0.0, 0.0, 1.0, middle.u, middle.v]);
    for _ in 0..STEPS {
        let (mut normal, mut right) = (SMatrix::<f64, UNKNOWNS, UNKNOWNS>::zeros(), Unknowns::zeros());
        for sample in samples {
            for (row, missing) in rows(sample, &unknowns, largest) {
                normal += row * row.transpose();
                right += row * missing;
            }
        }
        let step = normal.cholesky().ok_or(InvalidLens::NotFinite)?.solve(&right);
        unknowns += step;
        if step.norm() < 1e-12 * unknowns.norm() {
            break;
        }
    }
    let k = std::array::from_fn(|i| unknowns[i] / largest.powi(2 * i as i32 + 1));
    let centre = Pixel { u: unknowns[6], v: unknowns[7] };
    // The rays of the samples are within, whatever rounding does to them.
    KannalaBrandt::new(k, unknowns[5], centre, Angle::from_rad(largest * (1.0 + 1e-12)), size)
}

/// The derivatives of both coordinates of a pixel by the unknowns, and what they are short of.
fn rows(sample: &Sample, unknowns: &Unknowns, largest: f64) -> [(Unknowns, f64); 2] {
    let share = sample.theta / largest;
    let powers: [f64; 5] = std::array::from_fn(|i| share.powi(2 * i as i32 + 1));
    let radius: f64 = powers.iter().zip(unknowns.iter()).map(|(power, k)| power * k).sum();
    let (aspect, cosine, sine) = (unknowns[5], sample.radial.x, sample.radial.y);
    let [mut across, mut down] = [Unknowns::zeros(); 2];
    for (i, power) in powers.iter().enumerate() {
        across[i] = power * cosine;
        down[i] = aspect * power * sine;
    }
    down[5] = radius * sine;
    across[6] = 1.0;
    down[7] = 1.0;
    let missing =
        [sample.pixel.u - unknowns[6] - radius * cosine, sample.pixel.v - unknowns[7] - aspect * radius * sine];
    [(across, missing[0]), (down, missing[1])]
}
