//! The lens as calibration sees it: a projection without limits of the field, its derivatives, and the valid cone of the
//! result.

use vergence_vision::{
    Angle, Camera, ImageSize, InvalidLens, KannalaBrandt, LENS_PARAMETERS, Length, OpenCvFisheye, Point,
    angle_of_point, pupil_shift,
};

/// fx, fy, cx, cy, k1 to k4, and the pupil's e0.
pub(crate) const LENS: usize = LENS_PARAMETERS;
/// The parameters of a central lens: those before e0.
pub(crate) const CENTRAL: usize = LENS - 1;

/// Below this angle to the axis the series of the projection replaces quotients of small numbers.
const PARAXIAL: f64 = 1e-4;

/// A lens as its parameters, which may be none that a [`KannalaBrandt`] accepts.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LensParameters {
    /// fx, fy, cx, cy, k1 to k4.
    pub central: OpenCvFisheye,
    /// The coefficient e0 of the pupil's shift in millimetres; zero of a central lens.
    pub pupil_mm: f64,
}

/// A projected pixel and its derivatives, column by column: `by_lens[i]` is the derivative of (u, v) by parameter i.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Reprojection {
    /// u and v, in pixels.
    pub pixel: [f64; 2],
    /// Derivatives by fx, fy, cx, cy, k1, k2, k3, k4 and the pupil's e0.
    pub by_lens: [[f64; 2]; LENS],
    /// Derivatives by the point's x, y and z in the camera frame, in pixels per millimetre.
    pub by_point: [[f64; 2]; 3],
}

/// Image of `point` through `lens`, with analytic derivatives, at any angle to the axis.
///
/// The four free ratios k1 to k4 over fx, fy are the five-coefficient form of [`vergence_vision::KannalaBrandt`]
/// rescaled: its coefficients in pixels are fx (1, k1, k2, k3, k4), and its aspect is fy / fx. `None` at the optical
/// centre and straight behind it, where the direction of the image radius is not defined, and for a point nearer to a moving pupil than
/// [`angle_of_point`] allows.
#[must_use]
pub fn reproject(lens: impl Into<LensParameters>, point: &Point<Camera>) -> Option<Reprojection> {
    let LensParameters { central: lens, pupil_mm } = lens.into();
    let [x, y, z]: [f64; 3] = point.mm().into();
    let across = x * x + y * y;
    let (rho, square) = (across.sqrt(), across + z * z);
    if !square.is_normal() || (rho == 0.0 && z < 0.0) {
        return None;
    }
    let seen = if pupil_mm == 0.0 { None } else { Some(Seen::by_pupil(pupil_mm, rho, z)?) };
    let theta = seen.as_ref().map_or_else(|| rho.atan2(z), |seen| seen.theta);
    let [k1, k2, k3, k4] = lens.k;
    let t = theta * theta;
    let slope = 1.0 + t * (3.0 * k1 + t * (5.0 * k2 + t * (7.0 * k3 + t * 9.0 * k4)));

    let (outward, along) = match &seen {
        None => (slope * z / square, slope / square),
        Some(seen) => (slope * seen.outward, slope * seen.forward),
    };

    // With r(θ) for fx = 1: scale = r / ρ, ∂scale/∂(x, y) = (x, y) bend, ∂scale/∂z = -along.
    let (scale, bend, angle_scale) = if theta < PARAXIAL {
        let cubic = k1 - 1.0 / 3.0;
        ((1.0 + cubic * t) / z, 2.0 * cubic / (z * z * z), 1.0 / z)
    } else {
        let scale = theta * (1.0 + t * (k1 + t * (k2 + t * (k3 + t * k4)))) / rho;
        (scale, (outward - scale) / across, theta / rho)
    };
    let (fx, fy) = (lens.fx, lens.fy);
    // ∂θ/∂e0 = (θ / sin θ - 1) sin θ / D.
    let pupil = along * pupil_shift(theta);
    let power = |exponent: i32| {
        let share = angle_scale * t.powi(exponent);
        [fx * x * share, fy * y * share]
    };
    Some(Reprojection {
        pixel: [lens.cx + fx * scale * x, lens.cy + fy * scale * y],
        by_lens: [
            [scale * x, 0.0],
            [0.0, scale * y],
            [1.0, 0.0],
            [0.0, 1.0],
            power(1),
            power(2),
            power(3),
            power(4),
            [fx * x * pupil, fy * y * pupil],
        ],
        by_point: [
            [fx * (scale + x * x * bend), fy * x * y * bend],
            [fx * x * y * bend, fy * (scale + y * y * bend)],
            [-fx * x * along, -fy * y * along],
        ],
    })
}

/// How a point is seen by a lens whose pupil moves: the angle θ to the axis and its derivatives.
struct Seen {
    theta: f64,
    /// ∂θ/∂ρ: cos θ / D.
    outward: f64,
    /// -∂θ/∂z / ρ: sin θ / (ρ D).
    forward: f64,
}

impl Seen {
    fn by_pupil(pupil_mm: f64, rho: f64, z: f64) -> Option<Self> {
        let (theta, slope) = angle_of_point(pupil_mm, rho, z)?;
        if theta < PARAXIAL {
            // The pupil is at the origin there.
            let square = rho * rho + z * z;
            return Some(Self { theta, outward: z / square, forward: 1.0 / square });
        }
        let (sine, cosine) = theta.sin_cos();
        Some(Self { theta, outward: cosine / slope, forward: sine / (rho * slope) })
    }
}

impl LensParameters {
    /// The parameters of `camera`.
    #[must_use]
    pub fn of(camera: &KannalaBrandt) -> Self {
        Self { central: camera.to_opencv(), pupil_mm: camera.pupil().mm() }
    }

    /// The parameters as one array: fx, fy, cx, cy, k1 to k4, e0.
    #[must_use]
    pub const fn to_array(&self) -> [f64; LENS_PARAMETERS] {
        let OpenCvFisheye { fx, fy, cx, cy, k: [k1, k2, k3, k4] } = self.central;
        [fx, fy, cx, cy, k1, k2, k3, k4, self.pupil_mm]
    }

    /// The lens of [`Self::to_array`].
    #[must_use]
    pub const fn from_array([fx, fy, cx, cy, k1, k2, k3, k4, pupil_mm]: [f64; LENS_PARAMETERS]) -> Self {
        Self { central: OpenCvFisheye { fx, fy, cx, cy, k: [k1, k2, k3, k4] }, pupil_mm }
    }

    /// The lens with the field up to `theta_max` on a sensor of `size`.
    ///
    /// # Errors
    /// [`InvalidLens`] where no lens has these parameters.
    pub fn camera(&self, theta_max: Angle, size: ImageSize) -> Result<KannalaBrandt, InvalidLens> {
        KannalaBrandt::from_opencv(self.central, theta_max, size)?.with_pupil(Length::from_mm(self.pupil_mm))
    }
}

impl From<OpenCvFisheye> for LensParameters {
    fn from(central: OpenCvFisheye) -> Self {
        Self { central, pupil_mm: 0.0 }
    }
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
    lens: LensParameters,
    outermost: Angle,
    size: ImageSize,
) -> Result<KannalaBrandt, InvalidLens> {
    let wanted = outermost * (1.0 + MARGIN);
    let wanted = if wanted < WIDEST { wanted } else { WIDEST };
    match lens.camera(wanted, size) {
        Err(InvalidLens::TurnsOver { turn, .. }) if turn * BELOW_TURN > outermost => {
            lens.camera(turn * BELOW_TURN, size)
        }
        made => made,
    }
}
