//! Lenses of other programs' models that are not symmetric, in whole arrays.

use std::sync::OnceLock;

use super::splined::{Splined, splined_baseline, splined_best};
use super::splined_back::{SplinedBack, splined_back_baseline, splined_back_best};
use super::stepwise::{ASK, Stepwise, stepwise_baseline, stepwise_best};
use super::stepwise_back::{StepwiseBack, stepwise_back_baseline, stepwise_back_best};
use crate::foreign::OntoPlane;
use crate::{Camera, KannalaBrandt, Pixel, UnitRay};

/// A lens of another model.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Foreign {
    lens: KannalaBrandt,
    project: Option<Out>,
    /// Made where it is asked for.
    unproject: OnceLock<Option<Back>>,
}

#[derive(Clone, Debug, PartialEq)]
enum Out {
    Stepwise(Box<Stepwise>),
    Splined(Splined),
}

#[derive(Clone, Debug, PartialEq)]
enum Back {
    Stepwise(StepwiseBack),
    Splined(SplinedBack),
}

impl Foreign {
    /// `None` for a lens of this program's own model.
    pub(super) fn new(lens: &KannalaBrandt) -> Option<Self> {
        let model = lens.foreign_model()?;
        let field = lens.foreign_field();
        let project = model.steps().and_then(|steps| match &steps.onto_plane {
            OntoPlane::Stereographic(spline) => Some(Out::Splined(Splined::new(spline, steps.affine, field))),
            _ => Stepwise::new(lens, &steps, field).map(|steps| Out::Stepwise(Box::new(steps))),
        });
        Some(Self { lens: *lens, project, unproject: OnceLock::new() })
    }

    fn back(&self) -> Option<&Back> {
        let new = || {
            let (field, steps) = (self.lens.foreign_field(), self.lens.foreign_model()?.steps()?);
            match &self.project {
                Some(Out::Splined(out)) => SplinedBack::new(&self.lens, out).map(Back::Splined),
                _ => StepwiseBack::new(&self.lens, &steps, field).map(Back::Stepwise),
            }
        };
        self.unproject.get_or_init(new).as_ref()
    }

    /// Whether arrays are computed in lanes, and not point by point: out, and back.
    pub(super) fn is_in_lanes(&self) -> [bool; 2] {
        [self.project.is_some(), self.back().is_some()]
    }

    /// Appends the pixels of points.
    pub(super) fn project(&self, points: &[[f64; 3]], best: bool, pixels: &mut Vec<[f64; 2]>) {
        let one = |point: &[f64; 3]| {
            let ray = UnitRay::<Camera>::new((*point).into());
            ray.and_then(|ray| self.lens.project(&ray).ok()).map_or([f64::NAN; 2], |pixel| [pixel.u, pixel.v])
        };
        by_chunks(points, pixels, one, |chunk, pixels| match (&self.project, best) {
            (Some(Out::Stepwise(steps)), true) => stepwise_best(steps, chunk, pixels),
            (Some(Out::Stepwise(steps)), false) => stepwise_baseline(steps, chunk, pixels),
            (Some(Out::Splined(spline)), true) => splined_best(spline, chunk, pixels),
            (Some(Out::Splined(spline)), false) => splined_baseline(spline, chunk, pixels),
            (None, _) => pixels.extend(chunk.iter().map(one)),
        });
    }

    /// Appends the rays of pixels.
    pub(super) fn unproject(&self, pixels: &[[f64; 2]], best: bool, rays: &mut Vec<[f64; 3]>) {
        let one = |&[u, v]: &[f64; 2]| {
            self.lens.unproject::<Camera>(Pixel { u, v }).map_or([f64::NAN; 3], |ray| ray.vector().into())
        };
        by_chunks(pixels, rays, one, |chunk, rays| match (self.back(), best) {
            (Some(Back::Stepwise(steps)), true) => stepwise_back_best(steps, chunk, rays),
            (Some(Back::Stepwise(steps)), false) => stepwise_back_baseline(steps, chunk, rays),
            (Some(Back::Splined(spline)), true) => splined_back_best(spline, chunk, rays),
            (Some(Back::Splined(spline)), false) => splined_back_baseline(spline, chunk, rays),
            (None, _) => rays.extend(chunk.iter().map(one)),
        });
    }
}

/// Appends what `all` appends for some rows at a time, so that they stay in the cache, with what `one` says of those where that asks.
pub(super) fn by_chunks<const IN: usize, const OUT: usize>(
    rows: &[[f64; IN]],
    found: &mut Vec<[f64; OUT]>,
    one: impl Fn(&[f64; IN]) -> [f64; OUT],
    all: impl Fn(&[[f64; IN]], &mut Vec<[f64; OUT]>),
) {
    const CHUNK: usize = 1024;
    found.reserve(rows.len());
    for chunk in rows.chunks(CHUNK) {
        let first = found.len();
        all(chunk, found);
        for (found, row) in found.iter_mut().skip(first).zip(chunk) {
            if found[0] == ASK {
                *found = one(row);
            }
        }
    }
}
