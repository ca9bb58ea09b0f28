//! A central and symmetric lens in place of one that is not, for programs that know of no other.

use nalgebra::{Vector2, Vector3};

use crate::lens_derivatives::CENTRAL_PARAMETERS;
use crate::lens_step::lens_step;
use crate::{Angle, Camera, InvalidLens, KannalaBrandt, Length, OpenCvFisheye, Pixel, Point, UnitRay};

/// Directions of points and their images.
type Images = Vec<(UnitRay<Camera>, Pixel)>;

impl KannalaBrandt {
    /// The central and symmetric lens that images points at `distance` from the origin as this one does, by least squares over the field.
    ///
    /// # Errors
    /// [`InvalidLens`] where no lens fits, as for points nearer than the pupil moves.
    pub fn central_at(&self, distance: Length) -> Result<Self, InvalidLens> {
        /// The image is linear in all but the products of focal lengths with k.
        const STEPS: usize = 5;
        if self.fits_opencv() {
            return Ok(*self);
        }
        let seen = self.images_at(distance);
        let outermost = Angle::from_rad(seen.iter().map(|(ray, _)| ray.angle_to_axis().rad()).fold(0.0, f64::max));
        // Without its further terms the radius may turn over.
        let k = if self.has_further_terms() { [0.0; 4] } else { self.to_opencv().k };
        let start = OpenCvFisheye { k, ..self.to_opencv() };
        let mut found = Self::from_opencv(start, outermost, self.size())?;
        for _ in 0..STEPS {
            let stepped = found.towards(&seen).ok_or(InvalidLens::NotFinite)?;
            found = Self::from_opencv(stepped, outermost, self.size())?;
        }
        Ok(found)
    }

    /// OpenCV's parameters of the lens that comes nearest in directions to this one without its pupil and its asymmetry: those of
    /// [`Self::to_opencv`], unless the radius has further terms.
    #[must_use]
    pub fn nearest_opencv(&self) -> OpenCvFisheye {
        let bare = Self::of_series(*self.series(), self.aspect(), self.centre(), self.theta_max(), self.size());
        let nearest = bare.and_then(|lens| lens.central_at(Length::from_mm(1.0)));
        nearest.map_or_else(|_| self.to_opencv(), |lens| lens.to_opencv())
    }

    /// The largest distance in pixels between the images of points at `distance` by this lens and by `central`, over the field of both.
    #[must_use]
    pub fn largest_difference(&self, central: &Self, distance: Length) -> f64 {
        let off = |(ray, pixel): &(UnitRay<Camera>, Pixel)| {
            central.project(ray).map_or(0.0, |at| (at.u - pixel.u).hypot(at.v - pixel.v))
        };
        self.images_at(distance).iter().map(off).fold(0.0, f64::max)
    }

    /// Directions of points at `distance` as seen from the origin, over the field, and their images.
    fn images_at(&self, distance: Length) -> Images {
        const RINGS: usize = 100;
        const AROUND: usize = 24;
        let seen = |place: usize| {
            let theta = self.theta_max().rad() * (place / AROUND + 1) as f64 / RINGS as f64;
            let (y, x) = (std::f64::consts::TAU * (place % AROUND) as f64 / AROUND as f64).sin_cos();
            let (sine, cosine) = theta.sin_cos();
            let ray = UnitRay::<Camera>::new(Vector3::new(x * sine, y * sine, cosine))?;
            Some((ray, self.project_point(&Point::<Camera>::from_mm(ray.vector() * distance.mm())).ok()?))
        };
        (0..RINGS * AROUND).filter_map(seen).collect()
    }

    /// The parameters after a step towards the images; `None` where they do not determine it.
    fn towards(&self, seen: &Images) -> Option<OpenCvFisheye> {
        let missing = |(ray, pixel): &(UnitRay<Camera>, Pixel)| {
            let at = self.project(ray).ok()?;
            Some((*ray, Vector2::new(pixel.u - at.u, pixel.v - at.v)))
        };
        let columns: [usize; CENTRAL_PARAMETERS] = std::array::from_fn(|column| column);
        let step = lens_step(self, &columns, seen.iter().filter_map(missing))?;
        Some(self.to_opencv().stepped(step.as_slice()))
    }
}
