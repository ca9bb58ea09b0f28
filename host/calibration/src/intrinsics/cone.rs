//! The field a calibration is good for.

use vergence_vision::{Angle, ImageSize, InvalidLens, KannalaBrandt, OpenCvFisheye};

/// Beyond its outermost corner the polynomial is an extrapolation; this much of the angle is allowed.
const MARGIN: f64 = 0.05;
/// The share of the way to the angle where r(θ) stops growing that is still safe: the ray's uncertainty grows without
/// bound there.
const BELOW_TURN: f64 = 0.99;
/// Lenses end before the direction straight behind them.
const WIDEST: Angle = Angle::from_deg(179.0);

/// The camera with the valid cone of a calibration: the angle to the axis of the outermost corner used and 5 % more, but
/// less than the angle where r(θ) turns.
///
/// # Errors
/// [`InvalidLens::TurnsOver`] where r(θ) turns within the corners used: no lens does.
pub(super) fn with_valid_cone(
    lens: OpenCvFisheye,
    outermost: Angle,
    size: ImageSize,
) -> Result<KannalaBrandt, InvalidLens> {
    let wanted = outermost * (1.0 + MARGIN);
    let wanted = if wanted < WIDEST { wanted } else { WIDEST };
    match KannalaBrandt::from_opencv(lens, wanted, size) {
        Err(InvalidLens::TurnsOver { turn, .. }) if turn * BELOW_TURN > outermost => {
            KannalaBrandt::from_opencv(lens, turn * BELOW_TURN, size)
        }
        made => made,
    }
}
