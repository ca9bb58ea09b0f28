//! Lenses as they are assembled: elements off the axis and tilted, and a sensor that is not square to it.

use nalgebra::{Isometry3, Matrix2, SMatrix, Translation3, UnitQuaternion, Vector2, Vector3};
use vergence_vision::{Angle, Length};

use crate::design::Design;
use crate::error::{DesignError, LostRay};
use crate::surface::Ray;
use crate::trace::Limits;

/// How badly a lens is assembled. Every element is displaced by these amounts, each in a direction that the seed decides.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Displacement {
    /// Of an element across the axis. Cemented surfaces are one element.
    pub decentre: Length,
    /// Of an element about the vertex of its first surface.
    pub tilt: Angle,
    /// Of the sensor about the point where the axis meets it.
    pub sensor_tilt: Angle,
    /// Of the directions. The two eyes of a rig have two.
    pub seed: u64,
}

/// Rings of chief rays that are traced, and rays in each.
const RINGS: usize = 28;
const AROUND: usize = 24;

/// Powers of the angle to the axis times 1 and the cosines and sines of φ, 2φ and 3φ.
const POWERS: usize = 11;
const HARMONICS: usize = 7;
const TERMS: usize = POWERS * HARMONICS;

/// A chief ray passes the stop this close to its centre, in focal lengths.
const AT_CENTRE: f64 = 1e-12;

/// How far from where the design images it light arrives, by its angle to the axis and its direction φ around it: fitted to traced chief rays.
/// Millimetres.
#[derive(Clone, Debug)]
pub struct Asymmetry {
    widest: f64,
    /// Along the radius and across it.
    terms: [SMatrix<f64, TERMS, 1>; 2],
}

/// Directions by a seed: SplitMix64 (G. Steele, D. Lea and C. Flood, OOPSLA 2014).
struct Directions(u64);

impl Directions {
    /// A unit vector across the axis.
    fn draw(&mut self) -> Vector3<f64> {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        let turn = std::f64::consts::TAU * ((z ^ (z >> 31)) >> 11) as f64 * 0.5_f64.powi(53);
        Vector3::new(turn.cos(), turn.sin(), 0.0)
    }
}

/// A design with its elements where they were mounted.
#[derive(Clone, Debug)]
pub struct DisplacedDesign<'a> {
    design: &'a Design,
    /// Where each surface is, from where the design has it.
    places: Vec<Isometry3<f64>>,
    sensor: UnitQuaternion<f64>,
}

impl<'a> DisplacedDesign<'a> {
    /// The design with its elements displaced; lengths are millimetres of the design's size.
    #[must_use]
    pub fn new(design: &'a Design, by: &Displacement) -> Self {
        const AIR: f64 = 1.0;
        let mut directions = Directions(by.seed);
        let mut place = Isometry3::identity();
        let mut places = Vec::new();
        for surface in &design.surfaces {
            if surface.index_before == AIR {
                let stands_alone = surface.index_behind == AIR;
                let pivot = Vector3::z() * surface.vertex;
                let (shift, axis) = (directions.draw() * by.decentre.mm(), directions.draw());
                let turn = UnitQuaternion::from_scaled_axis(axis * by.tilt.rad());
                let displaced = Translation3::from(pivot + shift) * turn * Translation3::from(-pivot);
                // The stop is where rays are aimed at.
                place = if stands_alone { Isometry3::identity() } else { displaced };
            }
            places.push(place);
        }
        let sensor = UnitQuaternion::from_scaled_axis(directions.draw() * by.sensor_tilt.rad());
        Self { design, places, sensor }
    }

    fn trace(&self, ray: &Ray, surfaces: usize) -> Result<Ray, LostRay> {
        let mut ray = *ray;
        for (index, (surface, place)) in self.design.surfaces.iter().zip(&self.places).enumerate().take(surfaces) {
            let number = index + 1;
            let local = Ray {
                at: place.inverse_transform_point(&ray.at.into()).coords,
                along: place.inverse_transform_vector(&ray.along),
            };
            let at = surface.meet(&local).ok_or(LostRay::Missed(number))?;
            let along = surface.refract(&at, &local.along).ok_or(LostRay::TotalReflection(number))?;
            ray = Ray { at: (place * nalgebra::Point3::from(at)).coords, along: place * along };
        }
        Ok(ray)
    }

    /// Where a ray meets the sensor, in millimetres of the sensor's plane from where the axis meets it.
    ///
    /// # Errors
    /// Where the ray ends before.
    pub fn on_sensor(&self, ray: &Ray) -> Result<[f64; 2], LostRay> {
        let last = self.trace(ray, self.design.surfaces.len())?;
        let local = |vector: Vector3<f64>| self.sensor.inverse() * vector;
        let (at, along) = (local(last.at - Vector3::z() * self.design.image), local(last.along));
        let met = at - along * (at.z / along.z);
        Ok([met.x, met.y])
    }

    /// The chief ray of light that travels at `theta` to the axis, in the direction of `turn` about it from x to y.
    ///
    /// # Errors
    /// Where no light passes the centre of the stop at this angle.
    pub fn chief_ray(&self, theta: Angle, turn: Angle) -> Result<Ray, DesignError> {
        let about_axis = UnitQuaternion::from_axis_angle(&Vector3::z_axis(), turn.rad());
        let symmetric = self.design.chief_ray(theta)?;
        self.aimed(&symmetric, about_axis).map_err(|lost| DesignError::NoChiefRay { angle: theta, lost })
    }

    /// The ray through the centre of the stop that is parallel to `symmetric` turned by `about_axis`, by Newton's method.
    fn aimed(&self, symmetric: &Ray, about_axis: UnitQuaternion<f64>) -> Result<Ray, LostRay> {
        let along = about_axis * symmetric.along;
        let start = about_axis * symmetric.at;
        let around = about_axis * Vector3::y();
        let across = [around.cross(&along), around];
        let size = self.design.focal_length();
        let at_stop = |by: &Vector2<f64>| {
            let at = start + across[0] * by.x + across[1] * by.y;
            self.trace(&Ray { at, along }, self.design.stop + 1).map(|ray| ray.at.xy())
        };
        let step = 1e-5 * size;
        let mut by = Vector2::zeros();
        for _ in 0..12 {
            let off = at_stop(&by)?;
            if off.norm() < AT_CENTRE * size {
                break;
            }
            let slope =
                |axis: Vector2<f64>| Ok((at_stop(&(by + axis * step))? - at_stop(&(by - axis * step))?) / (2.0 * step));
            let slopes = Matrix2::from_columns(&[slope(Vector2::x())?, slope(Vector2::y())?]);
            let Some(inverse) = slopes.try_inverse() else { break };
            by -= inverse * off;
        }
        Ok(Ray { at: start + across[0] * by.x + across[1] * by.y, along })
    }
}

impl Asymmetry {
    /// Of a design with displaced elements, to its `widest` angle; lengths are millimetres of the design's size.
    ///
    /// # Errors
    /// Where no light passes inside that angle.
    pub fn of(design: &Design, by: &Displacement, widest: Angle) -> Result<Self, DesignError> {
        let displaced = DisplacedDesign::new(design, by);
        let mut normal = SMatrix::<f64, TERMS, TERMS>::zeros();
        let mut moments = [SMatrix::<f64, TERMS, 1>::zeros(); 2];
        for ring in 0..RINGS {
            // Chebyshev's points: a polynomial through them is off least between them.
            let part = 0.5 - 0.5 * (std::f64::consts::PI * (ring as f64 + 0.5) / RINGS as f64).cos();
            let theta = Angle::from_rad(widest.rad() * part);
            let symmetric = design.chief_ray(theta)?;
            let lost = |lost| DesignError::NoChiefRay { angle: theta, lost };
            let [height, _] = design.on_image(&symmetric, Limits::None).map_err(lost)?;
            for number in 0..AROUND {
                let turn = std::f64::consts::TAU * number as f64 / AROUND as f64;
                let about_axis = UnitQuaternion::from_axis_angle(&Vector3::z_axis(), turn);
                let ray = displaced.aimed(&symmetric, about_axis).map_err(lost)?;
                let [x, y] = displaced.on_sensor(&ray).map_err(lost)?;
                let (sin, cos) = turn.sin_cos();
                let terms = terms(part, [cos, sin]);
                normal += terms * terms.transpose();
                moments[0] += terms * (x * cos + y * sin - height);
                moments[1] += terms * (y * cos - x * sin);
            }
        }
        let Some(root) = normal.cholesky() else {
            return Err(DesignError::NoLens("the rays of the displaced lens give no table"));
        };
        Ok(Self { widest: widest.rad(), terms: moments.map(|moment| root.solve(&moment)) })
    }

    /// How far from its place by the design light at `theta` arrives, which comes from the direction of the unit vector `outward`.
    pub fn at(&self, theta: Angle, outward: Vector2<f64>) -> Vector2<f64> {
        let (powers, harmonics) = factors(theta.rad() / self.widest, outward.into());
        let [along, across] = self.terms.each_ref().map(|weights| {
            let mut sums = [0.0; HARMONICS];
            for (power, weights) in powers.iter().zip(weights.as_slice().as_chunks::<HARMONICS>().0) {
                for (sum, weight) in sums.iter_mut().zip(weights) {
                    *sum += power * weight;
                }
            }
            sums.iter().zip(&harmonics).map(|(sum, harmonic)| sum * harmonic).sum::<f64>()
        });
        outward * along + Vector2::new(-outward.y, outward.x) * across
    }
}

/// The terms of the table at a part of the widest angle.
fn terms(part: f64, outward: [f64; 2]) -> SMatrix<f64, TERMS, 1> {
    let (powers, harmonics) = factors(part, outward);
    SMatrix::from_fn(|row, _| powers[row / HARMONICS] * harmonics[row % HARMONICS])
}

/// Their factors. Legendre's polynomials span the same powers of the part, and keep their weights apart.
fn factors(part: f64, [cos, sin]: [f64; 2]) -> ([f64; POWERS], [f64; HARMONICS]) {
    let x = 2.0 * part - 1.0;
    let mut powers = [1.0; POWERS];
    powers[1] = x;
    for n in 1..POWERS - 1 {
        let order = n as f64;
        powers[n + 1] = ((2.0 * order + 1.0) * x * powers[n] - order * powers[n - 1]) / (order + 1.0);
    }
    let (cos_2, sin_2) = (cos * cos - sin * sin, 2.0 * sin * cos);
    (powers, [1.0, cos, sin, cos_2, sin_2, cos_2 * cos - sin_2 * sin, sin_2 * cos + cos_2 * sin])
}
