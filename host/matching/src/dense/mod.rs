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

mod blocks;
mod census;
mod depth;
mod directions;
mod edges;
mod fraction;
mod levels;
mod paths;
mod range;
mod register;
mod rows;
mod shared_spread;
mod support;
mod surface;
mod volume;
mod window;
mod winner;

use nalgebra::Matrix3;
use rayon::prelude::*;
use vergence_vision::{
    Angle, BatchLens, Frame, Left, Length, PixelPair, Right, SharedCovariance, StereoPair, Transform,
};

pub use self::depth::{DenseCounts, DenseDepth, DenseRange, DenseSample, Gap};
use self::directions::{Direction, RowOfDirections};
use self::fraction::BETWEEN_SURFACES;
pub use self::fraction::Disparities;
use self::levels::Levels;
use self::range::RangeFinder;
use self::register::SampledView;
use self::rows::{Sighting, pose_of_rows, sightings};
use self::surface::SAME_SURFACE;
use crate::epipolar_band::EpipolarBand;
use crate::grid::direction;
use crate::matcher::{ImagePair, MatchError};
use crate::pool::{give_back, in_pool, memory};
use crate::shared_field::near;
use crate::view::Buffers;
use crate::{Grid, SharedFrame, View, ViewPixel};

/// Smallest disparity in standard deviations, lenses and pose included, that differs from zero.
const SIGNIFICANT: f64 = 3.0;

/// Largest number of times that the rows are moved.
const ROUNDS: usize = 3;

/// A pair of images resampled so that epipolar curves are rows.
#[derive(Clone, Debug)]
pub struct DenseViews<'a> {
    pair: ImagePair<'a>,
    /// The shared axes of the pair's pose.
    frame: SharedFrame,
    /// The pose whose epipolar curves are the rows.
    rows: Transform<Left, Right>,
    /// The shared axes of that pose.
    rows_frame: SharedFrame,
    left: View<Left>,
    right: View<Right>,
    /// `None` once they are searched: registration needs the memory.
    levels: Option<Levels>,
    /// The matches that show where the rows lie.
    row_matches: Vec<(PixelPair, f64)>,
}

/// Disparities of the left view in whole pixels, refined by a parabola through their costs.
#[derive(Clone, Debug, PartialEq)]
pub struct WholeDisparities {
    disparity: Vec<f32>,
    /// The number of pixels in one of the coarsest level of the search.
    coarsest_area: usize,
}

/// Computes a range for every pixel of the left image of `pair`.
///
/// `shared` is the covariance of lenses and pose, which all pixels share.
///
/// # Errors
/// [`MatchError`] for a pair that cannot be matched, whatever its images show.
pub fn dense_depth(pair: &ImagePair<'_>, shared: &SharedCovariance) -> Result<DenseDepth, MatchError> {
    let mut views = DenseViews::new(pair)?.aligned();
    let swept = views.sweep();
    Ok(views.ranges(&views.register(swept), shared))
}

impl<'a> DenseViews<'a> {
    /// Resamples both images in the shared axes.
    ///
    /// # Errors
    /// [`MatchError`] for a pair that cannot be matched, whatever its images show.
    pub fn new(pair: &ImagePair<'a>) -> Result<Self, MatchError> {
        pair.check()?;
        let frame = SharedFrame::new(&pair.left_from_right).ok_or(MatchError::NoBaseline)?;
        in_pool(|| Self::turned(pair, frame, pair.left_from_right))
    }

    /// Resamples both images so that the epipolar curves of the pose `rows` are rows.
    fn turned(pair: &ImagePair<'a>, frame: SharedFrame, rows: Transform<Left, Right>) -> Result<Self, MatchError> {
        let axes = SharedFrame::new(&rows).ok_or(MatchError::NoBaseline)?;
        let grid = Grid::covering(&axes, pair.left_camera, pair.right_camera, 1.0).ok_or(MatchError::NoSharedField)?;
        let (width, height) = grid.size();
        let mut buffers = [Buffers::default(), Buffers::default()];
        buffers.iter_mut().for_each(|buffers| buffers.values.push(memory(width * height)));
        let [of_left, of_right] = &mut buffers;
        let (left, right) = ((pair.left, pair.masks[0]), (pair.right, pair.masks[1]));
        let left = View::in_buffers(left, pair.left_camera, axes.shared_from_left(), grid, of_left);
        let right = View::in_buffers(right, pair.right_camera, axes.shared_from_right(), grid, of_right);
        let levels = Some(Levels::new(&left, &right, &band(&grid, &axes, pair.nearest)));
        Ok(Self { pair: *pair, frame, rows, rows_frame: axes, left, right, levels, row_matches: Vec::new() })
    }

    /// The same with the rows where the images show them, if the pose is so wrong that partners lie off their rows.
    ///
    /// That mends the search. Ranges remain those of the stated pose: how far it is off *along* the rows is part of
    /// their error, and the images alone tell it badly.
    #[must_use]
    pub fn aligned(self) -> Self {
        in_pool(|| self.on_rows())
    }

    fn on_rows(self) -> Self {
        let mut views = self;
        for _ in 0..ROUNDS {
            let Some(levels) = &views.levels else { break };
            let sightings = sightings(levels);
            views.row_matches = sightings.iter().filter_map(|it| views.in_originals(it)).collect();
            let pose = pose_of_rows(&sightings, views.left.grid(), &views.rows_frame, &views.rows);
            let moved = pose.and_then(|pose| Self::turned(&views.pair, views.frame, pose).ok());
            let Some(mut moved) = moved else { break };
            moved.row_matches = std::mem::take(&mut views.row_matches);
            views = moved;
        }
        views
    }

    /// The matches by which [`Self::aligned`] found the rows, each with its standard deviation in pixels. They do not
    /// depend on the stated pose, and tell how far it is off (`vergence_alignment::pose_drift`).
    #[must_use]
    pub fn row_matches(&self) -> &[(PixelPair, f64)] {
        &self.row_matches
    }

    fn in_originals(&self, it: &Sighting) -> Option<(PixelPair, f64)> {
        let (left, right) = (self.left.original(it.left).ok()?, self.right.original(it.right).ok()?);
        // The error of the right position, shared equally by both, is smaller by √2.
        let sigma = it.sigma * self.right.shrinking(right) * std::f64::consts::FRAC_1_SQRT_2;
        Some((PixelPair { left, right }, sigma))
    }

    /// Finds the disparities of the left view on which both views agree. What only the search needs is given up.
    #[must_use]
    pub fn sweep(&mut self) -> WholeDisparities {
        let (left, right) = (&self.left, &self.right);
        let made = || Levels::new(left, right, &band(left.grid(), &self.rows_frame, self.pair.nearest));
        let levels = self.levels.take();
        in_pool(|| {
            let levels = levels.unwrap_or_else(made);
            WholeDisparities { disparity: levels.swept(), coarsest_area: levels.coarsest_area() }
        })
    }

    /// Refines disparities to a fraction of a pixel, with their standard deviations.
    #[must_use]
    pub fn register(&self, swept: WholeDisparities) -> Disparities {
        let left = SampledView { plane: self.left.plane(), seen: self.left.seen() };
        let right = SampledView { plane: self.right.plane(), seen: self.right.seen() };
        in_pool(|| fraction::registered([left, right], swept.disparity, swept.coarsest_area))
    }

    /// Converts disparities to ranges of the left image's pixels. The covariance is that of [`dense_depth`].
    #[must_use]
    pub fn ranges(&self, disparities: &Disparities, shared: &SharedCovariance) -> DenseDepth {
        in_pool(|| self.converted(disparities, shared))
    }

    fn converted(&self, disparities: &Disparities, shared: &SharedCovariance) -> DenseDepth {
        let size = self.pair.left_camera.size();
        let lens = BatchLens::new(self.pair.left_camera);
        let turn = rotation(&self.rows_frame.shared_from_left());
        let restated = self.restated();
        let (left, right) = (self.pair.left_camera, self.pair.right_camera);
        let pair = StereoPair { left, right, left_from_right: self.pair.left_from_right };
        let finder = RangeFinder::new(&self.frame, &pair, shared);
        let near = band(self.left.grid(), &self.rows_frame, near(self.rows_frame.baseline()));
        let mut samples = vec![DenseSample::Gap(Gap::OutsideField); size.width as usize * size.height as usize];
        let rows = samples.par_chunks_mut((size.width as usize).max(1)).enumerate();
        rows.for_each_init(RowOfDirections::default, |row, (v, samples)| {
            let width = samples.len();
            for (sample, direction) in samples.iter_mut().zip(row.of((&lens, &turn), width, v)) {
                if direction.a.is_finite() {
                    *sample = self.sample(&direction, disparities, (&finder, restated.as_ref()), &near);
                }
            }
        });
        DenseDepth::new(size, samples)
    }

    /// The result in a direction from the left camera.
    fn sample(
        &self,
        seen_at: &Direction,
        disparities: &Disparities,
        (finder, restated): (&RangeFinder<'_>, Option<&Restated>),
        near: &EpipolarBand,
    ) -> DenseSample {
        let grid = self.left.grid();
        let at = grid.position_of(seen_at.a, seen_at.b);
        let Some(index) = grid.index_nearest(at) else { return DenseSample::Gap(Gap::NotShared) };
        let disparity = between(&disparities.disparity, grid, at, index);
        let own = disparities.sigma[index];
        if disparity.is_nan() {
            return DenseSample::Gap(self.why_none(at, near));
        }
        if let Some(gap) = disparities.doubt[index] {
            return DenseSample::Gap(gap);
        }
        let radians = |pixels: f32| f64::from(pixels) / grid.pixels_per_radian();
        let at = |disparity: f32| {
            let (direction, parallax) = match restated {
                None => (*seen_at, radians(disparity)),
                Some(restated) => restated.of([seen_at.a, seen_at.b], radians(disparity)),
            };
            let range = finder.at(&direction, parallax, radians(own));
            (range, parallax > SIGNIFICANT * range.disparity_sigma)
        };
        let (range, is_significant) = at(disparity);
        if !is_significant {
            return DenseSample::Far;
        }
        let other = disparities.other[index];
        let mut sigmas = [range.sigma_mm, range.own_sigma_mm];
        if !other.is_nan() {
            // The other surface may be anywhere far away.
            let (other, true) = at(other) else { return DenseSample::Gap(Gap::Edge) };
            let between_surfaces = f64::from(BETWEEN_SURFACES) * (other.mm - range.mm);
            sigmas = sigmas.map(|sigma| sigma.hypot(between_surfaces));
        }
        let [sigma_mm, own_sigma_mm] = sigmas.map(|sigma| sigma as f32);
        let confidence = disparities.likeness[index];
        DenseSample::Measured(DenseRange { range_mm: range.mm as f32, sigma_mm, own_sigma_mm, confidence })
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

    /// What converts positions in the views to the axes of the stated pose; `None` where the rows are that pose's.
    fn restated(&self) -> Option<Restated> {
        (self.rows != self.pair.left_from_right).then(|| Restated {
            left: rotation(&(self.frame.shared_from_left() * self.rows_frame.shared_from_left().inverse())),
            right: rotation(&(self.frame.shared_from_right() * self.rows_frame.shared_from_right().inverse())),
        })
    }
}

impl Drop for DenseViews<'_> {
    fn drop(&mut self) {
        give_back(self.left.take_values());
        give_back(self.right.take_values());
    }
}

/// Rotations of both cameras' rays from the axes of the views to those of the stated pose.
struct Restated {
    left: Matrix3<f64>,
    right: Matrix3<f64>,
}

impl Restated {
    /// The left direction and the parallax in radians that the stated pose gives to those of the views.
    fn of(&self, [a, b]: [f64; 2], parallax: f64) -> (Direction, f64) {
        let [left, right] =
            [(self.left, a), (self.right, a - parallax)].map(|(turn, a)| Direction::of(turn * direction(a, b)));
        (left, left.a - right.a)
    }
}

fn rotation<T: Frame, F: Frame>(transform: &Transform<T, F>) -> Matrix3<f64> {
    transform.rotation().to_rotation_matrix().into_inner()
}

/// The epipolar band of disparities up to that of the range `nearest`, for a pose known exactly.
fn band(grid: &Grid, frame: &SharedFrame, nearest: Length) -> EpipolarBand {
    EpipolarBand::new(*grid, frame.baseline(), nearest, Angle::from_rad(0.0))
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
