//! A lens prepared for whole arrays of points and pixels.

use std::borrow::Cow;
use std::sync::OnceLock;

use super::Instructions;
use super::derivatives::{Derivatives, ProjectedPoints};
use super::displaced::Displaced;
use super::foreign::{Foreign, by_chunks};
use super::project::{Project, further_baseline, further_best, project_baseline, project_best};
use super::pupil::{ProjectByPupil, UnprojectByPupil, project_by_pupil, unproject_by_pupil};
use super::radial::{ForeignRadial, ProjectRadial, radial_baseline, radial_best};
use super::unproject::{Unproject, unproject_baseline, unproject_best};
use crate::radial_series::TERMS;
use crate::{Asymmetry, Camera, KannalaBrandt, Pixel, Point, UnitRay};

/// A [`KannalaBrandt`] lens prepared for whole arrays of points and pixels, about ten times faster.
///
/// Preparation takes about a millisecond, once per lens, and some ten for another program's model. Rays agree with the single-point functions
/// to 1e-14 rad, of another program's model to 8e-10 rad. Points stand for
/// directions in all functions but [`Self::project_points`]; where rays of a moving pupil begin, [`Self::unproject_with_shifts`] tells.
#[derive(Clone, Debug, PartialEq)]
pub struct BatchLens {
    lens: KannalaBrandt,
    project: Project<5>,
    /// Of a symmetric lens of another model.
    radial: Option<ProjectRadial>,
    derivatives: Derivatives<5>,
    /// Of a lens with further radial terms, in the place of the other two.
    further: Option<(Project<TERMS>, Derivatives<TERMS>)>,
    displaced: Option<Displaced>,
    unproject: Option<Unproject>,
    /// Of a lens of this program's own model with a moving pupil; made where it is asked for.
    by_pupil: OnceLock<Option<ProjectByPupil>>,
    back_by_pupil: OnceLock<Option<UnprojectByPupil>>,
    /// Of a lens of another model whose symmetric polynomials are not all there.
    foreign: Option<Foreign>,
    instructions: Instructions,
}

impl BatchLens {
    /// Prepares `lens`.
    #[must_use]
    pub fn new(lens: &KannalaBrandt) -> Self {
        let radial = ForeignRadial::of(lens);
        let unproject = match lens.foreign_model() {
            Some(_) => radial.as_ref().and_then(Unproject::of_growing),
            None => Unproject::new(lens),
        };
        let further = || (Project::new(lens, lens.series().terms()), Derivatives::new(lens, lens.series().terms()));
        let foreign = if radial.is_some() && unproject.is_some() { None } else { Foreign::new(lens) };
        Self {
            lens: *lens,
            foreign,
            project: Project::new(lens, lens.k()),
            radial: radial.as_ref().and_then(ProjectRadial::new),
            derivatives: Derivatives::new(lens, lens.k()),
            further: lens.has_further_terms().then(further),
            displaced: Displaced::new(lens),
            by_pupil: OnceLock::new(),
            back_by_pupil: OnceLock::new(),
            unproject,
            instructions: Instructions::Best,
        }
    }

    /// Chooses the processor instructions of later calls.
    #[must_use]
    pub fn with_instructions(self, instructions: Instructions) -> Self {
        Self { instructions, ..self }
    }

    /// Projects points (N × 3 in the camera frame, any unit, components from 1e-150 to 1e150 or zero) to N × 2 pixels.
    /// Rows are NaN beyond `theta_max` and at the optical centre.
    #[must_use]
    pub fn project(&self, points: &[[f64; 3]]) -> Vec<[f64; 2]> {
        let mut pixels = Vec::new();
        self.project_into(points, &mut pixels);
        pixels
    }

    /// Like [`Self::project`], but appends the results to `pixels`.
    pub fn project_into(&self, points: &[[f64; 3]], pixels: &mut Vec<[f64; 2]>) {
        if self.lens.foreign_model().is_some() {
            match (&self.radial, &self.foreign) {
                (Some(fit), _) if self.is_best() => radial_best(fit, points, pixels),
                (Some(fit), _) => radial_baseline(fit, points, pixels),
                (None, Some(foreign)) => foreign.project(points, self.is_best(), pixels),
                // Never: what is not symmetric is there.
                (None, None) => {}
            }
            return;
        }
        let first = pixels.len();
        match &self.further {
            None if self.is_best() => project_best(&self.project, points, pixels),
            None => project_baseline(&self.project, points, pixels),
            Some((project, _)) if self.is_best() => further_best(project, points, pixels),
            Some((project, _)) => further_baseline(project, points, pixels),
        }
        self.displace(pixels, first);
    }

    /// Projects points at finite distances (N × 3 in the camera frame, in millimetres) to N × 2 pixels, as
    /// [`KannalaBrandt::project_point`] does, to 9e-10 rad. Of a central lens it is [`Self::project`]. Rows are NaN where a lens does not see the
    /// point.
    #[must_use]
    pub fn project_points(&self, points: &[[f64; 3]]) -> Vec<[f64; 2]> {
        let mut pixels = Vec::new();
        self.project_points_into(points, &mut pixels);
        pixels
    }

    /// Like [`Self::project_points`], but appends the results to `pixels`.
    pub fn project_points_into(&self, points: &[[f64; 3]], pixels: &mut Vec<[f64; 2]>) {
        if self.lens.is_central() {
            return self.project_into(points, pixels);
        }
        let one = |lens: &KannalaBrandt, point: &[f64; 3]| {
            let pixel = lens.project_point(&Point::<Camera>::from_mm((*point).into()));
            pixel.map_or([f64::NAN; 2], |pixel| [pixel.u, pixel.v])
        };
        let is_own = self.lens.foreign_model().is_none();
        let prepared = self.by_pupil.get_or_init(|| is_own.then(|| ProjectByPupil::new(&self.lens)).flatten());
        let Some(pupil) = prepared else {
            return pixels.extend(points.iter().map(|point| one(&self.lens, point)));
        };
        let symmetric = self.lens.made_asymmetric(Asymmetry::default());
        let first = pixels.len();
        let all = |points: &[[f64; 3]], pixels: &mut Vec<[f64; 2]>| {
            project_by_pupil(pupil, self.is_best(), points, pixels);
        };
        by_chunks(points, pixels, |point| one(&symmetric, point), all);
        self.displace(pixels, first);
    }

    /// Moves the pixels of a symmetric lens from the `first` on to where this one has them.
    fn displace(&self, pixels: &mut [[f64; 2]], first: usize) {
        if let Some(displaced) = &self.displaced {
            displaced.displace(pixels.get_mut(first..).unwrap_or_default(), self.is_best());
        } else if !self.lens.is_symmetric() {
            for pixel in pixels.iter_mut().skip(first) {
                let Pixel { u, v } = self.lens.with_displacement(Pixel { u: pixel[0], v: pixel[1] });
                *pixel = [u, v];
            }
        }
    }

    /// Projects points as [`Self::project`] does, with the derivatives of the pixels by the points and by the lens.
    #[must_use]
    pub fn project_with_derivatives(&self, points: &[[f64; 3]]) -> ProjectedPoints {
        let mut out = ProjectedPoints::default();
        self.project_with_derivatives_into(points, &mut out);
        out
    }

    /// Like [`Self::project_with_derivatives`], but replaces what is in `out` and keeps its memory. In memory that was used before,
    /// a large array takes much less time than in new memory, whose pages the system must clear.
    pub fn project_with_derivatives_into(&self, points: &[[f64; 3]], out: &mut ProjectedPoints) {
        match &self.further {
            None => self.derivatives.of(points, self.is_best(), out),
            Some((_, derivatives)) => derivatives.of(points, self.is_best(), out),
        }
        if self.lens.foreign_model().is_some() {
            out.make_foreign(&self.lens, points);
        }
    }

    /// Unprojects pixels (N × 2) to rays (N × 3 in the camera frame), unit vectors to 1e-14. Rows are NaN beyond
    /// `theta_max`.
    #[must_use]
    pub fn unproject(&self, pixels: &[[f64; 2]]) -> Vec<[f64; 3]> {
        let mut rays = Vec::new();
        self.unproject_into(pixels, &mut rays);
        rays
    }

    /// Like [`Self::unproject`], but appends the results to `rays`.
    pub fn unproject_into(&self, pixels: &[[f64; 2]], rays: &mut Vec<[f64; 3]>) {
        // What the polynomial of a lens of another model has of asymmetry is none of that model.
        if self.lens.foreign_model().is_some() {
            return self.unproject_symmetric(pixels, rays);
        }
        self.unproject_symmetric(&self.symmetric(pixels), rays);
    }

    /// Unprojects pixels (N × 2) to rays with the places where they begin: N × 4, a unit vector and e of the place (0, 0, e) in millimetres, in the
    /// camera frame ([`KannalaBrandt::origin_of`]). Rows are NaN beyond `theta_max`.
    #[must_use]
    pub fn unproject_with_shifts(&self, pixels: &[[f64; 2]]) -> Vec<[f64; 4]> {
        let mut rays = Vec::new();
        self.unproject_with_shifts_into(pixels, &mut rays);
        rays
    }

    /// Like [`Self::unproject_with_shifts`], but appends the results to `rays`.
    pub fn unproject_with_shifts_into(&self, pixels: &[[f64; 2]], rays: &mut Vec<[f64; 4]>) {
        let central =
            self.unproject.as_ref().filter(|_| self.lens.foreign_model().is_none() && !self.lens.is_central());
        let prepared = self.back_by_pupil.get_or_init(|| UnprojectByPupil::new(&self.lens, central?));
        let Some(pupil) = prepared else {
            let is_central = self.lens.is_central();
            let shift = |&[x, y, z]: &[f64; 3]| {
                let ray = if is_central { None } else { UnitRay::<Camera>::new([x, y, z].into()) };
                // What is no ray has no place either.
                [x, y, z, ray.map_or(0.0 * z, |ray| self.lens.origin_of(&ray).mm().z)]
            };
            return rays.extend(self.unproject(pixels).iter().map(shift));
        };
        unproject_by_pupil(pupil, self.is_best(), &self.symmetric(pixels), rays);
    }

    /// The pixels of the symmetric lens.
    fn symmetric<'a>(&self, pixels: &'a [[f64; 2]]) -> Cow<'a, [[f64; 2]]> {
        let one = |&[u, v]: &[f64; 2]| {
            self.lens.without_displacement(Pixel { u, v }).map_or([f64::NAN; 2], |pixel| [pixel.u, pixel.v])
        };
        match &self.displaced {
            Some(displaced) => Cow::Owned(displaced.replace(pixels, self.is_best())),
            None if self.lens.is_symmetric() => Cow::Borrowed(pixels),
            None => pixels.iter().map(one).collect(),
        }
    }

    fn unproject_symmetric(&self, pixels: &[[f64; 2]], rays: &mut Vec<[f64; 3]>) {
        match (&self.unproject, &self.foreign) {
            (Some(fit), _) if self.is_best() => unproject_best(fit, pixels, rays),
            (Some(fit), _) => unproject_baseline(fit, pixels, rays),
            (None, Some(foreign)) => foreign.unproject(pixels, self.is_best(), rays),
            // A lens that nearly turns over inside its field has no polynomial: one pixel at a time.
            (None, None) => rays.extend(pixels.iter().map(|&[u, v]| self.unproject_one(Pixel { u, v }))),
        }
    }

    fn is_best(&self) -> bool {
        self.instructions == Instructions::Best
    }

    /// The ray of a pixel of the symmetric lens.
    fn unproject_one(&self, pixel: Pixel) -> [f64; 3] {
        let symmetric = self.lens.made_asymmetric(Asymmetry::default());
        symmetric.unproject::<Camera>(pixel).map_or([f64::NAN; 3], |ray| ray.vector().into())
    }

    /// Whether [`Self::unproject`] is in lanes, and not pixel by pixel: not where dr/dθ comes close to zero inside the field.
    #[must_use]
    pub fn is_fitted(&self) -> bool {
        self.unproject.is_some() || self.foreign.as_ref().is_some_and(|foreign| foreign.is_in_lanes()[1])
    }

    /// Whether [`Self::project`] is in lanes, and not point by point.
    #[must_use]
    pub fn projects_in_lanes(&self) -> bool {
        self.radial.is_some() || self.foreign.as_ref().is_none_or(|foreign| foreign.is_in_lanes()[0])
    }
}
