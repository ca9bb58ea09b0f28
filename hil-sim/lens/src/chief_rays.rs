//! The chief rays of a lens: those through the centre of its stop, which tell where a point is imaged.

use nalgebra::Vector3;
use vergence_vision::{Angle, Camera, Point};

use crate::beam::{self, Spot};
use crate::curve::{Curve, Symmetry};
use crate::design::Design;
use crate::error::{DesignError, LostRay};
use crate::surface::Ray;
use crate::trace::Limits;

/// Step of the angle from one chief ray to the next.
const STEP: Angle = Angle::from_deg(0.25);

/// Chief rays between two values of the illumination, which needs many rays for each.
const BETWEEN_BEAMS: usize = 4;

/// A chief ray passes the stop this close to its centre, in focal lengths.
const AT_CENTRE: f64 = 1e-13;

/// Steps of the secant search for a chief ray; some five are needed.
const SEARCH_STEPS: usize = 40;

/// Image height, place of the entrance pupil and illumination over the angle to the axis, traced once and interpolated: images heights to
/// 1e-4 pixels and better.
#[derive(Clone, Debug)]
pub struct ChiefRays {
    /// Distance of the image from the axis, mm.
    pub(crate) height: Curve,
    /// How far the place where the ray crosses the axis lies in front of the paraxial entrance pupil, mm.
    pupil: Curve,
    /// Light on the image as a share of that on the axis.
    illumination: Curve,
}

impl ChiefRays {
    /// Traces the chief rays of a design from the axis to the edge of its field, with the light that `limits` let pass.
    ///
    /// # Errors
    /// Where a chief ray does not pass the lens inside the field that the design states.
    pub fn of(design: &Design, limits: Limits) -> Result<Self, DesignError> {
        let rays = chief_rays(design, Angle::from_rad(0.5 * design.field().rad()))?;
        let pupil = design.entrance_pupil();
        let on_image = |(number, chief): (usize, &ChiefRay)| {
            let on_image = design.on_image(&chief.ray, Limits::None).map(|[height, _]| height);
            on_image.map_err(|lost| DesignError::NoChiefRay { angle: angle_of_step(number), lost })
        };
        let heights = rays.iter().enumerate().map(on_image).collect::<Result<_, _>>()?;
        let height = Curve::new(STEP.rad(), heights, Symmetry::Odd);
        let lit = |(number, chief): (usize, &ChiefRay)| {
            beam::area(design, &chief.ray, limits) * solid_angle(&height, angle_of_step(number).rad())
        };
        let light: Vec<f64> = rays.iter().enumerate().step_by(BETWEEN_BEAMS).map(lit).collect();
        let illumination = light.iter().map(|here| here / light[0]).collect();
        Ok(Self {
            pupil: Curve::new(STEP.rad(), rays.iter().map(|chief| pupil - chief.crossing).collect(), Symmetry::Even),
            illumination: Curve::new(STEP.rad() * BETWEEN_BEAMS as f64, illumination, Symmetry::Even),
            height,
        })
    }

    /// The largest angle to the axis.
    #[must_use]
    pub fn theta_max(&self) -> Angle {
        Angle::from_rad(self.height.end())
    }

    /// Distance of the image from the axis in mm, of light at `theta` to the axis.
    #[must_use]
    pub fn image_height(&self, theta: Angle) -> f64 {
        self.height.at(theta.rad()).0
    }

    /// The angle to the axis of the chief ray that arrives `mm` from the axis; `None` outside of the field.
    #[must_use]
    pub fn angle_of(&self, mm: f64) -> Option<Angle> {
        self.height.argument_of(mm).map(Angle::from_rad)
    }

    /// How far the chief ray at `theta` crosses the axis in front of the paraxial entrance pupil, in mm.
    #[must_use]
    pub fn pupil_shift(&self, theta: Angle) -> f64 {
        self.pupil.at(theta.rad()).0
    }

    /// Light on the image as a share of that on the axis, from an evenly bright scene, by the stop and the rims.
    #[must_use]
    pub fn illumination(&self, theta: Angle) -> f64 {
        self.illumination.at(theta.rad()).0.max(0.0)
    }

    /// The angle to the axis of the chief ray from a point; `None` outside of the field, and nearer to the lens than its pupil moves.
    ///
    /// The ray of the angle θ crosses the axis at e(θ): ρ cos θ - (z - e(θ)) sin θ = 0, solved by Newton's method.
    #[must_use]
    pub fn angle_to(&self, point: &Point<Camera>) -> Option<Angle> {
        let at = point.mm();
        let (rho, z) = (at.x.hypot(at.y), at.z);
        let mut theta = rho.atan2(z);
        for _ in 0..SEARCH_STEPS {
            let (e, slope) = self.pupil.at(theta.min(self.pupil.end()));
            let (sin, cos) = theta.sin_cos();
            let off = rho * cos - (z - e) * sin;
            let change = -rho * sin - (z - e) * cos + slope * sin;
            if change >= 0.0 {
                return None;
            }
            let step = off / change;
            theta -= step;
            if step.abs() < 1e-15 {
                break;
            }
        }
        (0.0..=self.height.end()).contains(&theta).then(|| Angle::from_rad(theta))
    }
}

/// Solid angle of the scene that lights a unit of the image, at `angle`: sin θ dθ / (r dr).
fn solid_angle(height: &Curve, angle: f64) -> f64 {
    let (r, slope) = height.at(angle);
    if angle == 0.0 { slope.powi(-2) } else { angle.sin() / (r * slope) }
}

/// A chief ray in the plane of x and z, and the place where it would cross the axis.
#[derive(Clone, Copy)]
struct ChiefRay {
    ray: Ray,
    crossing: f64,
}

const fn angle_of_step(number: usize) -> Angle {
    Angle::from_rad(STEP.rad() * number as f64)
}

/// The chief rays from the axis to `widest`, in steps.
fn chief_rays(design: &Design, widest: Angle) -> Result<Vec<ChiefRay>, DesignError> {
    let on_axis = ChiefRay::through(design.entrance_pupil(), angle_of_step(0), design);
    let mut rays = vec![on_axis];
    for number in 1..=(widest.rad() / STEP.rad()) as usize {
        // Two steps on from the last two: the shift of the pupil bends slowly.
        let [.., last] = rays[..] else { break };
        let before = rays.len().checked_sub(2).map_or(last, |index| rays[index]);
        let guess = 2.0 * last.crossing - before.crossing;
        let angle = angle_of_step(number);
        rays.push(ChiefRay::near(guess, angle, design).map_err(|lost| DesignError::NoChiefRay { angle, lost })?);
    }
    Ok(rays)
}

impl ChiefRay {
    /// The ray at `angle` to the axis that would cross it at `crossing`, from far in front of the lens.
    fn through(crossing: f64, angle: Angle, design: &Design) -> Self {
        let along = Vector3::new(angle.rad().sin(), 0.0, angle.rad().cos());
        // Outside of any lens.
        let far = 2.0 * (design.image + design.surfaces.iter().map(|surface| surface.rim).fold(0.0, f64::max));
        Self { ray: Ray { at: Vector3::z() * crossing - along * far, along }, crossing }
    }

    /// The ray at `angle` through the centre of the stop that crosses the axis near `guess`, by the secant method.
    fn near(guess: f64, angle: Angle, design: &Design) -> Result<Self, LostRay> {
        let off_centre = |crossing: f64| {
            design.trace_to_stop(&Self::through(crossing, angle, design).ray, Limits::None).map(|ray| ray.at.x)
        };
        let size = design.focal_length();
        let (mut last, mut next) = (guess, guess + 1e-4 * size);
        let (mut off_last, mut off_next) = (off_centre(last)?, off_centre(next)?);
        for _ in 0..SEARCH_STEPS {
            let change = off_next - off_last;
            if off_next.abs() < AT_CENTRE * size || change.abs() < f64::MIN_POSITIVE {
                break;
            }
            let better = next - off_next * (next - last) / change;
            (last, off_last) = (next, off_next);
            (next, off_next) = (better, off_centre(better)?);
        }
        Ok(Self::through(next, angle, design))
    }
}

impl Design {
    /// The chief ray at `theta` to the axis, in the plane of x and z of the design.
    ///
    /// # Errors
    /// Where no light passes the centre of the stop at this angle.
    pub fn chief_ray(&self, theta: Angle) -> Result<Ray, DesignError> {
        let near = chief_rays(self, theta)?;
        let guess = near.last().map_or(self.entrance_pupil(), |chief| chief.crossing);
        let chief = ChiefRay::near(guess, theta, self);
        chief.map(|chief| chief.ray).map_err(|lost| DesignError::NoChiefRay { angle: theta, lost })
    }

    /// The spot of a far point at `theta` to the axis, by the light that `limits` let pass, in the plane of the paraxial image.
    ///
    /// # Errors
    /// Where no light arrives at this angle.
    pub fn spot(&self, theta: Angle, limits: Limits) -> Result<Spot, DesignError> {
        let chief = self.chief_ray(theta)?;
        beam::spot(self, &chief, limits).map_err(|lost| DesignError::NoChiefRay { angle: theta, lost })
    }
}
