//! What the matches themselves say about the pose, and which of them do not go along.
//!
//! The epipolar band is as wide as the pose is uncertain, but the error of the pose is one small motion for all matches:
//! a rotation ω of the right camera and a change c of the baseline's direction. For bearings l and r in the shared axes
//! and the normal n = x × l / |x × l| of the epipolar plane, the angle of r off that plane changes to first order by
//! ω·(r × n) + c·(l × r) / |x × l|. Its most probable value under the prior of the pose, found by iteratively
//! reweighted least squares (P. Holland and R. Welsch, Commun. Stat. A6, 1977), leaves a much narrower band.

use nalgebra::{SMatrix, SVector, Vector3};
use vergence_vision::{Angle, UnitRay};

use crate::Shared;

/// ω and the two components of c across the baseline.
const UNKNOWNS: usize = 5;
const ITERATIONS: usize = 10;

/// The error of the pose as seen by the matches.
pub(crate) struct Consensus {
    correction: SVector<f64, UNKNOWNS>,
    covariance: SMatrix<f64, UNKNOWNS, UNKNOWNS>,
}

impl Consensus {
    /// The most probable error of the pose given pairs of bearings (left, right), of which most are right to about
    /// `match_sigma`. `pose_sigma` is the prior's standard deviation in each component.
    ///
    /// With a pose known exactly, or if the equations cannot be solved, there is nothing to correct.
    pub(crate) fn of(pairs: &[[UnitRay<Shared>; 2]], pose_sigma: Angle, match_sigma: Angle) -> Self {
        let mut consensus = Self { correction: SVector::zeros(), covariance: SMatrix::zeros() };
        if pose_sigma.rad() <= 0.0 {
            return consensus;
        }
        let equations: Vec<Equation> = pairs.iter().filter_map(Equation::of).collect();
        let prior = SMatrix::identity() / pose_sigma.rad().powi(2);
        for iteration in 0..ITERATIONS {
            // The scale shrinks from the prior's to the measurement's, so that the start does not decide who is out.
            let fade = (1.0 - iteration as f64 / (ITERATIONS - 3) as f64).max(0.0);
            let scale = match_sigma.rad().max(pose_sigma.rad() * fade);
            let (mut normal, mut right_side) = (prior, SVector::zeros());
            for equation in &equations {
                let residual = equation.residual(&consensus.correction) / scale;
                let weight = (1.0 + residual * residual).powi(-2) / (scale * scale);
                normal += equation.slope * (equation.slope * weight).transpose();
                right_side -= equation.slope * (weight * equation.offset);
            }
            let Some(factor) = normal.cholesky() else { break };
            consensus = Self { correction: factor.solve(&right_side), covariance: factor.inverse() };
        }
        consensus
    }

    /// How far a pair is off the corrected epipolar plane, and the standard deviation that the correction leaves there.
    /// `None` for a left bearing along the baseline, which has no epipolar plane.
    pub(crate) fn off_plane(&self, pair: &[UnitRay<Shared>; 2]) -> Option<(Angle, Angle)> {
        let equation = Equation::of(pair)?;
        let variance = equation.slope.dot(&(self.covariance * equation.slope));
        Some((Angle::from_rad(equation.residual(&self.correction).abs()), Angle::from_rad(variance.max(0.0).sqrt())))
    }
}

/// offset + slope · correction = 0 for a right match.
struct Equation {
    offset: f64,
    slope: SVector<f64, UNKNOWNS>,
}

impl Equation {
    fn of([left, right]: &[UnitRay<Shared>; 2]) -> Option<Self> {
        let (l, r) = (left.vector(), right.vector());
        let across = Vector3::x().cross(&l);
        let normal = across.try_normalize(f64::EPSILON)?;
        let turn = r.cross(&normal);
        let shift = l.cross(&r) / across.norm();
        Some(Self { offset: normal.dot(&r), slope: SVector::from([turn.x, turn.y, turn.z, shift.y, shift.z]) })
    }

    fn residual(&self, correction: &SVector<f64, UNKNOWNS>) -> f64 {
        self.offset + self.slope.dot(correction)
    }
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

    fn rays([left, right]: &[Vector3<f64>; 2], turn: &UnitQuaternion<f64>) -> [UnitRay<Shared>; 2] {
        [UnitRay::new(*left).unwrap(), UnitRay::new(turn * right).unwrap()]
    }

    #[test]
    fn a_rotation_is_recovered_in_spite_of_outliers() {
        let turn = UnitQuaternion::from_scaled_axis(Vector3::new(0.006, -0.004, 0.005));
        let inliers: Vec<_> = scene().iter().map(|pair| rays(pair, &turn)).collect();
        let mut pairs = inliers.clone();
        for pair in pairs.iter_mut().step_by(7) {
            let off_plane = Vector3::x().cross(&pair[0].vector()).normalize() * 0.015;
            pair[1] = UnitRay::new(pair[1].vector() + off_plane).unwrap();
        }
        let consensus = Consensus::of(&pairs, Angle::from_deg(0.5), Angle::from_deg(0.03));
        for (i, (pair, inlier)) in pairs.iter().zip(&inliers).enumerate() {
            // To first order: the square of 9 mrad is 0.08 mrad, 0.005°.
            let (off, sigma) = consensus.off_plane(inlier).unwrap();
            assert!(off.deg() < 0.02, "inlier {i} is {off:.4} off");
            assert!(sigma.deg() < 0.05, "{sigma:.4}");
            if i % 7 == 0 {
                let (off, _) = consensus.off_plane(pair).unwrap();
                assert!(off.deg() > 0.5, "outlier {i} is {off:.4} off");
            }
        }
    }

    #[test]
    fn without_matches_the_band_is_as_wide_as_the_prior() {
        let sigma = Angle::from_deg(0.5);
        let consensus = Consensus::of(&[], sigma, Angle::from_deg(0.03));
        let far = rays(&[Vector3::z(), Vector3::z()], &UnitQuaternion::identity());
        let (off, left_over) = consensus.off_plane(&far).unwrap();
        assert!(off.rad() < 1e-12);
        assert!((left_over.deg() - sigma.deg()).abs() < 1e-9);
    }
}
