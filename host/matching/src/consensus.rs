//! The error of the pose on which most matches agree, and the test of each match against it.
//!
//! The epipolar band is as wide as the pose is uncertain, but the error of the pose is one small motion for all
//! matches: a rotation ω of the right camera and a change c of the baseline's direction. For bearings l and r in the
//! shared axes and the normal n = x × l / |x × l| of the epipolar plane, the angle of r off that plane changes to first
//! order by ω·(r × n) + c·(l × r) / |x × l|. The most probable motion under the prior of the pose, found by iteratively
//! reweighted least squares (P. Holland and R. Welsch, Commun. Stat. A6, 1977), leaves a much narrower band.

use nalgebra::{SMatrix, SVector, UnitQuaternion, Vector3};
use vergence_vision::{Angle, Left, Right, Transform, UnitRay};

use crate::{Shared, SharedFrame};

/// Number of unknowns: ω and the two components of c across the baseline.
const UNKNOWNS: usize = 5;
const ITERATIONS: usize = 16;
/// Number of last iterations that use the scale of the measurement.
const SETTLING: usize = 4;

/// A match as bearings of both cameras, in the shared axes.
#[derive(Clone, Copy, Debug)]
pub(crate) struct BearingPair {
    pub left: UnitRay<Shared>,
    pub right: UnitRay<Shared>,
    /// Standard deviation of the angle of one bearing off the epipolar plane of the other.
    pub sigma: Angle,
}

/// The error of the pose on which most matches agree.
pub(crate) struct Consensus {
    /// Rotation of the right camera.
    turn: UnitQuaternion<f64>,
    /// Corrected direction of the baseline.
    baseline: Vector3<f64>,
    covariance: SMatrix<f64, UNKNOWNS, UNKNOWNS>,
}

impl Consensus {
    /// Estimates the most probable error of the pose from matches, most of which are right. `pose_sigma` is the prior's
    /// standard deviation of each component.
    ///
    /// With a pose known exactly, or if the equations cannot be solved, the correction is zero.
    pub(crate) fn of(bearing_pairs: &[BearingPair], pose_sigma: Angle) -> Self {
        let mut consensus =
            Self { turn: UnitQuaternion::identity(), baseline: Vector3::x(), covariance: SMatrix::zeros() };
        if pose_sigma.rad() <= 0.0 {
            return consensus;
        }
        let prior = SMatrix::identity() / pose_sigma.rad().powi(2);
        for iteration in 0..ITERATIONS {
            // The scale shrinks from the prior's to the measurement's, so that the start does not decide which matches
            // are outliers.
            let fade = (1.0 - iteration as f64 / (ITERATIONS - SETTLING) as f64).max(0.0);
            let (mut normal, mut right_side) = (prior, -prior * consensus.correction());
            for bearing_pair in bearing_pairs {
                let Some(equation) = consensus.equation(bearing_pair) else { continue };
                let scale = bearing_pair.sigma.rad().max(pose_sigma.rad() * fade * fade);
                let weight = (1.0 + (equation.offset / scale).powi(2)).powi(-2) / (scale * scale);
                normal += equation.slope * (equation.slope * weight).transpose();
                right_side -= equation.slope * (weight * equation.offset);
            }
            let Some(factor) = normal.cholesky() else { break };
            consensus.step(&factor.solve(&right_side));
            consensus.covariance = factor.inverse();
        }
        consensus
    }

    /// The angle of a match off the corrected epipolar plane, and the standard deviation that the correction leaves
    /// there. `None` for a left bearing along the baseline, which has no epipolar plane.
    pub(crate) fn off_plane(&self, bearing_pair: &BearingPair) -> Option<(Angle, Angle)> {
        let equation = self.equation(bearing_pair)?;
        let variance = equation.slope.dot(&(self.covariance * equation.slope));
        Some((Angle::from_rad(equation.offset.abs()), Angle::from_rad(variance.max(0.0).sqrt())))
    }

    /// The corrected pose; `pose` is the stated one, to whose shared axes the bearings refer.
    pub(crate) fn pose(&self, frame: &SharedFrame, pose: &Transform<Left, Right>) -> Transform<Left, Right> {
        let (from_left, from_right) = (frame.shared_from_left().rotation(), frame.shared_from_right().rotation());
        let rotation = from_left.inverse() * self.turn * from_right;
        Transform::new(rotation, from_left.inverse() * self.baseline * pose.origin().mm().norm())
    }

    fn correction(&self) -> SVector<f64, UNKNOWNS> {
        let turn = self.turn.scaled_axis();
        SVector::from([turn.x, turn.y, turn.z, self.baseline.y, self.baseline.z])
    }

    fn step(&mut self, by: &SVector<f64, UNKNOWNS>) {
        self.turn = UnitQuaternion::from_scaled_axis(Vector3::new(by[0], by[1], by[2])) * self.turn;
        self.baseline = (self.baseline + Vector3::new(0.0, by[3], by[4])).normalize();
    }

    fn equation(&self, bearing_pair: &BearingPair) -> Option<Equation> {
        let (l, r) = (bearing_pair.left.vector(), self.turn * bearing_pair.right.vector());
        let across = self.baseline.cross(&l);
        let normal = across.try_normalize(f64::EPSILON)?;
        let turn = r.cross(&normal);
        let shift = l.cross(&r) / across.norm();
        Some(Equation { offset: normal.dot(&r), slope: SVector::from([turn.x, turn.y, turn.z, shift.y, shift.z]) })
    }
}

/// The equation of a match: offset + slope · step = 0, in radians.
struct Equation {
    offset: f64,
    slope: SVector<f64, UNKNOWNS>,
}

#[cfg(test)]
mod tests {
    use nalgebra::UnitQuaternion;

    use super::*;

    /// Bearings spread over the field of points at 0.5 to 4 m from cameras 145 mm apart.
    fn scene() -> Vec<[Vector3<f64>; 2]> {
        (0..200)
            .map(|i| {
                let t = f64::from(i);
                let (a, b, range) =
                    ((0.7 * t).sin() * 0.9, (0.37 * t).cos() * 1.4, 500.0 + 3500.0 * (0.21 * t).sin().abs());
                let point = Vector3::new(a.sin(), a.cos() * b.sin(), a.cos() * b.cos()) * range;
                [point, point - Vector3::x() * 145.0]
            })
            .collect()
    }

    fn seen([left, right]: &[Vector3<f64>; 2], turn: &UnitQuaternion<f64>) -> BearingPair {
        let (left, right) = (UnitRay::new(*left).unwrap(), UnitRay::new(turn * right).unwrap());
        BearingPair { left, right, sigma: Angle::from_deg(0.03) }
    }

    /// Moves every seventh match off its epipolar plane by 15 mrad.
    fn with_outliers(inliers: &[BearingPair]) -> Vec<BearingPair> {
        let mut bearing_pairs = inliers.to_vec();
        for bearing_pair in bearing_pairs.iter_mut().step_by(7) {
            let off_plane = Vector3::x().cross(&bearing_pair.left.vector()).normalize() * 0.015;
            bearing_pair.right = UnitRay::new(bearing_pair.right.vector() + off_plane).unwrap();
        }
        bearing_pairs
    }

    #[test]
    fn a_rotation_is_recovered_in_spite_of_outliers() {
        for (degrees, sigma) in [(0.5, 0.5), (5.0, 3.0)] {
            let axis = Vector3::new(0.6, -0.4, 0.5).normalize();
            let turn = UnitQuaternion::from_scaled_axis(axis * f64::to_radians(degrees));
            let inliers: Vec<_> = scene().iter().map(|pair| seen(pair, &turn)).collect();
            let bearing_pairs = with_outliers(&inliers);
            let consensus = Consensus::of(&bearing_pairs, Angle::from_deg(sigma));
            for (i, (bearing_pair, inlier)) in bearing_pairs.iter().zip(&inliers).enumerate() {
                let (off, sigma) = consensus.off_plane(inlier).unwrap();
                assert!(off.deg() < 0.02, "{degrees}°: inlier {i} is {off:.4} off");
                assert!(sigma.deg() < 0.05, "{sigma:.4}");
                if i % 7 == 0 {
                    let (off, _) = consensus.off_plane(bearing_pair).unwrap();
                    assert!(off.deg() > 0.5, "{degrees}°: outlier {i} is {off:.4} off");
                }
            }
        }
    }

    #[test]
    fn the_pose_asked_for_is_the_true_one() {
        let stated = Transform::new(
            UnitQuaternion::from_scaled_axis(Vector3::new(0.02, 0.9, 0.01)),
            Vector3::new(130.0, 4.0, 60.0),
        );
        let truth = Transform::new(
            UnitQuaternion::from_scaled_axis(Vector3::new(0.06, 0.93, 0.0)),
            Vector3::new(132.0, 8.0, 57.0),
        );
        let frame = SharedFrame::new(&stated).unwrap();
        let bearing_pairs: Vec<_> = scene()
            .iter()
            .filter_map(|[left, _]| {
                let point =
                    vergence_vision::Point::<Left>::from_mm(frame.shared_from_left().rotation().inverse() * left);
                let right: vergence_vision::Point<Right> = truth.inverse() * point;
                Some(BearingPair {
                    left: frame.shared_from_left() * point.direction()?,
                    right: frame.shared_from_right() * right.direction()?,
                    sigma: Angle::from_deg(0.03),
                })
            })
            .collect();
        let asked = Consensus::of(&bearing_pairs, Angle::from_deg(3.0)).pose(&frame, &stated);
        let turn = (asked.rotation() * truth.rotation().inverse()).angle();
        let direction = asked.origin().mm().angle(&truth.origin().mm());
        assert!(turn.to_degrees() < 0.02 && direction.to_degrees() < 0.05, "{turn} {direction}");
    }

    #[test]
    fn without_matches_the_band_is_as_wide_as_the_prior() {
        let sigma = Angle::from_deg(0.5);
        let consensus = Consensus::of(&[], sigma);
        let far = seen(&[Vector3::z(), Vector3::z()], &UnitQuaternion::identity());
        let (off, left_over) = consensus.off_plane(&far).unwrap();
        assert!(off.rad() < 1e-12);
        assert!((left_over.deg() - sigma.deg()).abs() < 1e-9);
    }
}
