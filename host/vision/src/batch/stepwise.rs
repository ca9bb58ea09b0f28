//! Projection of whole arrays by models that are [`LensSteps`]: onto a plane, distortion there, and an affine map to pixels.

use nalgebra::Matrix3;

use super::lanes::{Kernel, multiply_add, over_rows};
use super::plane::Plane;
use super::radial::{Growing, ProjectRadial, Radial};
use crate::foreign::{AngleLaw, OntoPlane};
use crate::{KannalaBrandt, LensSteps, Pixel};

/// Rows per step.
const LANES: usize = 16;
/// So near to the end of the field, in the cosine, the model itself says what is inside.
pub(super) const RIM: f64 = 1e-9;
/// Where the model itself is asked.
pub(super) const ASK: f64 = f64::INFINITY;

/// A law of the radius by the angle, up to the end of a field.
pub(super) struct LawInField<'a> {
    pub law: &'a AngleLaw,
    pub theta_max: f64,
}

impl Radial for LawInField<'_> {
    const LARGEST_ERROR: f64 = 3e-10;

    fn angle(&self, radius: f64) -> f64 {
        self.law.angle(radius, self.theta_max)
    }

    fn largest_radius(&self) -> f64 {
        self.law.radius(self.theta_max)
    }

    fn on_axis(&self) -> f64 {
        const NEAR: f64 = 1e-6;
        self.law.radius(NEAR) / NEAR
    }

    fn middle(&self) -> Pixel {
        Pixel { u: 0.0, v: 0.0 }
    }

    fn stretch(&self) -> f64 {
        1.0
    }
}

impl Growing for LawInField<'_> {
    fn theta_max(&self) -> f64 {
        self.theta_max
    }

    fn radius(&self, theta: f64) -> Option<f64> {
        Some(self.law.radius(theta))
    }
}

/// The steps of a lens, prepared.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Stepwise {
    onto_plane: OntoLanes,
    plane: Plane,
    /// What the tilt of the sensor does, where it is tilted.
    tilt: Option<Matrix3<f64>>,
    affine: [[f64; 3]; 2],
    /// The cosine of the angle at the end of the field.
    end: f64,
}

#[derive(Clone, Debug, PartialEq)]
enum OntoLanes {
    Sphere(f64),
    Angle(ProjectRadial),
}

impl Stepwise {
    /// `None` where the law of the angle is no polynomial.
    pub(super) fn new(lens: &KannalaBrandt, steps: &LensSteps, theta_max: f64) -> Option<Self> {
        let onto_plane = match &steps.onto_plane {
            OntoPlane::Sphere(xi) => OntoLanes::Sphere(*xi),
            // A little beyond the field, where the model itself is asked.
            OntoPlane::Angle(law) => {
                let theta_max = theta_max * (1.0 + 1e-8);
                OntoLanes::Angle(ProjectRadial::new(&LawInField { law, theta_max })?)
            }
            OntoPlane::Stereographic(_) => return None,
        };
        let tilt = Some(steps.distortion.tilt).filter(|tilt| *tilt != Matrix3::identity());
        let plane = Plane::new(&steps.distortion.coefficients);
        let prepared = Self { onto_plane, plane, tilt, affine: steps.affine, end: theta_max.cos() };
        prepared.is_near(lens, theta_max).then_some(prepared)
    }

    /// Whether it gives the pixels of the lens.
    fn is_near(&self, lens: &KannalaBrandt, theta_max: f64) -> bool {
        const RAYS: u32 = 400;
        const LARGEST_ERROR: f64 = 8e-10;
        (0..RAYS).all(|place| {
            let ([sin, cos], theta) = at(place, theta_max * f64::from(place) / f64::from(RAYS));
            let [[u], [v]] = self.lanes::<false, 1>([[theta.0 * cos], [theta.0 * sin], [theta.1]]);
            let ray = crate::UnitRay::<crate::Camera>::new([theta.0 * cos, theta.0 * sin, theta.1].into());
            let seen = ray.and_then(|ray| lens.project(&ray).ok());
            // Where the lens says nothing the rows say nothing either, or ask.
            let off = |seen: Pixel| (seen.u - u).hypot(seen.v - v) <= LARGEST_ERROR * lens.k()[0];
            u == ASK || seen.map_or(u.is_nan(), off)
        })
    }

    #[inline(always)]
    fn onto_plane<const FUSED: bool, const W: usize>(
        &self,
        [x, y, z]: [[f64; W]; 3],
        norm: &[f64; W],
    ) -> [[f64; W]; 2] {
        let mut factor = [0.0; W];
        match &self.onto_plane {
            OntoLanes::Sphere(xi) => {
                for j in 0..W {
                    factor[j] = 1.0 / multiply_add::<FUSED>(*xi, norm[j], z[j]);
                }
            }
            OntoLanes::Angle(radial) => factor = radial.radii_per_distance::<FUSED, W>([x, y, z]),
        }
        let (mut a, mut b) = ([0.0; W], [0.0; W]);
        for j in 0..W {
            (a[j], b[j]) = (x[j] * factor[j], y[j] * factor[j]);
        }
        [a, b]
    }
}

/// Sine and cosine of the direction about the axis of a place in a spiral, and those of the angle `theta` to the axis.
pub(super) fn at(place: u32, theta: f64) -> ([f64; 2], (f64, f64)) {
    let (sin, cos) = (2.4 * f64::from(place)).sin_cos();
    ([sin, cos], theta.sin_cos())
}

impl Kernel<3, 2> for Stepwise {
    #[inline(always)]
    fn lanes<const FUSED: bool, const W: usize>(&self, [x, y, z]: [[f64; W]; 3]) -> [[f64; W]; 2] {
        let fused = multiply_add::<FUSED>;
        let mut norm = [0.0; W];
        for j in 0..W {
            norm[j] = fused(x[j], x[j], fused(y[j], y[j], z[j] * z[j])).sqrt();
        }
        let on_plane = self.onto_plane::<FUSED, W>([x, y, z], &norm);
        let [mut a, mut b] = self.plane.moved::<FUSED, W>(on_plane);
        if let Some(tilt) = &self.tilt {
            for j in 0..W {
                let row = |row: usize| fused(tilt[(row, 0)], a[j], fused(tilt[(row, 1)], b[j], tilt[(row, 2)]));
                let over = 1.0 / row(2);
                (a[j], b[j]) = (row(0) * over, row(1) * over);
            }
        }
        let [[ua, ub, u0], [va, vb, v0]] = self.affine;
        for j in 0..W {
            let (u, v) = (fused(ua, a[j], fused(ub, b[j], u0)), fused(va, a[j], fused(vb, b[j], v0)));
            // The origin has no direction.
            let inside = if norm[j] > 0.0 { fused(-self.end, norm[j], z[j]) } else { f64::NAN };
            let near = RIM * norm[j];
            let told = if inside > near { u } else { f64::NAN };
            a[j] = if inside.abs() <= near { ASK } else { told };
            b[j] = if inside > near { v } else { f64::NAN };
        }
        [a, b]
    }
}

over_rows!(stepwise_baseline, stepwise_best, Stepwise, LANES, 3 => 2);
