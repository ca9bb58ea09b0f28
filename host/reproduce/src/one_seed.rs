//! One seed: another rig, driven, calibrated and used.

use vergence_calibration::LensModel;

use crate::bench::Bench;
use crate::chain::calibrate;
use crate::conditions::Conditions;
use crate::drive::Drive;
use crate::error::ReproduceError;
use crate::eyes::Eyes;
use crate::measure::{Measured, measure};
use vergence_sim::Random;

/// What one seed came to.
#[derive(Clone, Debug)]
pub struct SeedResult {
    /// The bench.
    pub measured: Measured,
    /// How far the corners of the calibration were from where they truly are, in pixels.
    pub calibration_errors_px: Vec<f64>,
    /// Photographs of the calibration, and those in which no target was found.
    pub photographs: [usize; 2],
    /// The noise of a corner's u or v as the rig itself estimates it, in pixels.
    pub stated_px: f64,
}

/// Calibrates the bench where it was driven, and measures with it. The same arguments give the same result.
///
/// # Errors
/// Where the views give no calibration, or a design of a lens cannot be traced.
pub fn one_seed(
    bench: &Bench,
    drive: &Drive,
    conditions: &Conditions,
    seed: u64,
) -> Result<SeedResult, ReproduceError> {
    let eyes = Eyes::of(bench, conditions)?;
    // Streams of their own: the same targets stand before the rig in all conditions.
    let (mut random, mut returns) = (Random::new(seed), Random::new(seed ^ 0x7265_7475_726e));
    let calibrated = calibrate(bench, drive, &eyes, LensModel::default(), &mut random, &mut returns)?;
    let measured = measure(&eyes, &drive.modes, &calibrated, &mut random, &mut returns);
    Ok(SeedResult {
        measured,
        stated_px: calibrated.stage.sigma_px,
        calibration_errors_px: calibrated.errors_px,
        photographs: calibrated.photographs,
    })
}
