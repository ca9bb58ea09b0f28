//! Dense stereo: a range for every pixel of the left image.
//!
//! Both images are resampled in the shared axes, where a point at (a, b) of the left view lies at (a - d, b) of the
//! right one. [`DenseViews::sweep`] tries all disparities at the coarsest resolution and a few around the coarser
//! result at the finer ones, aggregates costs of the census transform along paths, and keeps the disparities on which
//! both views agree. [`DenseViews::register`] refines them to a fraction of a pixel and computes their uncertainty.
//! [`DenseViews::ranges`] converts them to ranges of the pixels of the left image.
//!
//! Terms: the *disparity* d is the parallax along a row; a *hypothesis* is a disparity that is tried; a *volume* has
//! one number for each pixel and hypothesis.

mod census;
mod depth;
mod fraction;
mod levels;
mod paths;
mod range;
mod register;
mod shared_spread;
mod surface;
mod volume;
mod window;
mod winner;

use rayon::prelude::*;
use vergence_vision::{Angle, BatchLens, Left, Length, Right, SharedCovariance, StereoPair};

pub use self::depth::{DenseCounts, DenseDepth, DenseRange, DenseSample, Gap};
pub use self::fraction::Disparities;
use self::range::RangeFinder;
use self::register::SampledView;
use self::surface::SAME_SURFACE;
use crate::epipolar_band::EpipolarBand;
use crate::matcher::{ImagePair, MatchError};
use crate::shared_field::near;
use crate::{Grid, SharedFrame, View, ViewPixel};

/// Smallest disparity in standard deviations that differs from zero.
const SIGNIFICANT: f32 = 3.0;
/// Largest standard deviation of a disparity that is used, in pixels.
const LARGEST_SIGMA: f32 = 2.0;
/// Smallest fraction of contrast that two windows of one surface have in common.
const LEAST_LIKENESS: f32 = 0.4;

/// A pair of images resampled so that epipolar curves are rows.
#[derive(Clone, Debug)]
pub struct DenseViews<'a> {
    pair: ImagePair<'a>,
    frame: SharedFrame,
    left: View<Left>,
    right: View<Right>,
}

/// Disparities of the left view in whole pixels, refined by a parabola through their costs.
#[derive(Clone, Debug, PartialEq)]
pub struct WholeDisparities(Vec<f32>);

/// Computes a range for every pixel of the left image of `pair`.
///
/// `shared` is the covariance of lenses and pose, which all pixels share.
///
/// # Errors
/// [`MatchError`] for a pair that cannot be matched, whatever its images show.
pub fn dense_depth(pair: &ImagePair<'_>, shared: &SharedCovariance) -> Result<DenseDepth, MatchError> {
    let views = DenseViews::new(pair)?;
    Ok(views.ranges(&views.register(&views.sweep()), shared))
}

impl<'a> DenseViews<'a> {
    /// Resamples both images in the shared axes.
    ///
    /// # Errors
    /// [`MatchError`] for a pair that cannot be matched, whatever its images show.
    pub fn new(pair: &ImagePair<'a>) -> Result<Self, MatchError> {
        pair.check()?;
        let frame = SharedFrame::new(&pair.left_from_right).ok_or(MatchError::NoBaseline)?;
        let grid = Grid::covering(&frame, pair.left_camera, pair.right_camera, 1.0).ok_or(MatchError::NoSharedField)?;
        let left = View::masked((pair.left, pair.masks[0]), pair.left_camera, frame.shared_from_left(), grid);
        let right = View::masked((pair.right, pair.masks[1]), pair.right_camera, frame.shared_from_right(), grid);
        Ok(Self { pair: *pair, frame, left, right })
    }

    /// Finds the disparities of the left view on which both views agree.
    #[must_use]
    pub fn sweep(&self) -> WholeDisparities {
        WholeDisparities(levels::swept(&self.left, &self.right, &self.band(self.pair.nearest)))
    }

    /// Refines disparities to a fraction of a pixel, with their standard deviations.
    #[must_use]
    pub fn register(&self, swept: &WholeDisparities) -> Disparities {
        let left = SampledView { plane: self.left.plane(), seen: self.left.seen() };
        let right = SampledView { plane: self.right.plane(), seen: self.right.seen() };
        fraction::registered([left, right], &swept.0)
    }

    /// Converts disparities to ranges of the left image's pixels. The covariance is that of [`dense_depth`].
    #[must_use]
    pub fn ranges(&self, disparities: &Disparities, shared: &SharedCovariance) -> DenseDepth {
        let size = self.pair.left_camera.size();
        let lens = BatchLens::new(self.pair.left_camera);
        let turn = self.frame.shared_from_left().rotation().to_rotation_matrix().into_inner();
        let (left, right) = (self.pair.left_camera, self.pair.right_camera);
        let pair = StereoPair { left, right, left_from_right: self.pair.left_from_right };
        let finder = RangeFinder::new(&self.frame, &pair, shared);
        let near = self.band(near(self.frame.baseline()));
        let mut samples = vec![DenseSample::Gap(Gap::OutsideField); size.width as usize * size.height as usize];
        samples.par_chunks_mut((size.width as usize).max(1)).enumerate().for_each(|(v, samples)| {
            let pixels: Vec<[f64; 2]> = (0..size.width).map(|u| [f64::from(u), v as f64]).collect();
            for (sample, ray) in samples.iter_mut().zip(lens.unproject(&pixels)) {
                let [x, y, z]: [f64; 3] = (turn * nalgebra::Vector3::from(ray)).into();
                let direction = [x.atan2(y.hypot(z)), y.atan2(z)];
                if direction[0].is_finite() {
                    *sample = self.sample(direction, disparities, &finder, &near);
                }
            }
        });
        DenseDepth::new(size, samples)
    }

    /// The result in the direction (a, b) from the left camera.
    fn sample(
        &self,
        [a, b]: [f64; 2],
        disparities: &Disparities,
        finder: &RangeFinder,
        near: &EpipolarBand,
    ) -> DenseSample {
        let grid = self.left.grid();
        let at = grid.position_of(a, b);
        let Some(index) = grid.index_nearest(at) else { return DenseSample::Gap(Gap::NotShared) };
        let disparity = between(&disparities.disparity, grid, at, index);
        let own = disparities.sigma[index];
        if disparity.is_nan() {
            return DenseSample::Gap(self.why_none(at, near));
        }
        if own.is_nan() || own > LARGEST_SIGMA {
            return DenseSample::Gap(Gap::Untextured);
        }
        if disparities.likeness[index] < LEAST_LIKENESS {
            return DenseSample::Gap(Gap::Inconsistent);
        }
        if disparity <= SIGNIFICANT * own {
            return DenseSample::Far;
        }
        let radians = |pixels: f32| f64::from(pixels) / grid.pixels_per_radian();
        let range = finder.at([a, b], radians(disparity), radians(own.hypot(disparities.edge[index])));
        DenseSample::Measured(DenseRange {
            range_mm: range.mm as f32,
            sigma_mm: range.sigma_mm as f32,
            own_sigma_mm: range.own_sigma_mm as f32,
            confidence: disparities.likeness[index],
        })
    }

    /// The reason why there is no disparity at a position of the left view.
    fn why_none(&self, at: ViewPixel, near: &EpipolarBand) -> Gap {
        let partner = |disparity: f64| ViewPixel { x: at.x - disparity, y: at.y };
        if !self.left.sees(at) {
            Gap::OutsideField
        } else if self.right.sees(at) || self.right.sees(partner(near.largest_disparity(at.x))) {
            Gap::Inconsistent
        } else {
            Gap::NotShared
        }
    }

    /// The epipolar band of disparities up to that of the range `nearest`, for a pose known exactly.
    fn band(&self, nearest: Length) -> EpipolarBand {
        EpipolarBand::new(*self.left.grid(), self.frame.baseline(), nearest, Angle::from_rad(0.0))
    }
}

/// Interpolates the disparity between the four pixels around a position, or takes the nearest one where they are not of
/// one surface.
fn between(disparities: &[f32], grid: &Grid, at: ViewPixel, nearest: usize) -> f32 {
    let (width, height) = grid.size();
    let (x, y) = (at.x.max(0.0) as usize, at.y.max(0.0) as usize);
    let own = disparities[nearest];
    if x + 1 >= width || y + 1 >= height {
        return own;
    }
    let corner = y * width + x;
    let around = [corner, corner + 1, corner + width, corner + width + 1].map(|index| disparities[index]);
    if around.iter().any(|other| other.is_nan() || (other - own).abs() > SAME_SURFACE) {
        return own;
    }
    let (s, t) = ((at.x - x as f64) as f32, (at.y - y as f64) as f32);
    let along = |from: f32, to: f32| from + s * (to - from);
    let (above, below) = (along(around[0], around[1]), along(around[2], around[3]));
    above + t * (below - above)
}
