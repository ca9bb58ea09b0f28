//! One seed: another rig, driven, calibrated and used.

use super::bench::Bench;
use super::chain::calibrate;
use super::drive::Drive;
use super::measure::{Measured, measure};
use super::sight::Eyesight;
use crate::failure::Failure;
use crate::sim::Random;

/// What one seed came to.
#[derive(Clone, Debug)]
pub struct SeedResult {
    /// The bench.
    pub measured: Measured,
    /// How far the corners of the calibration were from where they truly are, in pixels.
    pub calibration_errors_px: Vec<f64>,
    /// Photographs of the calibration, and those in which no board was found.
    pub photographs: [usize; 2],
    /// The noise of a corner's u or v as the rig itself estimates it, in pixels.
    pub stated_px: f64,
}

/// Calibrates the bench where it was driven, and measures with it. The same arguments give the same result.
///
/// # Errors
/// Where the views give no calibration.
pub fn one_seed(bench: &Bench, drive: &Drive, eyesight: &Eyesight, seed: u64) -> Result<SeedResult, Failure> {
    let mut random = Random::new(seed);
    let calibrated = calibrate(bench, &drive.calibration, eyesight, &mut random)?;
    let measured = measure(bench, &drive.modes, &calibrated, eyesight, &mut random);
    Ok(SeedResult {
        measured,
        stated_px: calibrated.stage.sigma_px,
        calibration_errors_px: calibrated.errors_px,
        photographs: calibrated.photographs,
    })
}
