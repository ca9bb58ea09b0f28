//! Conversion of a disparity to a range with its standard deviation.
//!
//! With u, v the rays of both cameras in one epipolar plane of normal n, at angles a and a - d across the baseline B,
//! the ranges from the left and the right camera are
//!
//! ```text
//! r = B cos(a - d) / sin d        μ = B cos a / sin d        ∂r/∂d = -μ / sin d
//! ```
//!
//! A turn ω of the right camera acts as a disparity n·ω, its shift δ as (n × v)·δ / μ.

use nalgebra::{Matrix6, Rotation3, Vector3, Vector6};
use vergence_vision::{
    KannalaBrandt, LENS_PARAMETERS, Left, Right, SharedCovariance, StereoPair, Transform, UnitRay, pseudo_intersection,
};

use super::directions::Direction;
use super::shared_spread::SharedSpread;
use crate::SharedFrame;
use crate::grid::direction;

/// Converts disparities to ranges, for one pair and one covariance of its lenses and pose.
pub(super) struct RangeFinder<'a> {
    baseline_mm: f64,
    /// Covariance of turn and shift of the right camera, in the shared axes.
    pose: Matrix6<f64>,
    /// With the lenses, where these are uncertain.
    with_lenses: Option<SharedSpread<'a>>,
    /// Where the lenses are not central.
    origins: Option<Origins>,
}

/// Two lenses whose rays do not all start at one point.
struct Origins {
    lenses: [KannalaBrandt; 2],
    left_from_right: Transform<Left, Right>,
    left_from_shared: Rotation3<f64>,
}

/// A range and its standard deviations, with and without lenses and pose, in millimetres, and that of its disparity.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct RangeAt {
    pub mm: f64,
    pub sigma_mm: f64,
    pub own_sigma_mm: f64,
    /// With lenses and pose, in radians.
    pub disparity_sigma: f64,
}

impl<'a> RangeFinder<'a> {
    /// `frame` is that of `pair`.
    pub(super) fn new(frame: &SharedFrame, pair: &StereoPair<'a>, shared: &'a SharedCovariance) -> Self {
        let lenses = 2 * LENS_PARAMETERS;
        let has_lenses = shared.matrix().view((0, 0), (lenses, lenses)).amax() > 0.0;
        let turn = frame.shared_from_left().rotation().to_rotation_matrix();
        let mut both = Matrix6::zeros();
        both.fixed_view_mut::<3, 3>(0, 0).copy_from(turn.matrix());
        both.fixed_view_mut::<3, 3>(3, 3).copy_from(turn.matrix());
        Self {
            baseline_mm: frame.baseline().mm(),
            pose: both * shared.pose() * both.transpose(),
            with_lenses: has_lenses.then(|| SharedSpread::new(frame, pair, shared)),
            origins: Origins::of(frame, pair),
        }
    }

    /// Converts the disparity `d` with standard deviation `sigma` in a direction of the left view, all in radians. The
    /// range is meaningless or NaN where d is not positive.
    pub(super) fn at(&self, direction: &Direction, d: f64, sigma: f64) -> RangeAt {
        let ([sin_a, cos_a], (sine, cosine)) = (direction.of_a, d.sin_cos());
        // Of the angle from the right camera, a - d.
        let right = [sin_a * cosine - cos_a * sine, cos_a * cosine + sin_a * sine];
        let from_right = self.baseline_mm * cos_a / sine;
        let angles = [direction.a, direction.b];
        let of_lenses =
            self.with_lenses.as_ref().map_or(f64::NAN, |spread| spread.at(angles, self.baseline_mm / from_right));
        let of_shared =
            if of_lenses.is_nan() { self.disparity_variance(direction.of_b, right, from_right) } else { of_lenses };
        let variance = sigma * sigma + of_shared;
        let per_radian = from_right / sine;
        let mm = match &self.origins {
            None => self.baseline_mm * right[1] / sine,
            Some(origins) => origins.range_mm(angles, d).unwrap_or(f64::NAN),
        };
        RangeAt {
            mm,
            sigma_mm: per_radian * variance.sqrt(),
            disparity_sigma: variance.sqrt(),
            own_sigma_mm: per_radian * sigma,
        }
    }

    /// The variance in rad² that the pose adds to a disparity, for a point `from_right` millimetres from the right
    /// camera. Angles are given by their sines and cosines.
    fn disparity_variance(&self, [sin_b, cos_b]: [f64; 2], [sin_right, cos_right]: [f64; 2], from_right: f64) -> f64 {
        let normal = Vector3::new(0.0, -cos_b, sin_b);
        let across = Vector3::new(-cos_right, sin_right * sin_b, sin_right * cos_b) / from_right;
        let by_pose = Vector6::new(normal.x, normal.y, normal.z, across.x, across.y, across.z);
        by_pose.dot(&(self.pose * by_pose)).max(0.0)
    }
}

impl Origins {
    fn of(frame: &SharedFrame, pair: &StereoPair<'_>) -> Option<Self> {
        let left_from_shared = frame.shared_from_left().rotation().to_rotation_matrix().inverse();
        let lenses = [*pair.left, *pair.right];
        (!pair.is_central()).then_some(Self { lenses, left_from_right: pair.left_from_right, left_from_shared })
    }

    /// The range from where the left ray starts to the pseudo-intersection with the right ray, which lies in its epipolar plane of the
    /// cameras' origins.
    fn range_mm(&self, [a, b]: [f64; 2], d: f64) -> Option<f64> {
        let [left, right] = &self.lenses;
        let pair = StereoPair { left, right, left_from_right: self.left_from_right };
        let ray = |a: f64| UnitRay::<Left>::new(self.left_from_shared * direction(a, b));
        let (left, turned) = (ray(a)?, ray(a - d)?);
        let in_right = self.left_from_right.inverse() * turned;
        let (between, _) = pair.at_origins(&left, &in_right);
        let made = pseudo_intersection(&left, &turned, &between.left_from_right.origin()).ok()?;
        Some(made.left_range.mm())
    }
}

#[cfg(test)]
mod tests {
    use nalgebra::SMatrix;
    use vergence_vision::{
        Angle, ImageSize, KannalaBrandt, Left, Pixel, PointUncertainty, SharedCovariance, StereoPair, Transform,
    };

    use super::*;

    /// Of fx, fy, cx, cy and k1 to k4.
    const SIGMAS: [f64; 8] = [0.3, 0.3, 0.2, 0.2, 1e-3, 1e-3, 1e-4, 1e-5];

    /// Compares ranges, and the part of their variance from the pose, with those of single points in `vergence_vision`.
    #[test]
    fn ranges_and_their_sigma_agree_with_single_points() {
        let size = ImageSize { width: 640, height: 640 };
        let centre = Pixel { u: 319.5, v: 319.5 };
        let lens = KannalaBrandt::new([180.0, 0.0, 0.0, 0.0, 0.0], 1.0, centre, Angle::from_deg(98.0), size).unwrap();
        let turn = nalgebra::UnitQuaternion::from_euler_angles(0.1, 0.6, -0.2);
        let left_from_right = Transform::new(turn, Vector3::new(140.0, 12.0, -30.0));
        let frame = SharedFrame::new(&left_from_right).unwrap();
        let spread = Matrix6::from_fn(|i, j| ((3 * i + 5 * j) % 7) as f64 * if i < 3 { 1e-4 } else { 0.05 });
        let pose = spread * spread.transpose();
        let shared = SharedCovariance::exact().with_pose(&pose);
        let pair = StereoPair { left: &lens, right: &lens, left_from_right };
        let finder = RangeFinder::new(&frame, &pair, &shared);
        let by_lens =
            SMatrix::<f64, LENS_PARAMETERS, LENS_PARAMETERS>::from_diagonal(&nalgebra::SVector::from_fn(|i, _| {
                SIGMAS.get(i).map_or(0.0, |sigma: &f64| sigma.powi(2))
            }));
        let uncertain = shared.with_lenses([&by_lens, &by_lens]);
        let with_lenses = RangeFinder::new(&frame, &pair, &uncertain);
        for [x, y, z] in [[0.0, 0.0, 400.0], [300.0, -200.0, 900.0], [-500.0, 700.0, 300.0], [100.0, 900.0, -100.0]] {
            let point = vergence_vision::Point::<Left>::from_mm(Vector3::new(x, y, z));
            let angles = |mm: Vector3<f64>| [mm.x.atan2(mm.y.hypot(mm.z)), mm.y.atan2(mm.z)];
            let in_shared = (frame.shared_from_left() * point).mm();
            let [a, b] = angles(in_shared);
            let [right, _] = angles(in_shared - Vector3::x() * frame.baseline().mm());
            let found = finder.at(&Direction::at([a, b]), a - right, 0.0);
            assert!((found.mm / point.mm().norm() - 1.0).abs() < 1e-12);
            let along = point.mm().normalize();
            let by_pose = PointUncertainty::of(&point, &pair, 0.0).unwrap().covariance(&shared);
            let expected = along.dot(&(by_pose * along)).sqrt();
            assert!((found.sigma_mm / expected - 1.0).abs() < 1e-9, "{} is not {expected}", found.sigma_mm);
            // With uncertain lenses, by interpolation.
            let by_all = PointUncertainty::of(&point, &pair, 0.0).unwrap().covariance(&uncertain);
            let (stated, expected) =
                (with_lenses.at(&Direction::at([a, b]), a - right, 0.0).sigma_mm, along.dot(&(by_all * along)).sqrt());
            assert!((stated / expected - 1.0).abs() < 0.02, "{stated} is not {expected}");
            // The disparity's own share, by difference.
            let step = 1e-6;
            let moved = finder.at(&Direction::at([a, b]), a - right + step, 0.0).mm - found.mm;
            let own = finder.at(&Direction::at([a, b]), a - right, step).own_sigma_mm;
            assert!((moved.abs() / own - 1.0).abs() < 1e-3);
        }
    }
}
