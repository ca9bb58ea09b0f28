//! The lens as calibration sees it: a projection without limits of the field, its derivatives, and the valid cone of the
//! result.

use vergence_vision::{Angle, Camera, ImageSize, InvalidLens, KannalaBrandt, OpenCvFisheye, Point};

/// fx, fy, cx, cy, k1 to k4.
pub(crate) const LENS: usize = 8;

/// Below this angle to the axis the series of the projection replaces quotients of small numbers.
const PARAXIAL: f64 = 1e-4;

/// A projected pixel and its derivatives, column by column: `by_lens[i]` is the derivative of (u, v) by parameter i.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Reprojection {
    /// u and v, in pixels.
    pub pixel: [f64; 2],
    /// Derivatives by fx, fy, cx, cy, k1, k2, k3, k4.
    pub by_lens: [[f64; 2]; LENS],
    /// Derivatives by the point's x, y and z in the camera frame, in pixels per millimetre.
    pub by_point: [[f64; 2]; 3],
}

/// Image of `point` through `lens`, with analytic derivatives, at any angle to the axis.
///
/// The four free ratios k1 to k4 over fx, fy are the five-coefficient form of [`vergence_vision::KannalaBrandt`]
/// rescaled: its coefficients in pixels are fx (1, k1, k2, k3, k4), and its aspect is fy / fx. `None` at the optical
/// centre and straight behind it, where the direction of the image radius is not defined.
#[must_use]
pub fn reproject(lens: &OpenCvFisheye, point: &Point<Camera>) -> Option<Reprojection> {
    let [x, y, z]: [f64; 3] = point.mm().into();
    let across = x * x + y * y;
    let (rho, square) = (across.sqrt(), across + z * z);
    if !square.is_normal() || (rho == 0.0 && z < 0.0) {
        return None;
    }
    let theta = rho.atan2(z);
    let [k1, k2, k3, k4] = lens.k;
    let t = theta * theta;
    let slope = 1.0 + t * (3.0 * k1 + t * (5.0 * k2 + t * (7.0 * k3 + t * 9.0 * k4)));

    // With r(θ) for fx = 1: scale = r / ρ, ∂scale/∂(x, y) = (x, y) bend, ∂scale/∂z = -along.
    let (scale, bend, angle_scale) = if theta < PARAXIAL {
        let cubic = k1 - 1.0 / 3.0;
        ((1.0 + cubic * t) / z, 2.0 * cubic / (z * z * z), 1.0 / z)
    } else {
        let scale = theta * (1.0 + t * (k1 + t * (k2 + t * (k3 + t * k4)))) / rho;
        (scale, (slope * z / square - scale) / across, theta / rho)
    };
    let along = slope / square;
    let (fx, fy) = (lens.fx, lens.fy);
    let power = |exponent: i32| {
        let share = angle_scale * t.powi(exponent);
        [fx * x * share, fy * y * share]
    };
    Some(Reprojection {
        pixel: [lens.cx + fx * scale * x, lens.cy + fy * scale * y],
        by_lens: [[scale * x, 0.0], [0.0, scale * y], [1.0, 0.0], [0.0, 1.0], power(1), power(2), power(3), power(4)],
        by_point: [
            [fx * (scale + x * x * bend), fy * x * y * bend],
            [fx * x * y * bend, fy * (scale + y * y * bend)],
            [-fx * x * along, -fy * y * along],
        ],
    })
}

/// fx, fy, cx, cy, k1 to k4 as one array.
pub(crate) const fn to_array(lens: &OpenCvFisheye) -> [f64; LENS] {
    let [k1, k2, k3, k4] = lens.k;
    [lens.fx, lens.fy, lens.cx, lens.cy, k1, k2, k3, k4]
}

/// The lens of [`to_array`].
pub(crate) const fn from_array([fx, fy, cx, cy, k1, k2, k3, k4]: [f64; LENS]) -> OpenCvFisheye {
    OpenCvFisheye { fx, fy, cx, cy, k: [k1, k2, k3, k4] }
}

/// Extrapolation of the polynomial beyond the outermost corner that is allowed, as a share of its angle.
const MARGIN: f64 = 0.05;
/// Largest valid angle as a share of the angle where r(θ) stops growing: there the ray's uncertainty is unbounded.
const BELOW_TURN: f64 = 0.99;
/// Largest angle to the axis of any lens: the direction straight behind it has no image.
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
