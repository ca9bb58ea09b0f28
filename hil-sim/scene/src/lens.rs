//! The lenses that the renderer looks through: ideal ones with one centre, and true ones whose pupil moves.

use std::fmt::{self, Debug};
use std::str::FromStr;
use std::sync::Arc;

use vergence_lens::{BuiltIn, DesignError, TracedLens};
use vergence_vision::{
    Angle, BatchLens, Camera, ImageSize, Instructions, KannalaBrandt, Length, Pixel, Point, UnitRay,
};

/// A lens before a sensor, as the renderer needs it. The camera's frame has its origin at the paraxial entrance pupil.
pub trait Lens: Debug + Sync {
    /// Size of the image.
    fn size(&self) -> ImageSize;

    /// The largest angle of light to the axis.
    fn theta_max(&self) -> Angle;

    /// Pixels per radian along the radius at an angle to the axis.
    fn pixels_per_radian(&self, theta: Angle) -> f64;

    /// Where a point of the camera's frame is imaged, on the sensor or beside it; `None` outside the field.
    fn image_of(&self, point: &Point<Camera>) -> Option<Pixel>;

    /// The light of a pixel: where it crosses the axis, and the direction it comes from; `None` outside the field.
    fn light_of(&self, pixel: Pixel) -> Option<(Point<Camera>, UnitRay<Camera>)>;

    /// The lens made ready for the rays of many pixels.
    fn rays(&self) -> LensRays<'_>;

    /// How far before the camera's origin light at an angle to the axis crosses it; `None` of a lens with one centre.
    fn pupil(&self, _theta: Angle) -> Option<Length> {
        None
    }

    /// The lens's own light at an angle, as a share of that on the axis; `None` where [`Optics::vignette`](crate::Optics::vignette) says it.
    fn illumination(&self, _theta: Angle) -> Option<f64> {
        None
    }

    /// Variance in square pixels of the image of a far point in each direction, beside that of [`Optics::blur_px`](crate::Optics::blur_px): the
    /// mean of along the radius and across it.
    fn spot_variance(&self, _theta: Angle) -> f64 {
        0.0
    }

    /// What it is, for people: the name of its design, and that of the ideal one.
    fn describe(&self) -> String;

    /// The same lens before a part of its sensor, of `size` pixels from the pixel in column `left` and row `top` on; `None` where that is no
    /// image.
    fn before_part(&self, left_top: [u32; 2], size: ImageSize) -> Option<TrueLens>;
}

/// A lens made ready for many pixels.
#[derive(Debug)]
pub enum LensRays<'a> {
    /// By the batches of the ideal lens.
    Ideal(Box<BatchLens>),
    /// By the table of a traced lens.
    Traced(&'a TracedLens),
}

impl LensRays<'_> {
    /// The directions of the light of some pixels, unit vectors of the camera's frame; not numbers outside the field.
    #[must_use]
    pub fn directions(&self, pixels: &[[f64; 2]]) -> Vec<[f64; 3]> {
        match self {
            Self::Ideal(lens) => lens.unproject(pixels),
            Self::Traced(lens) => lens.directions(pixels),
        }
    }

    /// [`Self::directions`] of pixels that are asked for again and again.
    #[must_use]
    pub fn kept_directions(&self, pixels: &[[f64; 2]]) -> Arc<[[f64; 3]]> {
        match self {
            Self::Ideal(lens) => lens.unproject(pixels).into(),
            Self::Traced(lens) => lens.kept_directions(pixels),
        }
    }
}

impl Lens for KannalaBrandt {
    fn size(&self) -> ImageSize {
        self.size()
    }

    fn theta_max(&self) -> Angle {
        self.theta_max()
    }

    fn pixels_per_radian(&self, theta: Angle) -> f64 {
        self.pixels_per_radian(theta)
    }

    fn image_of(&self, point: &Point<Camera>) -> Option<Pixel> {
        self.project_point(point).ok()
    }

    fn light_of(&self, pixel: Pixel) -> Option<(Point<Camera>, UnitRay<Camera>)> {
        let ray = self.unproject(pixel).ok()?;
        Some((self.origin_of(&ray), ray))
    }

    /// Without the instructions of this very processor: the same image on every machine.
    fn rays(&self) -> LensRays<'_> {
        LensRays::Ideal(Box::new(BatchLens::new(self).with_instructions(Instructions::Baseline)))
    }

    fn pupil(&self, theta: Angle) -> Option<Length> {
        (!self.is_central()).then(|| self.pupil().shift(theta))
    }

    fn describe(&self) -> String {
        LensChoice::Ideal.to_string()
    }

    fn before_part(&self, [left, top]: [u32; 2], size: ImageSize) -> Option<TrueLens> {
        if self.foreign_model().is_some() {
            return None;
        }
        let mut part = self.to_opencv();
        (part.cx, part.cy) = (part.cx - f64::from(left), part.cy - f64::from(top));
        let part = Self::from_opencv_with(part, self.further_terms(), self.theta_max(), size).ok()?;
        part.with_pupil(self.pupil()).ok()?.with_asymmetry(self.asymmetry()).ok().map(TrueLens::Ideal)
    }
}

impl Lens for TracedLens {
    fn size(&self) -> ImageSize {
        self.sensor().size
    }

    fn theta_max(&self) -> Angle {
        self.theta_max()
    }

    fn pixels_per_radian(&self, theta: Angle) -> f64 {
        self.pixels_per_radian(theta)
    }

    fn image_of(&self, point: &Point<Camera>) -> Option<Pixel> {
        self.project(point)
    }

    fn light_of(&self, pixel: Pixel) -> Option<(Point<Camera>, UnitRay<Camera>)> {
        self.ray(pixel).map(|ray| (ray.origin, ray.direction))
    }

    fn rays(&self) -> LensRays<'_> {
        LensRays::Traced(self)
    }

    fn pupil(&self, theta: Angle) -> Option<Length> {
        Some(self.pupil(theta))
    }

    fn illumination(&self, theta: Angle) -> Option<f64> {
        Some(self.illumination(theta))
    }

    fn spot_variance(&self, theta: Angle) -> f64 {
        let [radial, tangential] = self.spot_px(theta);
        0.5 * (radial * radial + tangential * tangential)
    }

    fn describe(&self) -> String {
        self.describe()
    }

    fn before_part(&self, left_top: [u32; 2], size: ImageSize) -> Option<TrueLens> {
        Some(TrueLens::Traced(self.before_part(left_top, size)))
    }
}

/// Which lens a simulated camera has.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum LensChoice {
    /// The Kannala-Brandt lens of the rig's description: one centre, and the very model that calibrations fit.
    #[default]
    Ideal,
    /// A published design in its place, traced surface by surface.
    Traced(BuiltIn),
}

/// A lens of a simulated camera.
#[derive(Clone, Debug)]
pub enum TrueLens {
    /// With one centre.
    Ideal(KannalaBrandt),
    /// Traced.
    Traced(TracedLens),
}

/// A name that is none of a lens.
#[derive(Debug, thiserror::Error)]
#[error("no lens '{0}': there are {list}", list = LensChoice::ALL.map(|lens| lens.to_string()).join(", "))]
pub struct UnknownLens(String);

impl LensChoice {
    /// All of them.
    pub const ALL: [Self; 3] = [Self::Ideal, Self::Traced(BuiltIn::Sigma8), Self::Traced(BuiltIn::Nikkor6)];

    /// The lens in the place of an ideal one: with its scale on the axis, centre, sensor and field. Sensors are as wide as the bench's, of 2048
    /// pixels of 2.4 µm, whatever the number of their pixels.
    ///
    /// # Errors
    /// Where a built-in design cannot be traced: never, once the tests have passed.
    pub fn in_place_of(self, ideal: &KannalaBrandt) -> Result<TrueLens, DesignError> {
        const SENSOR_MM: f64 = 2048.0 * 0.0024;
        match self {
            Self::Ideal => Ok(TrueLens::Ideal(*ideal)),
            Self::Traced(design) => {
                let pixel = Length::from_mm(SENSOR_MM / f64::from(ideal.size().width.max(1)));
                TracedLens::in_place_of(ideal, design, pixel).map(TrueLens::Traced)
            }
        }
    }
}

impl fmt::Display for LensChoice {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Ideal => "ideal",
            Self::Traced(design) => design.name(),
        })
    }
}

impl FromStr for LensChoice {
    type Err = UnknownLens;

    fn from_str(name: &str) -> Result<Self, UnknownLens> {
        Self::ALL.into_iter().find(|lens| lens.to_string() == name).ok_or_else(|| UnknownLens(name.to_owned()))
    }
}

impl TrueLens {
    fn inner(&self) -> &dyn Lens {
        match self {
            Self::Ideal(lens) => lens,
            Self::Traced(lens) => lens,
        }
    }
}

impl From<KannalaBrandt> for TrueLens {
    fn from(lens: KannalaBrandt) -> Self {
        Self::Ideal(lens)
    }
}

impl Lens for TrueLens {
    fn size(&self) -> ImageSize {
        self.inner().size()
    }

    fn theta_max(&self) -> Angle {
        self.inner().theta_max()
    }

    fn pixels_per_radian(&self, theta: Angle) -> f64 {
        self.inner().pixels_per_radian(theta)
    }

    fn image_of(&self, point: &Point<Camera>) -> Option<Pixel> {
        self.inner().image_of(point)
    }

    fn light_of(&self, pixel: Pixel) -> Option<(Point<Camera>, UnitRay<Camera>)> {
        self.inner().light_of(pixel)
    }

    fn rays(&self) -> LensRays<'_> {
        self.inner().rays()
    }

    fn pupil(&self, theta: Angle) -> Option<Length> {
        self.inner().pupil(theta)
    }

    fn illumination(&self, theta: Angle) -> Option<f64> {
        self.inner().illumination(theta)
    }

    fn spot_variance(&self, theta: Angle) -> f64 {
        self.inner().spot_variance(theta)
    }

    fn describe(&self) -> String {
        self.inner().describe()
    }

    fn before_part(&self, left_top: [u32; 2], size: ImageSize) -> Option<TrueLens> {
        self.inner().before_part(left_top, size)
    }
}
