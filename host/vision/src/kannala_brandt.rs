//! The Kannala-Brandt fisheye model, valid past 90°.
//!
//! J. Kannala and S. Brandt, "A generic camera model and calibration method for conventional, wide-angle, and
//! fish-eye lenses", PAMI 28(8), 2006, eq. 6 with five coefficients:
//!
//! ```text
//! r(θ) = k1 θ + k2 θ³ + k3 θ⁵ + k4 θ⁷ + k5 θ⁹        u = cx + r cos φ        v = cy + aspect · r sin φ
//! ```
//!
//! θ is the angle to the optical axis, from 0 to beyond 90°; φ runs from x (right) to y (down). `k` is in pixels. To this come terms of θ¹¹
//! and θ¹³ ([`KannalaBrandt::with_further_terms`]), a pupil that moves ([`crate::Pupil`]) and elements off the axis ([`crate::Asymmetry`]),
//! where a lens has them. A lens of another program's file is
//! computed by that program's own model ([`ForeignModel`]).

use std::str::FromStr;

use nalgebra::Vector3;

use crate::radial_series::RadialSeries;
use crate::{Angle, Asymmetry, ForeignModel, Frame, InvalidLens, Point, Pupil, UnitRay};

/// An image position in pixels. (0, 0) is the centre of the top-left pixel, u to the right, v down.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Pixel {
    /// Column.
    pub u: f64,
    /// Row.
    pub v: f64,
}

/// Width and height of an image in pixels.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct ImageSize {
    /// Number of pixel columns.
    pub width: u32,
    /// Number of pixel rows.
    pub height: u32,
}

impl ImageSize {
    /// Whether `pixel` lies on a sensor of this size, which extends half a pixel beyond the outermost pixel centres.
    #[must_use]
    pub fn contains(self, pixel: Pixel) -> bool {
        let inside = |x: f64, n: u32| x >= -0.5 && x <= f64::from(n) - 0.5;
        inside(pixel.u, self.width) && inside(pixel.v, self.height)
    }
}

/// A text that is no image size.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("write width x height in pixels, such as 960x600")]
pub struct InvalidImageSize;

impl FromStr for ImageSize {
    type Err = InvalidImageSize;

    /// Parses `960x600`.
    fn from_str(text: &str) -> Result<Self, Self::Err> {
        let (width, height) = text.split_once(['x', 'X', '×']).ok_or(InvalidImageSize)?;
        let count = |part: &str| part.trim().parse().ok().filter(|n| (1..=100_000).contains(n)).ok_or(InvalidImageSize);
        Ok(Self { width: count(width)?, height: count(height)? })
    }
}

/// A fisheye lens with its sensor: projects rays to pixels and unprojects pixels to rays.
///
/// ```
/// # use vergence_vision::{Angle, Camera, ImageSize, KannalaBrandt, Pixel};
/// // An equidistant lens with 366 pixels per radian, valid up to 98° from its axis.
/// let (centre, size) = (Pixel { u: 639.5, v: 639.5 }, ImageSize { width: 1280, height: 1280 });
/// let lens = KannalaBrandt::new([366.0, 0.0, 0.0, 0.0, 0.0], 1.0, centre, Angle::from_deg(98.0), size)?;
/// let ray = lens.unproject::<Camera>(Pixel { u: 20.0, v: 639.5 })?;
/// assert!(ray.vector().z < 0.0, "it points behind the image plane");
/// let pixel = lens.project(&ray)?;
/// assert!((pixel.u - 20.0).abs() < 1e-9);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct KannalaBrandt {
    series: RadialSeries,
    aspect: f64,
    centre: Pixel,
    theta_max: f64,
    r_max: f64,
    /// The largest angle to the axis at which the lens was measured, in radians.
    measured: f64,
    size: ImageSize,
    pupil: Pupil,
    asymmetry: Asymmetry,
    foreign: Option<ForeignModel>,
}

/// A ray or pixel outside the lens's valid cone.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[error("outside the lens's valid cone")]
pub struct OutsideField;

impl KannalaBrandt {
    /// Makes a lens from the five coefficients in pixels, `aspect` = fy / fx, the principal point, the half field
    /// `theta_max` and the image size.
    ///
    /// # Errors
    /// [`InvalidLens`] where the parameters are not finite, not positive, or r(θ) does not grow up to `theta_max`.
    pub fn new(
        k: [f64; 5],
        aspect: f64,
        centre: Pixel,
        theta_max: Angle,
        size: ImageSize,
    ) -> Result<Self, InvalidLens> {
        Self::of_series(RadialSeries { k, further: [0.0; 2] }, aspect, centre, theta_max, size)
    }

    pub(crate) fn of_series(
        series: RadialSeries,
        aspect: f64,
        centre: Pixel,
        theta_max: Angle,
        size: ImageSize,
    ) -> Result<Self, InvalidLens> {
        let stated = theta_max.rad();
        if !series.terms().iter().chain(&[aspect, centre.u, centre.v, stated]).all(|x| x.is_finite()) {
            return Err(InvalidLens::NotFinite);
        }
        if series.k[0] <= 0.0 || aspect <= 0.0 {
            return Err(InvalidLens::FocalLength);
        }
        if stated <= 0.0 || stated >= std::f64::consts::PI {
            return Err(InvalidLens::ThetaMax(theta_max));
        }
        if let Some(turn) = series.first_turn(stated) {
            return Err(InvalidLens::TurnsOver { turn: Angle::from_rad(turn), stated: theta_max });
        }
        Ok(Self {
            series,
            aspect,
            centre,
            theta_max: stated,
            r_max: series.radius(stated),
            measured: stated,
            size,
            pupil: Pupil::default(),
            asymmetry: Asymmetry::default(),
            foreign: None,
        })
    }

    /// Returns this lens on a sensor of the same size in millimetres with `width` pixel columns, and rows in
    /// proportion.
    ///
    /// # Errors
    /// [`InvalidLens`] where the scaled sensor has no pixels.
    pub fn resampled(&self, width: u32) -> Result<Self, InvalidLens> {
        let scale = f64::from(width) / f64::from(self.size.width);
        let height = (f64::from(self.size.height) * scale).round() as u32;
        // Pixel centres are whole numbers, so the sensor's corner is at (-1/2, -1/2).
        let scaled = |coordinate: f64| (coordinate + 0.5) * scale - 0.5;
        let centre = Pixel { u: scaled(self.centre.u), v: scaled(self.centre.v) };
        let size = ImageSize { width, height };
        let series = RadialSeries { k: self.series.k.map(|k| k * scale), ..self.series };
        let lens = Self::of_series(series, self.aspect, centre, self.theta_max(), size)?;
        let foreign = self.foreign.map(|model| model.scaled(scale));
        Ok(Self { measured: self.measured, pupil: self.pupil, asymmetry: self.asymmetry, foreign, ..lens })
    }

    /// This lens with the coefficients k5 and k6 of [`Self::from_opencv_with`] in the place of its own.
    ///
    /// # Errors
    /// The errors of [`KannalaBrandt::new`] and of [`KannalaBrandt::with_asymmetry`].
    pub fn with_further_terms(self, further: [f64; 2]) -> Result<Self, InvalidLens> {
        let series = RadialSeries { further, ..self.series };
        let lens = Self::of_series(series, self.aspect, self.centre, self.theta_max(), self.size)?;
        let lens = lens.with_asymmetry(self.asymmetry)?;
        Ok(Self { measured: self.measured, pupil: self.pupil, foreign: self.foreign, ..lens })
    }

    /// The same lens beyond the field in which it was measured: as far as [`crate::OpenCvFisheye::largest_theta`] says that its polynomial is of use.
    /// [`Self::is_measured`] still tells the field in which it was measured. A lens of another program's model stays as it is.
    #[must_use]
    pub fn extrapolated(&self) -> Self {
        if self.foreign.is_some() {
            return *self;
        }
        let wider = self
            .series
            .largest_theta(self.aspect, self.centre, self.size)
            .and_then(|limit| Self::of_series(self.series, self.aspect, self.centre, limit, self.size))
            .and_then(|wider| wider.with_asymmetry(self.asymmetry));
        match wider {
            Ok(wider) if wider.theta_max > self.theta_max => {
                Self { measured: self.measured, pupil: self.pupil, ..wider }
            }
            _ => *self,
        }
    }

    /// Whether the lens was measured in the direction of `ray`, and is not extrapolated there.
    #[must_use]
    pub fn is_measured<F: Frame>(&self, ray: &UnitRay<F>) -> bool {
        ray.angle_to_axis().rad() <= self.measured
    }

    /// Half of the field in which the lens was measured; [`Self::theta_max`] is more where it is [extrapolated](Self::extrapolated).
    #[must_use]
    pub const fn measured_field(&self) -> Angle {
        Angle::from_rad(self.measured)
    }

    /// Projects the direction of `ray` to its pixel. A point at a finite distance is seen by [`Self::ray_to`] it.
    ///
    /// # Errors
    /// [`OutsideField`] beyond `theta_max`. The pixel may still lie outside the sensor: see [`Self::on_sensor`].
    pub fn project<F: Frame>(&self, ray: &UnitRay<F>) -> Result<Pixel, OutsideField> {
        let d = ray.vector();
        let rho = d.x.hypot(d.y);
        let theta = rho.atan2(d.z);
        if theta > self.theta_max {
            return Err(OutsideField);
        }
        if let Some(model) = &self.foreign {
            return model.project(ray);
        }
        // At the axis r/rho tends to k1.
        let scale = if rho > 0.0 { self.series.radius(theta) / rho } else { self.series.k[0] };
        let symmetric = Pixel { u: self.centre.u + scale * d.x, v: self.centre.v + self.aspect * scale * d.y };
        Ok(self.with_displacement(symmetric))
    }

    /// Projects `point` to its pixel.
    ///
    /// # Errors
    /// [`OutsideField`] beyond `theta_max` and for a point that [`Self::ray_to`] has no ray to.
    pub fn project_point<F: Frame>(&self, point: &Point<F>) -> Result<Pixel, OutsideField> {
        self.project(&self.ray_to(point).ok_or(OutsideField)?)
    }

    /// Unprojects `pixel` to the direction of its ray, in the camera frame `F` that the caller names. The ray starts at
    /// [`Self::origin_of`].
    ///
    /// # Errors
    /// [`OutsideField`] beyond `theta_max`; the ray is never clamped.
    pub fn unproject<F: Frame>(&self, pixel: Pixel) -> Result<UnitRay<F>, OutsideField> {
        if let Some(model) = &self.foreign {
            return self.foreign_ray(model, pixel).map(|ray| ray.renamed());
        }
        let pixel = self.without_displacement(pixel).ok_or(OutsideField)?;
        let (x, y) = (pixel.u - self.centre.u, (pixel.v - self.centre.v) / self.aspect);
        let r = x.hypot(y);
        if r.is_nan() || r > self.r_max {
            return Err(OutsideField);
        }
        let theta = self.angle_at_radius(r);
        let scale = if r > 0.0 { theta.sin() / r } else { 1.0 / self.series.k[0] };
        UnitRay::new(Vector3::new(x * scale, y * scale, theta.cos())).ok_or(OutsideField)
    }

    /// Solves r(θ) = `r` for θ, by Newton's method kept inside a shrinking bracket.
    pub(crate) fn angle_at_radius(&self, r: f64) -> f64 {
        let (mut low, mut high) = (0.0, self.theta_max);
        let mut theta = (r / self.series.k[0]).clamp(low, high);
        for _ in 0..60 {
            let error = self.series.radius(theta) - r;
            if error > 0.0 {
                high = theta;
            } else {
                low = theta;
            }
            let newton = theta - error / self.series.slope(theta);
            let next = if newton >= low && newton <= high { newton } else { 0.5 * (low + high) };
            let step = (next - theta).abs();
            theta = next;
            if step <= 4.0 * f64::EPSILON {
                break;
            }
        }
        theta
    }

    /// Whether `pixel` lies on the sensor. The sensor extends half a pixel beyond the outermost pixel centres.
    #[must_use]
    pub fn on_sensor(&self, pixel: Pixel) -> bool {
        self.size.contains(pixel)
    }

    pub(crate) const fn moved_pupil(self, pupil: Pupil) -> Self {
        Self { pupil, ..self }
    }

    pub(crate) const fn made_foreign(self, model: Option<ForeignModel>) -> Self {
        Self { foreign: model, ..self }
    }

    pub(crate) const fn made_asymmetric(self, asymmetry: Asymmetry) -> Self {
        Self { asymmetry, ..self }
    }

    /// How the pupil moves; the default of a central lens.
    #[must_use]
    pub const fn pupil(&self) -> Pupil {
        self.pupil
    }

    /// The model of another program by which the lens is computed; `None` where it is computed by its polynomial.
    #[must_use]
    pub const fn foreign_model(&self) -> Option<&ForeignModel> {
        self.foreign.as_ref()
    }

    /// By how much the lens is not symmetric about its axis.
    #[must_use]
    pub const fn asymmetry(&self) -> Asymmetry {
        self.asymmetry
    }

    /// The five coefficients k1 to k5 in pixels, without [`Self::further_terms`].
    #[must_use]
    pub const fn k(&self) -> [f64; 5] {
        self.series.k
    }

    pub(crate) const fn series(&self) -> &RadialSeries {
        &self.series
    }

    /// The aspect ratio fy / fx.
    #[must_use]
    pub const fn aspect(&self) -> f64 {
        self.aspect
    }

    /// The principal point.
    #[must_use]
    pub const fn centre(&self) -> Pixel {
        self.centre
    }

    /// Half the field of view: the largest valid angle to the optical axis.
    #[must_use]
    pub const fn theta_max(&self) -> Angle {
        Angle::from_rad(self.theta_max)
    }

    /// The image radius in pixels along u at the angle `theta` to the axis, of the lens as if it were symmetric.
    #[must_use]
    pub fn radius(&self, theta: Angle) -> f64 {
        self.series.radius(theta.rad())
    }

    /// The image radius r(theta_max) in pixels.
    pub(crate) const fn radius_max(&self) -> f64 {
        self.r_max
    }

    /// The image size.
    #[must_use]
    pub const fn size(&self) -> ImageSize {
        self.size
    }

    /// The radial resolution dr/dθ in pixels per radian, at the angle `theta` from the optical axis.
    #[must_use]
    pub fn pixels_per_radian(&self, theta: Angle) -> f64 {
        self.series.slope(theta.rad())
    }
}
