//! Lenses that are symmetric about their axis, whatever their model: all that batches need of them is how the radius grows with the angle.

use nalgebra::Vector3;

use super::arc_tangent::distance_and_angle;
use super::chebyshev::fit;
use super::fold::Fold;
use super::lanes::{Kernel, over_rows, polynomial};
use super::project::{pixels, scales};
use crate::{Camera, ForeignModel, KannalaBrandt, Pixel, UnitRay};

/// A lens whose image is symmetric about its axis, but for the aspect ratio.
pub(super) trait Radial {
    /// The largest error of a component of a ray that its polynomials may have.
    const LARGEST_ERROR: f64;

    /// The angle to the axis, in radians, at a radius in pixels along u.
    fn angle(&self, radius: f64) -> f64;

    /// The radius at the end of the field.
    fn largest_radius(&self) -> f64;

    /// Pixels per radian on the axis.
    fn on_axis(&self) -> f64;

    /// The pixel of the axis.
    fn middle(&self) -> Pixel;

    /// The scale of v over that of u.
    fn stretch(&self) -> f64;
}

/// A lens whose radii are known by the angle too.
pub(super) trait Growing: Radial {
    /// The angle to the axis at the end of the field, in radians.
    fn theta_max(&self) -> f64;

    /// The radius in pixels at an angle in radians.
    fn radius(&self, theta: f64) -> Option<f64>;
}

impl Radial for KannalaBrandt {
    const LARGEST_ERROR: f64 = 7e-15;

    fn angle(&self, radius: f64) -> f64 {
        self.angle_at_radius(radius)
    }

    fn largest_radius(&self) -> f64 {
        self.radius_max()
    }

    fn on_axis(&self) -> f64 {
        self.k()[0]
    }

    fn middle(&self) -> Pixel {
        self.centre()
    }

    fn stretch(&self) -> f64 {
        self.aspect()
    }
}

/// A lens of another program's model that is symmetric.
pub(super) struct ForeignRadial<'a> {
    lens: &'a KannalaBrandt,
    model: &'a ForeignModel,
    middle: Pixel,
    stretch: f64,
}

impl<'a> ForeignRadial<'a> {
    /// `None` where the model is not symmetric.
    pub(super) fn of(lens: &'a KannalaBrandt) -> Option<Self> {
        const RINGS: u32 = 16;
        const SPOKES: u32 = 12;
        let model = lens.foreign_model()?;
        let field = lens.theta_max().rad();
        let middle = pixel(model, 0.0, 0.0)?;
        let [along, down] = [0.0, std::f64::consts::FRAC_PI_2].map(|phi| pixel(model, 0.5 * field, phi));
        let stretch = (down?.v - middle.v) / (along?.u - middle.u);
        let found = Self { lens, model, middle, stretch };
        let is_symmetric = |place: u32| {
            let theta = field * (1.0 - 1e-12) * f64::from(place / SPOKES + 1) / f64::from(RINGS);
            let phi = std::f64::consts::TAU * f64::from(place % SPOKES) / f64::from(SPOKES);
            let seen = pixel(model, theta, phi).zip(found.radius(theta));
            seen.is_some_and(|(seen, radius)| {
                let (u, v) = (middle.u + radius * phi.cos(), middle.v + stretch * radius * phi.sin());
                (seen.u - u).hypot(seen.v - v) < 1e-11 * (1.0 + radius)
            })
        };
        (0..RINGS * SPOKES).all(is_symmetric).then_some(found)
    }
}

impl Growing for ForeignRadial<'_> {
    fn theta_max(&self) -> f64 {
        self.lens.theta_max().rad()
    }

    fn radius(&self, theta: f64) -> Option<f64> {
        pixel(self.model, theta, 0.0).map(|seen| seen.u - self.middle.u)
    }
}

fn pixel(model: &ForeignModel, theta: f64, phi: f64) -> Option<Pixel> {
    let (sine, cosine) = theta.sin_cos();
    model.project(&UnitRay::<Camera>::new(Vector3::new(sine * phi.cos(), sine * phi.sin(), cosine))?).ok()
}

impl Radial for ForeignRadial<'_> {
    /// Rays of the model itself are sought to a thousandth of that.
    const LARGEST_ERROR: f64 = 3e-10;

    fn angle(&self, radius: f64) -> f64 {
        let ray = self.lens.unproject::<Camera>(Pixel { u: self.middle.u + radius, v: self.middle.v });
        // Rounding may put the last ray beyond the end of the field.
        ray.map_or(self.lens.theta_max(), |ray| ray.angle_to_axis()).rad()
    }

    fn largest_radius(&self) -> f64 {
        self.radius(self.lens.theta_max().rad() * (1.0 - 1e-15)).unwrap_or_default()
    }

    fn on_axis(&self) -> f64 {
        const NEAR: f64 = 1e-4;
        self.radius(NEAR).unwrap_or_default() / NEAR
    }

    fn middle(&self) -> Pixel {
        self.middle
    }

    fn stretch(&self) -> f64 {
        self.stretch
    }
}

/// A symmetric lens of another model as one polynomial: the radius over the angle, by the square of the angle.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct ProjectRadial {
    growth: Vec<f64>,
    /// Factor of the map from θ² to t in [-1, 1].
    slope: f64,
    /// Where it is by the angle itself.
    by_angle: Option<Fold>,
    stretch: f64,
    middle: [f64; 2],
    theta_max: f64,
}

impl ProjectRadial {
    /// `None` where 48 terms do not suffice.
    pub(super) fn new<L: Growing>(lens: &L) -> Option<Self> {
        let near = |by_angle| {
            (6..=48).step_by(3).map(|terms| Self::of_terms(lens, terms, by_angle)).find(|fit| fit.is_near(lens))
        };
        near(None).or_else(|| near(Some(Fold::RADIUS)))
    }

    fn of_terms(lens: &impl Growing, terms: usize, by_angle: Option<Fold>) -> Self {
        let theta_max = lens.theta_max();
        let growth = fit(terms, |t| {
            let theta = theta_max * (0.5 * (by_angle.map_or(t, |fold| fold.t(t)) + 1.0)).sqrt();
            lens.radius(theta).unwrap_or(f64::NAN) / theta
        });
        let Pixel { u, v } = lens.middle();
        let slope = 2.0 / (theta_max * theta_max);
        Self { growth, slope, by_angle, stretch: lens.stretch(), middle: [u, v], theta_max }
    }

    fn is_near<L: Growing>(&self, lens: &L) -> bool {
        const ANGLES: u32 = 500;
        let limit = L::LARGEST_ERROR * lens.on_axis();
        (1..ANGLES).all(|step| {
            let theta = self.theta_max * f64::from(step) / f64::from(ANGLES);
            let t = self.slope * theta * theta - 1.0;
            let t = [self.by_angle.map_or(t, |fold| fold.variable(t))];
            let [growth] = polynomial::<false, 1>(&self.growth, &t);
            lens.radius(theta).is_some_and(|radius| (theta * growth - radius).abs() <= limit)
        })
    }
}

impl Kernel<3, 2> for ProjectRadial {
    #[inline(always)]
    fn lanes<const FUSED: bool, const W: usize>(&self, [x, y, z]: [[f64; W]; 3]) -> [[f64; W]; 2] {
        let scale = self.radii_per_distance::<FUSED, W>([x, y, z]);
        pixels([x, y], scale, self.middle, self.stretch)
    }
}

impl ProjectRadial {
    /// The radius over the distance from the axis.
    #[inline(always)]
    pub(super) fn radii_per_distance<const FUSED: bool, const W: usize>(&self, point: [[f64; W]; 3]) -> [f64; W] {
        let (rho, theta) = distance_and_angle::<FUSED, W>(&point);
        let mut t = [0.0; W];
        for j in 0..W {
            t[j] = self.slope * (theta[j] * theta[j]) - 1.0;
        }
        if let Some(fold) = &self.by_angle {
            for t in &mut t {
                *t = fold.variable(*t);
            }
        }
        let growth = polynomial::<FUSED, W>(&self.growth, &t);
        scales(&rho, &theta, &growth, self.theta_max)
    }
}

/// Rows per step, as of [`super::project`].
const LANES: usize = 32;

over_rows!(radial_baseline, radial_best, ProjectRadial, LANES, 3 => 2);
