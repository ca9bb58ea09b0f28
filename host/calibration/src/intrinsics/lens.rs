//! The lens as calibration sees it: a projection without limits of the field, its derivatives, and the valid cone of the
//! result.

use nalgebra::Vector2;
use vergence_vision::{
    Angle, Asymmetry, CENTRAL_PARAMETERS, Camera, ImageSize, InvalidLens, KannalaBrandt, LENS_PARAMETERS,
    OpenCvFisheye, Point, Pupil, pupil_shift_by_sine,
};

/// The parameters of a lens, in the order of [`LENS_PARAMETERS`].
pub(crate) const LENS: usize = LENS_PARAMETERS;
/// The parameters of a central and symmetric lens: those before e0.
pub(crate) const CENTRAL: usize = CENTRAL_PARAMETERS;
/// Indices of k5 and k6, the further radial terms.
pub(crate) const K5: usize = E1 + 7;
pub(crate) const K6: usize = K5 + 1;
/// Index of the pupil's e0, and of e1.
pub(crate) const E0: usize = CENTRAL;
pub(crate) const E1: usize = CENTRAL + 1;

/// Below this angle to the axis the series of the projection replaces quotients of small numbers.
const PARAXIAL: f64 = 1e-4;

/// A lens as its parameters, which may be none that a [`KannalaBrandt`] accepts.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LensParameters {
    /// fx, fy, cx, cy, k1 to k4.
    pub central: OpenCvFisheye,
    /// How the pupil moves.
    pub pupil: Pupil,
    /// Decentring and thin prism.
    pub asymmetry: Asymmetry,
    /// k5 and k6, of θ¹⁰ and θ¹² as k1 to k4 are of θ² to θ⁸.
    pub further: [f64; 2],
    /// A lens that is computed by another program's model, whose images count in place of those by the parameters above.
    pub foreign: Option<KannalaBrandt>,
}

/// A projected pixel and its derivatives, column by column: `by_lens[i]` is the derivative of (u, v) by parameter i.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Reprojection {
    /// u and v, in pixels.
    pub pixel: [f64; 2],
    /// Derivatives by the parameters, in the order of [`LENS_PARAMETERS`].
    pub by_lens: [[f64; 2]; LENS],
    /// Derivatives by the point's x, y and z in the camera frame, in pixels per millimetre.
    pub by_point: [[f64; 2]; 3],
}

/// Image of `point` through `lens`, with analytic derivatives, at any angle to the axis.
///
/// The four free ratios k1 to k4 over fx, fy are the five-coefficient form of [`vergence_vision::KannalaBrandt`]
/// rescaled: its coefficients in pixels are fx (1, k1, k2, k3, k4), and its aspect is fy / fx. `None` at the optical
/// centre and straight behind it, where the direction of the image radius is not defined, and for a point nearer to a moving pupil than
/// [`Pupil::seen`] allows.
#[must_use]
pub fn reproject(lens: impl Into<LensParameters>, point: &Point<Camera>) -> Option<Reprojection> {
    reprojected(&lens.into(), point)
}

/// [`reproject`], inside of the caller, so that what it does not use is not computed.
#[inline(always)]
pub(super) fn reprojected(lens: &LensParameters, point: &Point<Camera>) -> Option<Reprojection> {
    let LensParameters { central: lens, pupil, asymmetry, further: [k5, k6], foreign } = lens;
    let [x, y, z]: [f64; 3] = point.mm().into();
    let across = x * x + y * y;
    let (rho, square) = (across.sqrt(), across + z * z);
    if !square.is_normal() || (rho == 0.0 && z < 0.0) {
        return None;
    }
    let seen = if pupil.is_fixed() { None } else { Some(pupil.seen(rho, z)?) };
    let theta = seen.map_or_else(|| rho.atan2(z), |seen| seen.theta);
    let [k1, k2, k3, k4] = lens.k;
    let t = theta * theta;
    let [tail, tail_slope] = [t * (k5 + t * k6), t * (11.0 * k5 + t * 13.0 * k6)];
    let slope = 1.0 + t * (3.0 * k1 + t * (5.0 * k2 + t * (7.0 * k3 + t * (9.0 * k4 + tail_slope))));

    // ∂θ/∂ρ and -∂θ/∂z / ρ.
    let (outward, along) = match &seen {
        // Near the axis the pupil is at the origin.
        Some(seen) if theta >= PARAXIAL => {
            (slope * (seen.cosine / seen.slope), slope * (seen.sine / (rho * seen.slope)))
        }
        _ => (slope * z / square, slope / square),
    };

    // With r(θ) for fx = 1: scale = r / ρ, ∂scale/∂(x, y) = (x, y) bend, ∂scale/∂z = -along.
    let (scale, bend, angle_scale) = if theta < PARAXIAL {
        let cubic = k1 - 1.0 / 3.0;
        ((1.0 + cubic * t) / z, 2.0 * cubic / (z * z * z), 1.0 / z)
    } else {
        let scale = theta * (1.0 + t * (k1 + t * (k2 + t * (k3 + t * (k4 + tail))))) / rho;
        (scale, (outward - scale) / across, theta / rho)
    };
    let (fx, fy) = (lens.fx, lens.fy);
    // ∂θ/∂ej = Ej sin θ / D.
    let shift = pupil_shift_by_sine(theta, seen.map_or_else(|| rho / square.sqrt(), |seen| seen.sine));
    let by_pupil = [shift, shift * t].map(|by| {
        let pupil = along * by;
        [fx * x * pupil, fy * y * pupil]
    });
    let power = |exponent: i32| {
        let share = angle_scale * t.powi(exponent);
        [fx * x * share, fy * y * share]
    };
    let place = Vector2::new(scale * x, scale * y);
    let by_asymmetry = Asymmetry::by_coefficients(place);
    let [p1, p2, s0, s1, s2, s3, p3, p4] =
        std::array::from_fn(|i| [fx * by_asymmetry[(0, i)], fy * by_asymmetry[(1, i)]]);
    let mut seen = Reprojection {
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
            by_pupil[0],
            by_pupil[1],
            p1,
            p2,
            s0,
            s1,
            s2,
            s3,
            power(5),
            power(6),
            p3,
            p4,
        ],
        by_point: [
            [fx * (scale + x * x * bend), fy * x * y * bend],
            [fx * x * y * bend, fy * (scale + y * y * bend)],
            [-fx * x * along, -fy * y * along],
        ],
    };
    if !asymmetry.is_zero() {
        seen.displace(lens, asymmetry, place);
    }
    match foreign {
        None => Some(seen),
        Some(camera) => Some(seen.by_model_of(camera, point).unwrap_or(seen)),
    }
}

impl Reprojection {
    /// The same by the model of another program, but for the derivatives by the parameters of the polynomial; `None` beyond its field.
    fn by_model_of(&self, camera: &KannalaBrandt, point: &Point<Camera>) -> Option<Self> {
        let ray = point.direction()?;
        let pixel = camera.project(&ray).ok()?;
        let by_point = camera.pixel_by_ray(&ray) / point.mm().norm();
        Some(Self { pixel: [pixel.u, pixel.v], by_point: by_point.into(), ..*self })
    }

    /// Makes the reprojection by a symmetric lens, which images the point at `place` in focal lengths, that of one which is not.
    #[inline(always)]
    fn displace(&mut self, lens: &OpenCvFisheye, asymmetry: &Asymmetry, place: Vector2<f64>) {
        let OpenCvFisheye { fx, fy, cx, cy, .. } = *lens;
        let (arrived, bend) = (asymmetry.moved(place), asymmetry.by_place(place));
        self.pixel = [cx + fx * arrived.x, cy + fy * arrived.y];
        (self.by_lens[0], self.by_lens[1]) = ([arrived.x, 0.0], [0.0, arrived.y]);
        let (before, further) = self.by_lens.split_at_mut(K5);
        for column in before[4..=E1].iter_mut().chain(&mut further[..2]).chain(&mut self.by_point) {
            let by = bend * Vector2::new(column[0] / fx, column[1] / fy);
            *column = [fx * by.x, fy * by.y];
        }
    }
}

impl LensParameters {
    /// The parameters of `camera`.
    #[must_use]
    pub fn of(camera: &KannalaBrandt) -> Self {
        let foreign = camera.foreign_model().map(|_| *camera);
        let (pupil, asymmetry, further) = (camera.pupil(), camera.asymmetry(), camera.further_terms());
        Self { central: camera.to_opencv(), pupil, asymmetry, further, foreign }
    }

    /// The lens of the parameters alone: where these are unknowns, the images of another program's model are left.
    #[must_use]
    pub const fn polynomial(self) -> Self {
        Self { foreign: None, ..self }
    }

    /// The parameters as one array, in the order of [`LENS_PARAMETERS`].
    #[must_use]
    pub const fn to_array(&self) -> [f64; LENS_PARAMETERS] {
        let OpenCvFisheye { fx, fy, cx, cy, k: [k1, k2, k3, k4] } = self.central;
        let ([e0, e1], [p1, p2, s0, s1, s2, s3, p3, p4]) = (self.pupil.mm(), self.asymmetry.to_array());
        let [k5, k6] = self.further;
        [fx, fy, cx, cy, k1, k2, k3, k4, e0, e1, p1, p2, s0, s1, s2, s3, k5, k6, p3, p4]
    }

    /// The lens of [`Self::to_array`].
    #[must_use]
    pub const fn from_array(parameters: [f64; LENS_PARAMETERS]) -> Self {
        let [fx, fy, cx, cy, k1, k2, k3, k4, e0, e1, p1, p2, s0, s1, s2, s3, k5, k6, p3, p4] = parameters;
        Self {
            central: OpenCvFisheye { fx, fy, cx, cy, k: [k1, k2, k3, k4] },
            pupil: Pupil::from_mm([e0, e1]),
            asymmetry: Asymmetry::from_array([p1, p2, s0, s1, s2, s3, p3, p4]),
            further: [k5, k6],
            foreign: None,
        }
    }

    /// The lens with the field up to `theta_max` on a sensor of `size`; one of another program's model as it is.
    ///
    /// # Errors
    /// [`InvalidLens`] where no lens has these parameters.
    pub fn camera(&self, theta_max: Angle, size: ImageSize) -> Result<KannalaBrandt, InvalidLens> {
        if let Some(camera) = self.foreign {
            return Ok(camera);
        }
        let symmetric = KannalaBrandt::from_opencv_with(self.central, self.further, theta_max, size)?;
        symmetric.with_pupil(self.pupil)?.with_asymmetry(self.asymmetry)
    }
}

impl From<OpenCvFisheye> for LensParameters {
    fn from(central: OpenCvFisheye) -> Self {
        Self { central, pupil: Pupil::default(), asymmetry: Asymmetry::default(), further: [0.0; 2], foreign: None }
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
