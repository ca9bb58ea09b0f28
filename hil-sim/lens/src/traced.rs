//! A traced lens before a sensor: where a point is imaged, and from where a pixel's light comes.

use std::sync::{Arc, Mutex, PoisonError};

use nalgebra::{Vector2, Vector3};
use vergence_vision::{Angle, Camera, Frame, ImageSize, KannalaBrandt, Length, Pixel, Point, Transform, UnitRay};

use crate::curve::Curve;
use crate::design::BuiltIn;
use crate::displaced::{Asymmetry, Displacement};
use crate::error::DesignError;
use crate::table::LensTable;

/// The sensor behind a lens. Pixels are square.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sensor {
    /// Width and height.
    pub size: ImageSize,
    /// Where the axis of the lens meets it.
    pub centre: Pixel,
    /// Side of a pixel.
    pub pixel: Length,
}

/// How large the lens is made.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum ImageScale {
    /// Pixels per radian on the axis: the paraxial focal length in pixels.
    OnAxis(f64),
    /// Distance in pixels from the centre to the image of light at 98 degrees to the axis.
    At98Degrees(f64),
}

/// The light of a pixel: it crosses the axis of the lens at `origin`, which differs by its angle to the axis.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LensRay {
    /// On the axis, in front of the paraxial entrance pupil, which is the origin of the camera's frame.
    pub origin: Point<Camera>,
    /// Towards the scene.
    pub direction: UnitRay<Camera>,
}

/// A true lens with its sensor. The frame of the camera: x right, y down, z along the axis towards the scene, from the paraxial entrance
/// pupil, in millimetres.
#[derive(Clone, Debug)]
pub struct TracedLens {
    table: Arc<LensTable>,
    sensor: Sensor,
    /// Largest angle of light to the axis.
    theta_max: Angle,
    /// Pixels per millimetre at the size of the table.
    pixels: f64,
    /// This lens's size over that of the table.
    size: f64,
    /// Whether a point is imaged where its spot has its centroid, rather than where its chief ray arrives.
    by_centroid: bool,
    /// Whether the light falls off towards the edge and points are spread, rather than the geometry alone.
    is_bare: bool,
    /// Of displaced elements.
    asymmetry: Option<Arc<Asymmetry>>,
    /// Of this very geometry.
    kept: Arc<KeptDirections>,
}

/// Pixels that were asked for together, and the directions of their light.
#[derive(Debug, Default)]
struct KeptDirections(Mutex<Option<Asked>>);
type Asked = (Vec<[f64; 2]>, Arc<[[f64; 3]]>);

impl TracedLens {
    /// The lens of a table at some size before a sensor, as far as light at `theta_max` to its axis, or to the edge of its field where that
    /// is nearer.
    #[must_use]
    pub fn new(table: Arc<LensTable>, scale: ImageScale, sensor: Sensor, theta_max: Angle) -> Self {
        let pixels = match scale {
            ImageScale::OnAxis(focal_length) => focal_length / table.focal_length,
            ImageScale::At98Degrees(radius) => radius / table.rays.image_height(Angle::from_deg(98.0)),
        };
        let size = pixels * sensor.pixel.mm();
        let theta_max = Angle::from_rad(theta_max.rad().min(table.rays.height.end()));
        Self {
            table,
            sensor,
            theta_max,
            pixels,
            size,
            by_centroid: false,
            is_bare: false,
            asymmetry: None,
            kept: Arc::default(),
        }
    }

    /// A built-in lens in the place of an ideal one: with its scale on the axis, centre, sensor and field. Pixels are `pixel` wide.
    ///
    /// # Errors
    /// None where the program was built from the files that its tests have read.
    pub fn in_place_of(ideal: &KannalaBrandt, lens: BuiltIn, pixel: Length) -> Result<Self, DesignError> {
        let sensor = Sensor { size: ideal.size(), centre: ideal.centre(), pixel };
        let scale = ImageScale::OnAxis(ideal.pixels_per_radian(Angle::from_rad(0.0)));
        Ok(Self::new(LensTable::built_in(lens)?, scale, sensor, ideal.theta_max()))
    }

    /// The same lens, which images a point where its spot has its centroid. The difference to the chief ray, up to a pixel, is taken as that
    /// of far points at all ranges.
    #[must_use]
    pub fn by_centroid(self) -> Self {
        Self { by_centroid: true, kept: Arc::default(), ..self }
    }

    /// The geometry of the lens alone: as bright at the edge as in the middle, and points are points.
    #[must_use]
    pub fn bare(self) -> Self {
        Self { is_bare: true, kept: Arc::default(), ..self }
    }

    /// The same lens with its elements and its sensor displaced. Its pupil is left on the axis, from where such displacements move it by some
    /// micrometres.
    ///
    /// # Errors
    /// Where light no longer passes inside the field.
    pub fn displaced(self, by: &Displacement) -> Result<Self, DesignError> {
        let by = Displacement { decentre: Length::from_mm(by.decentre.mm() / self.size), ..*by };
        let asymmetry = Some(Arc::new(Asymmetry::of(&self.table.design, &by, self.theta_max)?));
        Ok(Self { asymmetry, kept: Arc::default(), ..self })
    }

    /// The same lens before a part of its sensor, of `size` pixels from the pixel in column `left` and row `top` on.
    #[must_use]
    pub fn before_part(&self, [left, top]: [u32; 2], size: ImageSize) -> Self {
        let Pixel { u, v } = self.sensor.centre;
        let centre = Pixel { u: u - f64::from(left), v: v - f64::from(top) };
        Self { sensor: Sensor { size, centre, ..self.sensor }, kept: Arc::default(), ..self.clone() }
    }

    /// The name of its design.
    #[must_use]
    pub fn name(&self) -> &str {
        self.table.name()
    }

    /// What it is, in a line: design, f-number, focal length, source.
    #[must_use]
    pub fn describe(&self) -> String {
        let table = &self.table;
        let focal_length = table.focal_length * self.size;
        format!(
            "{} at f/{:.1}, f = {focal_length:.3} mm, traced from {}",
            table.name(),
            table.f_number(),
            table.source()
        )
    }

    /// The sensor.
    #[must_use]
    pub const fn sensor(&self) -> Sensor {
        self.sensor
    }

    /// The largest angle of light to the axis.
    #[must_use]
    pub const fn theta_max(&self) -> Angle {
        self.theta_max
    }

    fn height(&self) -> &Curve {
        if self.by_centroid { &self.table.centroid } else { &self.table.rays.height }
    }

    /// Distance from the centre in pixels of the image of light at `theta` to the axis.
    #[must_use]
    pub fn radius_px(&self, theta: Angle) -> f64 {
        self.pixels * self.height().at(theta.rad()).0
    }

    /// Change of [`Self::radius_px`] per radian.
    #[must_use]
    pub fn pixels_per_radian(&self, theta: Angle) -> f64 {
        self.pixels * self.height().at(theta.rad()).1
    }

    /// How far in front of the camera's origin light at `theta` to the axis crosses it.
    #[must_use]
    pub fn pupil(&self, theta: Angle) -> Length {
        Length::from_mm(self.size * self.table.rays.pupil_shift(theta))
    }

    /// Light on the sensor as a share of that on the axis, from an evenly bright scene.
    #[must_use]
    pub fn illumination(&self, theta: Angle) -> f64 {
        if self.is_bare { 1.0 } else { self.table.rays.illumination(theta) }
    }

    /// Root mean square widths in pixels of the image of a far point, along the radius and across it.
    #[must_use]
    pub fn spot_px(&self, theta: Angle) -> [f64; 2] {
        let pixels = if self.is_bare { 0.0 } else { self.pixels };
        self.table.spot.each_ref().map(|width| pixels * width.at(theta.rad()).0.max(0.0))
    }

    /// Where a point is imaged; `None` outside the field, and nearer to the lens than its pupil moves. The pixel may lie beside the sensor.
    #[must_use]
    pub fn project(&self, point: &Point<Camera>) -> Option<Pixel> {
        let theta = self.table.rays.angle_to(&Point::from_mm(point.mm() / self.size))?;
        if theta.rad() > self.theta_max.rad() {
            return None;
        }
        let across = point.mm().xy();
        let outward = outward(&across);
        Some(self.on_sensor_at(outward * self.radius_px(theta) + self.off_design(theta, outward)))
    }

    /// The light that arrives at a pixel; `None` outside the field.
    #[must_use]
    pub fn ray(&self, pixel: Pixel) -> Option<LensRay> {
        let Pixel { u, v } = self.sensor.centre;
        let from_centre = Vector2::new(pixel.u - u, pixel.v - v);
        let (theta, outward) = self.by_design(self.as_by_design(from_centre)?)?;
        if theta.rad() > self.theta_max.rad() {
            return None;
        }
        let outward = outward * theta.rad().sin();
        let direction = UnitRay::new(Vector3::new(outward.x, outward.y, theta.rad().cos()))?;
        Some(LensRay { origin: Point::from_mm(Vector3::z() * self.pupil(theta).mm()), direction })
    }

    /// The directions of the light of some pixels, unit vectors of the camera's frame; not numbers outside the field.
    #[must_use]
    pub fn directions(&self, pixels: &[[f64; 2]]) -> Vec<[f64; 3]> {
        let direction =
            |&[u, v]: &[f64; 2]| self.ray(Pixel { u, v }).map_or([f64::NAN; 3], |ray| ray.direction.vector().into());
        pixels.iter().map(direction).collect()
    }

    /// [`Self::directions`], kept for whoever asks for the same pixels next: those of displaced elements take a search each.
    #[must_use]
    pub fn kept_directions(&self, pixels: &[[f64; 2]]) -> Arc<[[f64; 3]]> {
        let kept = || self.kept.0.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some((_, directions)) = kept().as_ref().filter(|(asked, _)| asked == pixels) {
            return Arc::clone(directions);
        }
        let directions: Arc<[[f64; 3]]> = self.directions(pixels).into();
        *kept() = Some((pixels.to_vec(), Arc::clone(&directions)));
        directions
    }

    /// Where points of a target are imaged by a camera before which it stands: exact truth for a calibration. `None` outside the field and
    /// beside the sensor.
    #[must_use]
    pub fn project_target<T: Frame>(
        &self,
        camera_from_target: &Transform<Camera, T>,
        points: &[Point<T>],
    ) -> Vec<Option<Pixel>> {
        let on_sensor =
            |point: &Point<T>| self.project(&(*camera_from_target * *point)).filter(|at| self.on_sensor(*at));
        points.iter().map(on_sensor).collect()
    }

    /// Whether a pixel lies on the sensor, which extends half a pixel beyond the outermost pixel centres.
    #[must_use]
    pub fn on_sensor(&self, pixel: Pixel) -> bool {
        self.sensor.size.contains(pixel)
    }

    /// The angle of light that the design images there, and the direction it comes from.
    fn by_design(&self, from_centre: Vector2<f64>) -> Option<(Angle, Vector2<f64>)> {
        let theta = self.height().argument_of(from_centre.norm() / self.pixels).map(Angle::from_rad)?;
        Some((theta, outward(&from_centre)))
    }

    /// How far displaced elements move the image, in pixels.
    fn off_design(&self, theta: Angle, outward: Vector2<f64>) -> Vector2<f64> {
        self.asymmetry.as_ref().map_or_else(Vector2::zeros, |asymmetry| asymmetry.at(theta, outward) * self.pixels)
    }

    /// Where the design images the light that arrives at a place; `None` outside the field. The displacement changes by less than a part in thirty
    /// of the way, so that each step of the search leaves less than that.
    fn as_by_design(&self, from_centre: Vector2<f64>) -> Option<Vector2<f64>> {
        const STEPS: usize = 24;
        const NO_CHANGE_PX: f64 = 1e-10;
        let edge = (1.0 - 1e-9) * self.radius_px(Angle::from_rad(self.height().end()));
        let mut place = from_centre;
        if self.asymmetry.is_some() {
            for _ in 0..STEPS {
                // On the way it may lie beyond the field, with the light of its edge.
                let inside = place * (edge / place.norm()).min(1.0);
                let (theta, outward) = self.by_design(inside)?;
                let better = from_centre - self.off_design(theta, outward);
                let change = (better - place).norm();
                place = better;
                if change < NO_CHANGE_PX {
                    break;
                }
            }
        }
        Some(place)
    }

    fn on_sensor_at(&self, from_centre: Vector2<f64>) -> Pixel {
        let Pixel { u, v } = self.sensor.centre;
        Pixel { u: u + from_centre.x, v: v + from_centre.y }
    }
}

/// The unit vector from the axis to a place. On the axis any one will do: displaced elements move the light there all the same.
fn outward(place: &Vector2<f64>) -> Vector2<f64> {
    place.try_normalize(0.0).unwrap_or_else(Vector2::x)
}
