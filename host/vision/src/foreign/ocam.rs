//! The model of OCamCalib.
//!
//! D. Scaramuzza, A. Martinelli, R. Siegwart, "A toolbox for easily calibrating omnidirectional cameras", IROS 2006: the ray of an image point
//! m at the distance r from the centre is (m, a0 + a1 r + a2 r² + ..). There images have (row, column) for (x, y), and z points backwards.

use nalgebra::Vector3;

use super::double_sphere::must;
use super::{AngleLaw, Formula, LensSteps, ModelParameter, OntoPlane, ParameterUnit, Radtan};
use crate::{InvalidLens, Pixel};

/// The model of OCamCalib.
#[derive(Clone, Debug, PartialEq)]
pub struct OCam {
    /// The polynomial a0, a1, a2, ..., as in the file: a0 is negative and in pixels.
    polynomial: Vec<f64>,
    /// Row and column of the centre in pixels.
    centre: [f64; 2],
    /// The affine parameters c, d, e.
    affine: [f64; 3],
    /// The largest radius in pixels up to which the angle to the axis grows, and that angle.
    reach: [f64; 2],
}

impl OCam {
    /// The model with the polynomial, the centre (row, column) in pixels, and the affine parameters c, d, e of a file.
    ///
    /// # Errors
    /// [`InvalidLens`] where the parameters are none of a camera.
    pub fn new(polynomial: &[f64], centre: [f64; 2], affine: [f64; 3]) -> Result<Self, InvalidLens> {
        let bare = Self { polynomial: polynomial.to_vec(), centre, affine, reach: [0.0; 2] };
        let first = -polynomial.first().copied().unwrap_or_default();
        let [c, d, e] = affine;
        if first.is_nan() || first <= 0.0 {
            return Err(InvalidLens::FocalLength);
        }
        must("c - d e", c - d * e, c - d * e > 0.0, "be positive")?;
        let reach = bare.growing(first);
        Ok(Self { reach, ..bare })
    }

    /// Scans the radius up to six times a0: beyond the image of any lens.
    fn growing(&self, first: f64) -> [f64; 2] {
        const STEPS: u32 = 6000;
        let mut reach = [0.0; 2];
        for step in 1..=STEPS {
            let radius = 6.0 * first * f64::from(step) / f64::from(STEPS);
            let angle = self.angle(radius);
            if angle.is_nan() || angle <= reach[1] {
                break;
            }
            reach = [radius, angle];
        }
        reach
    }

    /// The angle to the axis at the radius r.
    pub(super) fn angle(&self, radius: f64) -> f64 {
        let backwards = self.polynomial.iter().rev().fold(0.0, |sum, a| sum * radius + a);
        radius.atan2(-backwards)
    }

    /// The same with its derivative by the radius.
    fn angle_and_slope(&self, radius: f64) -> (f64, f64) {
        let (backwards, slope) =
            self.polynomial.iter().rev().fold((0.0, 0.0), |(sum, slope), a| (sum * radius + a, slope * radius + sum));
        (radius.atan2(-backwards), (radius * slope - backwards) / (radius * radius + backwards * backwards))
    }

    /// The radius at the angle to the axis, by Newton's method kept inside a shrinking bracket.
    pub(super) fn radius(&self, angle: f64) -> f64 {
        const STEPS: usize = 60;
        let [mut low, mut high] = [0.0, self.reach[0]];
        let mut radius = high * (angle / self.reach[1]).clamp(0.0, 1.0);
        for _ in 0..STEPS {
            let (seen, slope) = self.angle_and_slope(radius);
            if seen < angle {
                low = radius;
            } else {
                high = radius;
            }
            let newton = radius + (angle - seen) / slope;
            let next = if newton >= low && newton <= high { newton } else { 0.5 * (low + high) };
            let step = (next - radius).abs();
            radius = next;
            if step <= 2.0 * f64::EPSILON * high {
                break;
            }
        }
        radius
    }
}

impl Formula for OCam {
    fn name(&self) -> &'static str {
        "OCamCalib"
    }

    fn parameters(&self) -> Vec<ModelParameter> {
        // a_i is in pixels to the power 1 - i.
        let unit = |index| if index == 0 { ParameterUnit::Pixels } else { ParameterUnit::One };
        let series =
            self.polynomial.iter().enumerate().map(|(i, a)| ModelParameter::new(&format!("a{i}"), unit(i), *a));
        let centre = ModelParameter::named(&["row", "column"], ParameterUnit::Pixels, &self.centre);
        series.chain(centre).chain(ModelParameter::named(&["c", "d", "e"], ParameterUnit::One, &self.affine)).collect()
    }

    fn check(&self) -> Result<(), InvalidLens> {
        Ok(())
    }

    fn ends(&self) -> f64 {
        self.reach[1]
    }

    fn image(&self, direction: &Vector3<f64>) -> Option<Pixel> {
        let rho = direction.x.hypot(direction.y);
        let radius = self.radius(rho.atan2(direction.z));
        let scale = if rho > 0.0 { radius / rho } else { 0.0 };
        let (across, down) = (scale * direction.x, scale * direction.y);
        let [c, d, e] = self.affine;
        let [row, column] = self.centre;
        Some(Pixel { u: e * down + across + column, v: c * down + d * across + row })
    }

    fn steps(&self) -> Option<LensSteps> {
        let ([c, d, e], [row, column]) = (self.affine, self.centre);
        Some(LensSteps {
            onto_plane: OntoPlane::Angle(AngleLaw::OCam(self.clone())),
            distortion: Radtan::default(),
            affine: [[1.0, e, column], [d, c, row]],
        })
    }
}
