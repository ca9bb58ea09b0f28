//! Ray uncertainty over the field, in numbers.

use nalgebra::{Matrix2x3, Matrix3x2};
use vergence_calibration::{IntrinsicsCalibration, RayUncertainty, reproject};
use vergence_vision::{Point, UnitRay};

use crate::arrows::{quantile, sorted};
use crate::image_frame::{OCTANTS, direction, name, octant};

/// Range and baseline, in millimetres, for which a report converts angles to depth errors.
pub(crate) const RANGE_MM: f64 = 350.0;
pub(crate) const BASELINE_MM: f64 = 145.0;

/// Width of the rings that uncertainties are listed for.
const RING_DEG: f64 = 15.0;
/// Least number of samples in a part of the field that is listed.
const FEWEST_SAMPLES: usize = 8;

/// The standard deviation of the depth of a point straight ahead of parallel cameras, in millimetres.
pub(crate) fn depth_mm(sigma_rad: f64) -> f64 {
    RANGE_MM * RANGE_MM * sigma_rad * std::f64::consts::SQRT_2 / BASELINE_MM
}

/// Uncertainty of one ray, in its worst direction.
#[derive(Clone, Copy)]
pub(crate) struct RaySample {
    theta: f64,
    phi: f64,
    pub sigma_rad: f64,
    pub sigma_px: f64,
}

/// Rays that evenly fill the part of the valid cone that the sensor sees.
pub(crate) struct RayField {
    samples: Vec<RaySample>,
}

/// Uncertainty in a ring of the field.
pub(crate) struct Ring {
    pub from_deg: f64,
    pub to_deg: f64,
    pub median: RaySample,
    pub worst: RaySample,
}

/// The weakest part of the field.
pub(crate) struct Weakest {
    pub from_deg: f64,
    /// `None` means all around.
    pub place: Option<&'static str>,
}

impl RayField {
    pub fn of(calibration: &IntrinsicsCalibration) -> Self {
        const DIRECTIONS: u32 = 4000;
        const GOLDEN: f64 = 2.399_963_229_728_653;
        let uncertainty = RayUncertainty::of(calibration);
        let camera = &calibration.camera;
        let lowest = camera.theta_max().rad().cos();
        let sample = |i: u32| {
            let z = 1.0 - (1.0 - lowest) * (f64::from(i) + 0.5) / f64::from(DIRECTIONS);
            let (theta, phi) = (z.acos(), GOLDEN * f64::from(i));
            let pixel = camera.project(&direction(theta, phi)?).ok().filter(|pixel| camera.on_sensor(*pixel))?;
            sample(calibration, &uncertainty, pixel, theta, phi)
        };
        Self { samples: (0..DIRECTIONS).filter_map(sample).collect() }
    }

    pub fn median(&self) -> Option<RaySample> {
        middle(&self.samples.iter().collect::<Vec<_>>())
    }

    pub fn worst(&self) -> Option<RaySample> {
        worst(self.samples.iter())
    }

    pub fn rings(&self) -> Vec<Ring> {
        let ring = |index: u32| {
            let [from_deg, to_deg] = [f64::from(index), f64::from(index + 1)].map(|i| i * RING_DEG);
            let within = |s: &&RaySample| (from_deg..to_deg).contains(&s.theta.to_degrees());
            let samples: Vec<_> = self.samples.iter().filter(within).collect();
            Some(Ring { from_deg, to_deg, median: middle(&samples)?, worst: worst(samples.iter().copied())? })
        };
        (0..12).filter_map(ring).collect()
    }

    /// Of the ring with the largest median, the octant with the largest; all around where the octants hardly differ.
    pub fn weakest(&self) -> Option<Weakest> {
        const HARDLY: f64 = 1.25;
        let enough = |samples: &Vec<&RaySample>| samples.len() >= FEWEST_SAMPLES;
        let within = |ring: &Ring, s: &RaySample| (ring.from_deg..ring.to_deg).contains(&s.theta.to_degrees());
        let rings = self.rings();
        let ring = rings
            .iter()
            .filter(|ring| self.samples.iter().filter(|s| within(ring, s)).count() >= FEWEST_SAMPLES)
            .max_by(|a, b| a.median.sigma_rad.total_cmp(&b.median.sigma_rad))?;
        let in_octant = |place: usize| {
            let samples: Vec<_> = self.samples.iter().filter(|s| within(ring, s) && octant(s.phi) == place).collect();
            Some((place, middle(&Some(samples).filter(enough)?)?.sigma_rad))
        };
        let octants: Vec<(usize, f64)> = (0..OCTANTS).filter_map(in_octant).collect();
        let least = octants.iter().map(|(_, sigma)| *sigma).fold(f64::INFINITY, f64::min);
        let (place, most) = octants.iter().copied().max_by(|a, b| a.1.total_cmp(&b.1))?;
        Some(Weakest { from_deg: ring.from_deg, place: (most > HARDLY * least).then(|| name(place)) })
    }
}

fn sample(
    calibration: &IntrinsicsCalibration,
    uncertainty: &RayUncertainty,
    pixel: vergence_vision::Pixel,
    theta: f64,
    phi: f64,
) -> Option<RaySample> {
    let ray = uncertainty.at(pixel).ok()?;
    let projected = reproject(calibration.opencv, &Point::from_mm(UnitRay::vector(&ray.ray)))?;
    let by_point = Matrix2x3::from_fn(|row, axis| projected.by_point[axis][row]);
    let by_angle = by_point * Matrix3x2::from_columns(&ray.tangents);
    let in_pixels = by_angle * ray.covariance * by_angle.transpose();
    let sigma_px = in_pixels.symmetric_eigenvalues().max().max(0.0).sqrt();
    let sigma_rad = ray.sigma().rad();
    (sigma_rad.is_finite() && sigma_px.is_finite()).then_some(RaySample { theta, phi, sigma_rad, sigma_px })
}

/// Median of the angles, and median of the pixels.
fn middle(samples: &[&RaySample]) -> Option<RaySample> {
    let first = samples.first()?;
    let median = |value: &dyn Fn(&RaySample) -> f64| quantile(&sorted(samples.iter().map(|s| value(s))), 0.5);
    Some(RaySample { sigma_rad: median(&|s| s.sigma_rad), sigma_px: median(&|s| s.sigma_px), ..**first })
}

fn worst<'a>(samples: impl Iterator<Item = &'a RaySample>) -> Option<RaySample> {
    samples.max_by(|a, b| a.sigma_rad.total_cmp(&b.sigma_rad)).copied()
}
