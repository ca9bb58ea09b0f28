//! Result of a calibration from the optimum: covariance, residuals, and checks that the views determine the lens.

use nalgebra::{DMatrix, SMatrix, Vector3};
use vergence_targets::TargetView;
use vergence_vision::{Angle, Camera, ImageSize, Point, Transform};

use super::adjust::Adjusted;
use super::ladder::Evidence;
use super::lens::{LENS, with_valid_cone};
use super::observations::{Observation, ObservedView};
use super::{IntrinsicsCalibration, IntrinsicsError, Outlier, OutlierReason, Parameter, ViewFigures, ViewPose};
use crate::schur_lm::Clustered;
use crate::{TargetShape, TargetWarp};

/// Assembles the result; `left_out` are the corners of views that were too poor to use.
pub(super) fn report(
    given: &[TargetView],
    size: ImageSize,
    adjusted: &Adjusted,
    evidence: Evidence,
    mut outliers: Vec<Outlier>,
) -> Result<IntrinsicsCalibration, IntrinsicsError> {
    let tilt_spread = check_tilts(adjusted)?;
    let covariances = Covariances::of(adjusted)?;
    covariances.check(adjusted, size)?;
    let outermost = outermost(adjusted);
    let lens = adjusted.shared.lens;
    let camera = with_valid_cone(lens, outermost, size).map_err(IntrinsicsError::NotALens)?;

    outliers.extend(&adjusted.outliers);
    outliers.extend(adjusted.views.iter().zip(&adjusted.poses).flat_map(|(view, pose)| {
        let too_far = |observation: &Observation| Outlier {
            view: view.index,
            corner: observation.index,
            residual_px: Some(adjusted.shared.residual_px(pose, observation)).filter(|r| r.is_finite()),
            reason: OutlierReason::TooFar,
        };
        view.observations.iter().filter(|observation| !observation.used).map(too_far)
    }));
    outliers.sort_by_key(|outlier| (outlier.view, outlier.corner));

    let squares: Vec<_> =
        adjusted.views.iter().zip(&adjusted.poses).map(|(v, p)| view_squares(adjusted, v, p)).collect();
    let [all, inlier]: [Squares; 2] = [0, 1].map(|which| squares.iter().map(|of_view| of_view[which]).sum());
    let sigmas =
        adjusted.views.iter().flat_map(ObservedView::used).map(|observation| Squares::of(observation.relative_sigma));
    Ok(IntrinsicsCalibration {
        camera,
        opencv: lens.central,
        pupil: evidence.pupil,
        steps: evidence.steps,
        covariance: lens_part(adjusted, &covariances.shared.covariance),
        noise_covariance: lens_part(adjusted, &covariances.noise),
        view_scatter: covariances.shared.scatter,
        warp: covariances.warp(adjusted, given),
        rms_px: all.rms(),
        rms_inlier_px: inlier.rms(),
        sigma0_px: covariances.variance.sqrt() * sigmas.sum::<Squares>().rms(),
        corners_total: given.iter().map(|view| view.corners.len()).sum(),
        corners_inlier: inlier.count,
        views_used: adjusted.views.len(),
        tilt_spread,
        outermost,
        views: view_figures(given, adjusted, &covariances, &squares),
        outliers,
    })
}

/// Least spread of the targets' tilts: focal length and distance are not separable if all targets are parallel.
fn check_tilts(adjusted: &Adjusted) -> Result<Angle, IntrinsicsError> {
    const LEAST_SPREAD: Angle = Angle::from_deg(3.0);
    let normals: Vec<Vector3<f64>> = adjusted.poses.iter().map(|pose| pose.rotation * Vector3::z()).collect();
    let angles = normals.iter().enumerate().flat_map(|(i, a)| normals.iter().skip(i + 1).map(move |b| between(a, b)));
    let spread = Angle::from_rad(angles.fold(0.0, f64::max));
    if spread < LEAST_SPREAD { Err(IntrinsicsError::ParallelViews { spread }) } else { Ok(spread) }
}

/// The angle between two planes' normals, whichever side they point to.
fn between(a: &Vector3<f64>, b: &Vector3<f64>) -> f64 {
    a.cross(b).norm().atan2(a.dot(b).abs())
}

/// The angle to the axis of the outermost corner used.
pub(super) fn outermost(adjusted: &Adjusted) -> Angle {
    let angle = |pose: &nalgebra::Isometry3<f64>, observation: &Observation| {
        let point: Point<Camera> = Point::from_mm((pose * adjusted.shared.on_target(observation)).coords);
        point.direction().map_or(0.0, |ray| ray.angle_to_axis().rad())
    };
    let angles =
        adjusted.views.iter().zip(&adjusted.poses).flat_map(|(view, pose)| view.used().map(move |s| angle(pose, s)));
    Angle::from_rad(angles.fold(0.0, f64::max))
}

/// Covariances in pixels, radians and millimetres.
struct Covariances {
    /// Variance of one component of a residual.
    variance: f64,
    /// Of lens and bow.
    shared: Clustered,
    /// Of lens and bow, by independent noise alone.
    noise: DMatrix<f64>,
}

/// The part of the lens; zero for parameters that were not adjusted.
fn lens_part(adjusted: &Adjusted, covariance: &DMatrix<f64>) -> SMatrix<f64, LENS, LENS> {
    let mut part = SMatrix::zeros();
    let of_lens = || adjusted.free.iter().copied().enumerate().filter(|&(_, parameter)| parameter < LENS);
    for (row, of_row) in of_lens() {
        for (column, of_column) in of_lens() {
            part[(of_row, of_column)] = covariance[(row, column)];
        }
    }
    part
}

impl Covariances {
    fn of(adjusted: &Adjusted) -> Result<Self, IntrinsicsError> {
        let variance = adjusted.normal.variance().ok_or(IntrinsicsError::Singular)?;
        let shared = adjusted
            .normal
            .clustered_with_priors(variance, variance * adjusted.prior_factor)
            .ok_or(IntrinsicsError::Singular)?;
        let noise = adjusted.normal.shared_covariance().ok_or(IntrinsicsError::Singular)? * variance;
        Ok(Self { variance, shared, noise })
    }

    /// Refuses a calibration that is too uncertain to use.
    fn check(&self, adjusted: &Adjusted, size: ImageSize) -> Result<(), IntrinsicsError> {
        /// Largest standard deviation of the focal length, as a share of it.
        const FOCAL_SHARE: f64 = 0.1;
        /// Largest standard deviation of the principal point, as a share of the image's longer side.
        const CENTRE_SHARE: f64 = 0.1;
        // By noise alone: whether the views determine the lens is a matter of where they are, not of how they scatter.
        let sigma = |i: usize| self.noise[(i, i)].sqrt();
        let lens = &adjusted.shared.lens.central;
        let longer = f64::from(size.width.max(size.height));
        let limits = [
            (Parameter::FocalLength, sigma(0), FOCAL_SHARE * lens.fx.abs()),
            (Parameter::FocalLength, sigma(1), FOCAL_SHARE * lens.fy.abs()),
            (Parameter::PrincipalPoint, sigma(2), CENTRE_SHARE * longer),
            (Parameter::PrincipalPoint, sigma(3), CENTRE_SHARE * longer),
        ];
        match limits.into_iter().find(|(_, sigma, limit)| sigma > limit) {
            Some((parameter, sigma_px, _)) => Err(IntrinsicsError::Undetermined { parameter, sigma_px }),
            None => Ok(()),
        }
    }

    fn warp(&self, adjusted: &Adjusted, given: &[TargetView]) -> Option<TargetWarp> {
        let sigma = |i: usize| self.shared.covariance[(i, i)].sqrt();
        let shape = TargetShape::over(given.iter().flat_map(|view| &view.corners)).bent(adjusted.shared.warp_mm);
        let first = adjusted.free.iter().position(|&parameter| parameter >= LENS)?;
        Some(TargetWarp { shape, sigma_mm: [sigma(first), sigma(first + 1)] })
    }
}

fn view_figures(
    given: &[TargetView],
    adjusted: &Adjusted,
    covariances: &Covariances,
    squares: &[[Squares; 2]],
) -> Vec<ViewFigures> {
    let mut figures: Vec<_> = given
        .iter()
        .map(|view| ViewFigures {
            name: view.name.clone(),
            corners: view.corners.len(),
            corners_inlier: 0,
            rms_px: None,
            rms_inlier_px: None,
            pose: None,
        })
        .collect();
    let unit = &covariances.shared.covariance / covariances.variance;
    for (block, ((view, pose), [all, inlier])) in adjusted.views.iter().zip(&adjusted.poses).zip(squares).enumerate() {
        let Some(entry) = figures.get_mut(view.index) else { continue };
        entry.corners_inlier = inlier.count;
        entry.rms_inlier_px = Some(inlier.rms());
        entry.rms_px = Some(all.rms());
        entry.pose = adjusted.normal.block_covariance(block, &unit).map(|covariance| ViewPose {
            camera_from_target: Transform::from_isometry(*pose),
            covariance: covariance * covariances.variance,
        });
    }
    figures
}

/// A sum of squares.
#[derive(Clone, Copy, Default)]
struct Squares {
    sum: f64,
    count: usize,
}

impl Squares {
    fn of(value: f64) -> Self {
        Self { sum: value * value, count: 1 }
    }

    fn rms(self) -> f64 {
        (self.sum / self.count as f64).sqrt()
    }
}

impl std::iter::Sum for Squares {
    fn sum<I: Iterator<Item = Self>>(parts: I) -> Self {
        parts.fold(Self::default(), |a, b| Self { sum: a.sum + b.sum, count: a.count + b.count })
    }
}

/// Of all corners of a view, and of those used.
fn view_squares(adjusted: &Adjusted, view: &ObservedView, pose: &nalgebra::Isometry3<f64>) -> [Squares; 2] {
    let of = |s: &Observation| (Squares::of(adjusted.shared.residual_px(pose, s)), s.used);
    let corners: Vec<_> = view.observations.iter().map(of).collect();
    [false, true].map(|used_only| corners.iter().filter(|(_, used)| *used || !used_only).map(|(s, _)| *s).sum())
}
