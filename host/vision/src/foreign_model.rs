//! Lenses that are computed with by the camera model of another program as it is.
//!
//! Such a lens has a polynomial too, the one that comes nearest ([`crate::fit_lens`]): there the search for the ray of a pixel starts, from
//! there a calibration that frees the lens goes on, and that is what a program gets that knows no other model. Pixels, rays and the
//! derivatives of one by the other are the model's own.

use nalgebra::{Matrix2x3, Matrix3x2, Vector2, Vector3};

use crate::{
    Angle, Camera, CameraModel, Frame, KannalaBrandt, LensSteps, ModelParameter, OutsideField, Pixel, UnitRay,
};

/// The camera model of another program by which a lens is computed.
///
/// It lives until the program ends, so that lenses can be copied like numbers: some kilobytes for each camera file that is read.
#[derive(Clone, Copy, Debug)]
pub struct ForeignModel {
    model: &'static dyn CameraModel,
    /// Pixels of the lens for each of the model's.
    scale: f64,
}

impl PartialEq for ForeignModel {
    /// Whether both give the same pixels: one model, with the same parameters.
    fn eq(&self, other: &Self) -> bool {
        self.scale == other.scale && self.name() == other.name() && self.parameters() == other.parameters()
    }
}

impl ForeignModel {
    /// The name of the model.
    #[must_use]
    pub fn name(&self) -> &'static str {
        self.model.name()
    }

    /// The parameters of the model, by their names in the program that it comes from.
    #[must_use]
    pub fn parameters(&self) -> Vec<ModelParameter> {
        self.model.parameters()
    }

    /// Pixels of the lens for each of the model's: 1, unless the sensor was resampled.
    #[must_use]
    pub const fn scale(&self) -> f64 {
        self.scale
    }

    /// The model as steps to the lens's own pixels, where it has such.
    pub(crate) fn steps(&self) -> Option<LensSteps> {
        Some(self.model.steps()?.resampled(self.scale))
    }

    pub(crate) const fn scaled(self, scale: f64) -> Self {
        Self { scale: self.scale * scale, ..self }
    }

    /// A pixel of the model as one of the lens. Pixel centres are whole numbers, so the sensor's corner is at (-1/2, -1/2).
    #[expect(clippy::float_cmp, reason = "exactly one, unless the sensor was resampled")]
    fn of_lens(&self, pixel: Pixel) -> Pixel {
        let along = |coordinate: f64| (coordinate + 0.5) * self.scale - 0.5;
        if self.scale == 1.0 { pixel } else { Pixel { u: along(pixel.u), v: along(pixel.v) } }
    }

    #[expect(clippy::float_cmp, reason = "exactly one, unless the sensor was resampled")]
    fn of_model(&self, pixel: Pixel) -> Pixel {
        let along = |coordinate: f64| (coordinate + 0.5) / self.scale - 0.5;
        if self.scale == 1.0 { pixel } else { Pixel { u: along(pixel.u), v: along(pixel.v) } }
    }

    pub(crate) fn project<F: Frame>(&self, ray: &UnitRay<F>) -> Result<Pixel, OutsideField> {
        self.model.project(&ray.renamed()).map(|pixel| self.of_lens(pixel))
    }

    /// The derivative of the pixel by the unit vector of `ray`; `None` beyond the model's cone.
    pub(crate) fn pixel_by_ray<F: Frame>(&self, ray: &UnitRay<F>) -> Option<Matrix2x3<f64>> {
        Some(self.model.pixel_by_ray(&ray.renamed()).ok()? * self.scale)
    }

    /// The derivative of the unit vector of `ray` by its pixel: the rows of the other derivative span the plane across the ray.
    pub(crate) fn ray_by_pixel<F: Frame>(&self, ray: &UnitRay<F>) -> Option<Matrix3x2<f64>> {
        let by_ray = self.pixel_by_ray(ray)?;
        Some(by_ray.transpose() * (by_ray * by_ray.transpose()).try_inverse()?)
    }

    /// The ray of `pixel`, sought from the ray `start` and the movement `by_pixel` of rays there, both by the nearest polynomial.
    ///
    /// C. Broyden, "A class of methods for solving nonlinear simultaneous equations", Math. Comp. 19, 1965: the derivative is mended by
    /// what each step moves, so that the model is asked for a handful of pixels and for no derivative.
    pub(crate) fn ray_of(
        &self,
        pixel: Pixel,
        start: UnitRay<Camera>,
        by_pixel: Matrix3x2<f64>,
    ) -> Result<UnitRay<Camera>, OutsideField> {
        match self.sought(pixel, start, by_pixel) {
            Some(ray) => Ok(ray),
            // Slower, and it always ends.
            None => self.model.unproject(self.of_model(pixel)).map(|sight| sight.ray),
        }
    }

    fn sought(&self, pixel: Pixel, start: UnitRay<Camera>, mut by_pixel: Matrix3x2<f64>) -> Option<UnitRay<Camera>> {
        const STEPS: usize = 16;
        /// After a step of this many radians the error is below rounding.
        const SMALLEST: f64 = 1e-8;
        /// What the pixel may then be short of, in pixels, and as a share of its own coordinates: far away rays are dense.
        const NEAR: f64 = 1e-6;
        let short_of = |ray: &UnitRay<Camera>| {
            let seen = self.project(ray).ok()?;
            Some(Vector2::new(pixel.u - seen.u, pixel.v - seen.v))
        };
        // Where the model says nothing of the start, from a ray nearer to the axis: by up to a fifth of a radian.
        let nearer = |step: i32| UnitRay::<Camera>::new(start.vector() + Vector3::z() * (0.01 * f64::from(step)));
        let (mut ray, mut missing) =
            (0..=20).find_map(|step| nearer(step).and_then(|ray| short_of(&ray).map(|missing| (ray, missing))))?;
        for _ in 0..STEPS {
            let step = by_pixel * missing;
            let (next, left) = Self::inside(&ray, &step, short_of)?;
            let made = next.vector() - ray.vector();
            let moved = missing - left;
            let along = by_pixel.transpose() * made;
            // Where nothing moved the search is at its end.
            if moved.norm_squared() > 0.0 {
                by_pixel += (made - by_pixel * moved) * along.transpose() / along.dot(&moved);
            }
            (ray, missing) = (next, left);
            if step.norm() <= SMALLEST {
                let is_there = missing.norm() <= NEAR * (1.0 + pixel.u.abs().max(pixel.v.abs()));
                return UnitRay::new(ray.vector() + by_pixel * missing).filter(|_| is_there);
            }
        }
        None
    }

    /// The ray after `step`, or after a half of it and so on where the model says nothing of the ray after more, with what it is short of.
    fn inside(
        ray: &UnitRay<Camera>,
        step: &Vector3<f64>,
        short_of: impl Fn(&UnitRay<Camera>) -> Option<Vector2<f64>>,
    ) -> Option<(UnitRay<Camera>, Vector2<f64>)> {
        const HALVES: i32 = 10;
        (0..HALVES).find_map(|half| {
            let next = UnitRay::<Camera>::new(ray.vector() + step * 0.5_f64.powi(half))?;
            short_of(&next).map(|left| (next, left))
        })
    }
}

impl KannalaBrandt {
    /// This lens, which comes near `model`, computed by the model itself from now on, with `scale` pixels of its own for each of the
    /// model's. Its field stays.
    #[must_use]
    pub fn computed_by(self, model: Box<dyn CameraModel>, scale: f64) -> Self {
        self.made_foreign(Some(ForeignModel { model: Box::leak(model), scale }))
    }

    /// The angle to the axis at which the field of the lens or of its model ends, in radians.
    pub(crate) fn foreign_field(&self) -> f64 {
        let own = self.theta_max().rad();
        self.foreign_model().map_or(own, |model| own.min(model.model.half_field().rad()))
    }

    /// The ray of `pixel` by `model`, the lens's own.
    pub(crate) fn foreign_ray(&self, model: &ForeignModel, pixel: Pixel) -> Result<UnitRay<Camera>, OutsideField> {
        let start = self.near(pixel).ok_or(OutsideField)?;
        let ray = model.ray_of(pixel, start, self.polynomial_ray_by_pixel(&start))?;
        if ray.angle_to_axis() <= self.theta_max() { Ok(ray) } else { Err(OutsideField) }
    }

    /// A ray near that of `pixel`: by the polynomial, or on the rim of the field for a pixel beyond it.
    fn near(&self, pixel: Pixel) -> Option<UnitRay<Camera>> {
        let (pixel, centre) = (self.without_displacement(pixel)?, self.centre());
        let (x, y) = (pixel.u - centre.u, (pixel.v - centre.v) / self.aspect());
        let r = x.hypot(y);
        let theta = self.angle_at_radius(r.min(self.radius_max()));
        let scale = if r > 0.0 { theta.sin() / r } else { 1.0 / self.pixels_per_radian(Angle::default()) };
        UnitRay::new(Vector3::new(x * scale, y * scale, theta.cos()))
    }
}
