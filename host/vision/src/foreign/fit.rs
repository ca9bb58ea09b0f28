//! The lens of this program that comes nearest to a camera of another model.

use nalgebra::{SMatrix, SVector, Vector2};

use super::CameraModel;
use crate::lens_step::lens_step;
use crate::{Angle, Asymmetry, Camera, ImageSize, InvalidLens, KannalaBrandt, Pixel, UnitRay};

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

/// Fits the five radial coefficients, the aspect ratio and the centre of a [`KannalaBrandt`] lens to `model` by least squares over the image,
/// so that equal directions have equal pixels; where that comes nearer, decentring and thin prism too. A model that is a `KannalaBrandt` lens
/// stays what it is.
///
/// # Errors
/// [`NoFit`].
pub fn fit_lens(model: &dyn CameraModel, region: SightRegion<'_>) -> Result<LensFit, NoFit> {
    /// An asymmetry is kept that leaves less than this share of the distances.
    const WORTH: f64 = 0.9;
    if let Some(lens) = model.as_kannala_brandt() {
        return Ok(LensFit { lens, rms_px: 0.0, largest_px: 0.0, largest_at: Angle::default() });
    }
    let samples = samples(model, region);
    if samples.len() < FEWEST {
        return Err(NoFit::Unseen(samples.len()));
    }
    let symmetric = compared(fitted(&samples, region.size).map_err(NoFit::Lens)?, &samples);
    let bent = asymmetric(&symmetric.lens, &samples).map(|lens| compared(lens, &samples));
    Ok(bent.filter(|bent| bent.rms_px < WORTH * symmetric.rms_px).unwrap_or(symmetric))
}

/// How far `lens` is off the samples.
fn compared(lens: KannalaBrandt, samples: &[Sample]) -> LensFit {
    let off = |sample: &Sample| {
        let pixel = lens.project(&sample.ray).map_or(f64::INFINITY, |at| apart(at, sample.pixel));
        (pixel, sample.theta)
    };
    let off: Vec<_> = samples.iter().map(off).collect();
    let (largest_px, at) = off.iter().copied().fold((0.0, 0.0), |most, one| if one.0 > most.0 { one } else { most });
    let rms_px = (off.iter().map(|(off, _)| off * off).sum::<f64>() / off.len() as f64).sqrt();
    LensFit { lens, rms_px, largest_px, largest_at: Angle::from_rad(at) }
}

fn apart(a: Pixel, b: Pixel) -> f64 {
    (a.u - b.u).hypot(a.v - b.v)
}

/// The lens with decentring and thin prism, by Gauss-Newton steps over these and those of a central lens. `None` where the samples do not
/// determine them, or the image would fold.
fn asymmetric(symmetric: &KannalaBrandt, samples: &[Sample]) -> Option<KannalaBrandt> {
    const STEPS: usize = 8;
    /// Columns of the derivatives: those of a central lens, and those of the asymmetry.
    const COLUMNS: [usize; 16] = [0, 1, 2, 3, 4, 5, 6, 7, 10, 11, 12, 13, 14, 15, 18, 19];
    let mut lens = *symmetric;
    for _ in 0..STEPS {
        let missing = |sample: &Sample| {
            let at = lens.project(&sample.ray).ok()?;
            Some((sample.ray, Vector2::new(sample.pixel.u - at.u, sample.pixel.v - at.v)))
        };
        let missing: Vec<_> = samples.iter().map(missing).collect::<Option<_>>()?;
        let step = lens_step(&lens, &COLUMNS, missing)?;
        let moved = lens.to_opencv().stepped(step.as_slice());
        let before = lens.asymmetry().to_array();
        let asymmetry = Asymmetry::from_array(std::array::from_fn(|i| before[i] + step[8 + i]));
        let bare = KannalaBrandt::from_opencv(moved, symmetric.theta_max(), symmetric.size()).ok()?;
        lens = bare.with_asymmetry(asymmetry).ok()?;
    }
    Some(lens)
}

/// Rays of pixels all over the region, and rays around the rim of the model's field.
fn samples(model: &dyn CameraModel, region: SightRegion<'_>) -> Vec<Sample> {
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
    grid.chain(rim).filter(|pixel| region.contains(*pixel)).filter_map(|pixel| sample(model, pixel)).collect()
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

fn sample(model: &dyn CameraModel, pixel: Pixel) -> Option<Sample> {
    let ray = model.unproject(pixel).ok()?.ray;
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
