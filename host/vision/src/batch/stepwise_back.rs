//! Rays of whole arrays of pixels by models that are [`LensSteps`], the steps taken back.
//!
//! Distortion has no inverse in closed form: Newton's method finds the place before it, from a start that undoes the radial part by a polynomial and
//! then what the other terms add there. All lanes take the same number of steps, until none moves.

use nalgebra::{Matrix2, Matrix3, Vector2, Vector3};

use super::chebyshev::fit;
use super::fold::Fold;
use super::lanes::{Kernel, multiply_add, over_rows, polynomial};
use super::plane::Plane;
use super::radial::{Growing, Radial};
use super::stepwise::{ASK, LawInField, RIM, at};
use super::unproject::Unproject;
use crate::foreign::OntoPlane;
use crate::{ImageSize, KannalaBrandt, LensSteps, Pixel};

/// Rows per step.
const LANES: usize = 32;
/// Most steps of Newton's method: beside a fold the first ones halve what is missing.
const STEPS: usize = 16;
/// The square of a last step: what is missing after it is its square, times the fifty of a fold.
const SMALLEST: f64 = 1e-12;

/// The steps of a lens taken back, prepared.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct StepwiseBack {
    affine: [[f64; 3]; 2],
    untilt: Option<Matrix3<f64>>,
    plane: Plane,
    start: Option<Start>,
    onto_rays: OntoRays,
    /// Square of the distance from the axis, after distortion, beyond which nothing of the field is imaged.
    most: f64,
    /// The same up to the corners of the sensor: beyond it the model itself is asked.
    seen: f64,
    /// The cosine of the angle at the end of the field.
    end: f64,
}

#[derive(Clone, Debug, PartialEq)]
enum OntoRays {
    Sphere(f64),
    Angle(Unproject),
}

impl StepwiseBack {
    /// `None` where it does not come near.
    pub(super) fn new(lens: &KannalaBrandt, steps: &LensSteps, theta_max: f64) -> Option<Self> {
        let (sin, cos) = theta_max.sin_cos();
        let (onto_rays, reach) = match &steps.onto_plane {
            OntoPlane::Sphere(xi) => (OntoRays::Sphere(*xi), sin / (cos + xi)),
            OntoPlane::Angle(law) => {
                let law = LawInField { law, theta_max: theta_max * (1.0 + 1e-8) };
                (OntoRays::Angle(Unproject::of_growing(&law)?), law.largest_radius())
            }
            OntoPlane::Stereographic(_) => return None,
        };
        let plane = Plane::new(&steps.distortion.coefficients);
        let tilt = steps.distortion.tilt;
        let mut prepared = Self {
            affine: inverse(steps.affine)?,
            untilt: if tilt == Matrix3::identity() { None } else { Some(tilt.try_inverse()?) },
            plane,
            start: None,
            onto_rays,
            most: most_squared(&plane, reach),
            seen: f64::INFINITY,
            end: cos,
        };
        if plane.is_radial {
            prepared.seen = prepared.corner_squared(lens.size());
            prepared.start = Some(Start::new(&plane, reach, prepared.seen.sqrt())?);
        }
        prepared.is_near(lens, theta_max).then_some(prepared)
    }

    /// The largest squared distance of a corner of the sensor from the axis, and a little more.
    fn corner_squared(&self, size: ImageSize) -> f64 {
        const MARGIN: f64 = 1.1;
        let [right, bottom] = [size.width, size.height].map(|count| f64::from(count) - 0.5);
        let corners = [[-0.5, -0.5], [right, -0.5], [-0.5, bottom], [right, bottom]];
        let squared = |[u, v]: [f64; 2]| {
            let [[x], [y]] = self.on_plane::<false, 1>(&[[u], [v]]);
            x * x + y * y
        };
        corners.map(squared).into_iter().fold(0.0, f64::max) * MARGIN
    }

    /// Whether it gives the rays of the lens.
    fn is_near(&self, lens: &KannalaBrandt, theta_max: f64) -> bool {
        const RAYS: u32 = 400;
        const LARGEST_ERROR: f64 = 8e-10;
        (0..RAYS).all(|place| {
            let ([sin, cos], theta) = at(place, theta_max * f64::from(place) / f64::from(RAYS));
            let sent = Vector3::new(theta.0 * cos, theta.0 * sin, theta.1);
            let ray = crate::UnitRay::<crate::Camera>::new(sent);
            let Some(Pixel { u, v }) = ray.and_then(|ray| lens.project(&ray).ok()) else { return true };
            let [[x], [y], [z]] = self.lanes::<false, 1>([[u], [v]]);
            x == ASK || (sent - Vector3::new(x, y, z)).norm() <= LARGEST_ERROR
        })
    }

    /// Where pixels are on the plane, after distortion.
    #[inline(always)]
    fn on_plane<const FUSED: bool, const W: usize>(&self, [u, v]: &[[f64; W]; 2]) -> [[f64; W]; 2] {
        let fused = multiply_add::<FUSED>;
        let ([[xu, xv, x0], [yu, yv, y0]], mut at) = (self.affine, [[0.0; W]; 2]);
        for j in 0..W {
            at[0][j] = fused(xu, u[j], fused(xv, v[j], x0));
            at[1][j] = fused(yu, u[j], fused(yv, v[j], y0));
        }
        if let Some(untilt) = &self.untilt {
            let [first, second] = &mut at;
            for (a, b) in first.iter_mut().zip(second) {
                let (x, y) = (*a, *b);
                let row = |row: usize| fused(untilt[(row, 0)], x, fused(untilt[(row, 1)], y, untilt[(row, 2)]));
                let over = 1.0 / row(2);
                (*a, *b) = (row(0) * over, row(1) * over);
            }
        }
        at
    }

    /// Places before distortion; not numbers where none is found.
    #[inline(always)]
    fn before<const FUSED: bool, const W: usize>(&self, wanted: [[f64; W]; 2]) -> [[f64; W]; 2] {
        if !self.plane.is_radial && !self.plane.is_asymmetric {
            return wanted;
        }
        let mut found = self.started::<FUSED, W>(&wanted);
        if self.plane.is_asymmetric {
            let added = self.plane.added::<FUSED, W>(&found);
            let mut symmetric = wanted;
            for j in 0..W {
                symmetric[0][j] -= added[0][j];
                symmetric[1][j] -= added[1][j];
            }
            found = self.started::<FUSED, W>(&symmetric);
        }
        let mut last = [0.0; W];
        for _ in 0..STEPS {
            let moved = self.plane.moved_with_slopes::<FUSED, W>(&found);
            let [[xx, xy], [yx, yy]] = moved.by;
            for j in 0..W {
                let over = 1.0 / (xx[j] * yy[j] - xy[j] * yx[j]);
                let (off_x, off_y) = (wanted[0][j] - moved.at[0][j], wanted[1][j] - moved.at[1][j]);
                let step_x = (yy[j] * off_x - xy[j] * off_y) * over;
                let step_y = (xx[j] * off_y - yx[j] * off_x) * over;
                found[0][j] += step_x;
                found[1][j] += step_y;
                last[j] = multiply_add::<FUSED>(step_x, step_x, step_y * step_y);
            }
            let mut longest = 0.0;
            for square in last {
                longest = if square > longest { square } else { longest };
            }
            if longest <= SMALLEST {
                break;
            }
        }
        for j in 0..W {
            found[0][j] = if last[j] <= SMALLEST { found[0][j] } else { f64::NAN };
        }
        found
    }

    #[inline(always)]
    fn started<const FUSED: bool, const W: usize>(&self, wanted: &[[f64; W]; 2]) -> [[f64; W]; 2] {
        match &self.start {
            Some(start) => start.lanes::<FUSED, W>(wanted),
            None => *wanted,
        }
    }

    #[inline(always)]
    fn rays<const FUSED: bool, const W: usize>(&self, [mut x, mut y]: [[f64; W]; 2]) -> [[f64; W]; 3] {
        let xi = match &self.onto_rays {
            OntoRays::Angle(radial) => return radial.lanes::<FUSED, W>([x, y]),
            OntoRays::Sphere(xi) => *xi,
        };
        let (fused, mut z, bend) = (multiply_add::<FUSED>, [0.0; W], 1.0 - xi * xi);
        for j in 0..W {
            let squared = fused(x[j], x[j], y[j] * y[j]);
            let factor = (xi + fused(bend, squared, 1.0).sqrt()) / (1.0 + squared);
            (x[j], y[j], z[j]) = (x[j] * factor, y[j] * factor, factor - xi);
        }
        [x, y, z]
    }
}

impl Kernel<2, 3> for StepwiseBack {
    #[inline(always)]
    fn lanes<const FUSED: bool, const W: usize>(&self, pixels: [[f64; W]; 2]) -> [[f64; W]; 3] {
        let (mut at, mut outside) = (self.on_plane::<FUSED, W>(&pixels), [0.0; W]);
        for j in 0..W {
            let squared = multiply_add::<FUSED>(at[0][j], at[0][j], at[1][j] * at[1][j]);
            // What is no number is outside. Outside, nothing is sought.
            let is_inside = squared <= self.seen && squared <= self.most;
            outside[j] = if squared <= self.most { 0.0 } else { f64::NAN };
            outside[j] += if squared > self.seen { ASK } else { 0.0 };
            at[0][j] = if is_inside { at[0][j] } else { 0.0 };
            at[1][j] = if is_inside { at[1][j] } else { 0.0 };
        }
        let [mut x, mut y, mut z] = self.rays::<FUSED, W>(self.before::<FUSED, W>(at));
        for j in 0..W {
            // Beyond the end there may still be another ray, before it.
            let is_told = z[j] - self.end > RIM && x[j].is_finite();
            x[j] = outside[j] + if is_told { x[j] } else { ASK };
            y[j] += outside[j];
            z[j] += outside[j];
        }
        [x, y, z]
    }
}

/// A start of the search: the radial part undone, nearly.
#[derive(Clone, Debug, PartialEq)]
struct Start {
    /// The radius before over the one after.
    factor: Vec<f64>,
    /// Factor of the map from the squared radius after to t in [-1, 1].
    slope: f64,
    fold: Option<Fold>,
}

impl Start {
    /// Up to `reach` before distortion, and up to `seen` after it.
    fn new(plane: &Plane, reach: f64, seen: f64) -> Option<Self> {
        const TERMS: std::ops::RangeInclusive<usize> = 6..=42;
        /// The nearer the start, the fewer steps of Newton's method.
        const LARGEST_ERRORS: [f64; 3] = [1e-6, 1e-4, 1e-2];
        let whole = Radius { plane, reach };
        let radial = if whole.largest_radius() > seen { Radius { plane, reach: whole.angle(seen) } } else { whole };
        let folds = [None, Fold::of(&radial)];
        let starts = LARGEST_ERRORS.into_iter().flat_map(|error| folds.map(|fold| (error, fold)));
        let near = |(error, fold)| {
            TERMS
                .step_by(4)
                .map(|terms| Self::of_terms(&radial, terms, fold))
                .find(|start| start.error(&radial) <= error)
        };
        starts.into_iter().find_map(near)
    }

    fn of_terms(radial: &Radius<'_>, terms: usize, fold: Option<Fold>) -> Self {
        let most = radial.largest_radius();
        let factor = fit(terms, |t| {
            let after = most * (0.5 * (fold.map_or(t, |fold| fold.t(t)) + 1.0)).max(0.0).sqrt();
            if after > 0.0 { radial.angle(after) / after } else { 1.0 }
        });
        Self { factor, slope: 2.0 / (most * most), fold }
    }

    /// The largest error of a radius.
    fn error(&self, radial: &Radius<'_>) -> f64 {
        const RADII: u32 = 200;
        let error = |step: u32| {
            let after = radial.largest_radius() * f64::from(step) / f64::from(RADII);
            let [[x], _] = self.lanes::<false, 1>(&[[after], [0.0]]);
            (x - radial.angle(after)).abs()
        };
        (1..=RADII).map(error).fold(0.0, f64::max)
    }

    #[inline(always)]
    fn lanes<const FUSED: bool, const W: usize>(&self, wanted: &[[f64; W]; 2]) -> [[f64; W]; 2] {
        let (mut t, [mut x, mut y]) = ([0.0; W], *wanted);
        for j in 0..W {
            let squared = multiply_add::<FUSED>(x[j], x[j], y[j] * y[j]);
            let along = multiply_add::<FUSED>(self.slope, squared, -1.0);
            // The image of a field that is no circle goes a little beyond.
            t[j] = if along < 1.0 { along } else { 1.0 };
        }
        if let Some(fold) = &self.fold {
            for t in &mut t {
                *t = fold.variable(*t);
            }
        }
        let factor = polynomial::<FUSED, W>(&self.factor, &t);
        for j in 0..W {
            (x[j], y[j]) = (x[j] * factor[j], y[j] * factor[j]);
        }
        [x, y]
    }
}

/// The radial part of a distortion; "angles" are radii before it.
struct Radius<'a> {
    plane: &'a Plane,
    reach: f64,
}

impl Radial for Radius<'_> {
    const LARGEST_ERROR: f64 = 1e-6;

    fn angle(&self, radius: f64) -> f64 {
        let (mut low, mut high) = (0.0, self.reach);
        for _ in 0..60 {
            let middle = 0.5 * (low + high);
            if middle * self.plane.growth(middle * middle) < radius { low = middle } else { high = middle }
        }
        low
    }

    fn largest_radius(&self) -> f64 {
        self.reach * self.plane.growth(self.reach * self.reach)
    }

    fn on_axis(&self) -> f64 {
        1.0
    }

    fn middle(&self) -> Pixel {
        Pixel { u: 0.0, v: 0.0 }
    }

    fn stretch(&self) -> f64 {
        1.0
    }
}

impl Growing for Radius<'_> {
    fn theta_max(&self) -> f64 {
        self.reach
    }

    fn radius(&self, before: f64) -> Option<f64> {
        Some(before * self.plane.growth(before * before))
    }
}

/// The largest squared distance of the image of a circle from the axis, and a little more.
fn most_squared(plane: &Plane, reach: f64) -> f64 {
    const AROUND: u32 = 720;
    let squared = |step: u32| {
        let (sin, cos) = (std::f64::consts::TAU * f64::from(step) / f64::from(AROUND)).sin_cos();
        let [[x], [y]] = plane.moved::<false, 1>([[reach * cos], [reach * sin]]);
        x * x + y * y
    };
    (0..AROUND).map(squared).fold(0.0, f64::max) * (1.0 + 1e-4)
}

/// The inverse of an affine map.
fn inverse([[a, b, c], [d, e, f]]: [[f64; 3]; 2]) -> Option<[[f64; 3]; 2]> {
    let turned = Matrix2::new(a, b, d, e).try_inverse()?;
    let shift = turned * -Vector2::new(c, f);
    Some([[turned[(0, 0)], turned[(0, 1)], shift.x], [turned[(1, 0)], turned[(1, 1)], shift.y]])
}

over_rows!(stepwise_back_baseline, stepwise_back_best, StepwiseBack, LANES, 2 => 3);
