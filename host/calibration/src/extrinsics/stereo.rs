//! Residuals of one target seen by two cameras, with derivatives.

use nalgebra::{DMatrix, DVector, Isometry3, Matrix3x6, SMatrix, SVector, Vector2, Vector3};
use vergence_rig::RigNumber;
use vergence_targets::Corner;
use vergence_vision::{KannalaBrandt, Side};

use crate::TargetShape;
use crate::extrinsics::StereoView;
use crate::reprojection::{CENTRAL, LENS, Lens, POSE, point_by_move};
use crate::schur_lm::Equations;

/// Prior knowledge of the two lenses.
///
/// A lens's parameters are in the order of [`LENS_PARAMETERS`](vergence_vision::LENS_PARAMETERS), as in
/// [`IntrinsicsCalibration::covariance`](crate::IntrinsicsCalibration::covariance). Parameters of the pupil and of the asymmetry are no
/// unknowns where their variance is zero, and in a free lens where they are zero.
#[derive(Clone, Debug, PartialEq)]
pub enum LensKnowledge {
    /// The lenses are exactly as given.
    Exact,
    /// The lenses are as given, with the covariance of their own calibration from other images than these views.
    Within {
        /// Covariance of the left lens's parameters.
        left: Box<SMatrix<f64, LENS, LENS>>,
        /// Covariance of the right lens's parameters.
        right: Box<SMatrix<f64, LENS, LENS>>,
    },
    /// Nothing is known: the parameters given are only starting values.
    Free,
}

impl LensKnowledge {
    /// [`Self::Within`] these covariances of the left and the right lens.
    #[must_use]
    pub fn within(left: SMatrix<f64, LENS, LENS>, right: SMatrix<f64, LENS, LENS>) -> Self {
        Self::Within { left: Box::new(left), right: Box::new(right) }
    }
}

/// The two lenses as unknowns.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Lenses {
    pub left: Lens,
    pub right: Lens,
}

/// Prior of the lenses in a problem: whether they are unknowns, and the information on them.
pub(crate) struct LensPrior {
    pub start: Lenses,
    /// Square roots of the information, times `sigma`; `None` for free lenses.
    pull: Option<[DMatrix<f64>; 2]>,
    /// Which parameters of each lens are unknown, left and right.
    pub unknown: [Vec<usize>; 2],
}

/// Relative pose and lenses: all that the residuals of a view depend on besides the target's pose.
#[derive(Clone, Copy)]
pub(crate) struct Pair {
    pub left_from_right: Isometry3<f64>,
    pub lenses: Lenses,
    pub shape: TargetShape,
}

/// Residual of one corner (reprojection less observation, in pixels) and its derivatives.
pub(crate) struct StereoResidual {
    pub error: Vector2<f64>,
    pub by_relative_pose: SMatrix<f64, 2, POSE>,
    pub by_lens: SMatrix<f64, 2, LENS>,
    pub by_target: SMatrix<f64, 2, POSE>,
    /// By a move of the corner out of the target's plane.
    pub by_height: Vector2<f64>,
}

impl Lenses {
    pub fn of(left: &KannalaBrandt, right: &KannalaBrandt) -> Self {
        Self { left: Lens::of(left), right: Lens::of(right) }
    }

    /// The lenses by their parameters alone, as unknowns are.
    pub fn polynomial(&self) -> Self {
        Self { left: self.left.polynomial(), right: self.right.polynomial() }
    }
}

impl LensPrior {
    /// `sigma` is the standard deviation of a pixel coordinate in units of the corner's relative sigma. `None` if a
    /// covariance is not positive definite.
    pub fn new(start: Lenses, knowledge: &LensKnowledge, sigma: f64) -> Option<Self> {
        let root = |covariance: &SMatrix<f64, LENS, LENS>| {
            let unknown = unknown_within(covariance);
            let covariance =
                DMatrix::from_fn(unknown.len(), unknown.len(), |i, k| covariance[(unknown[i], unknown[k])]);
            // Scaled to unit diagonal first: the parameters differ by many orders of magnitude.
            let scaled = DMatrix::from_diagonal(&covariance.diagonal().map(|variance| 1.0 / variance.sqrt()));
            let factor = (&scaled * &covariance * &scaled).cholesky()?;
            Some(factor.l().try_inverse()? * scaled * sigma)
        };
        let free = |lens: &Lens| unknown_by(|parameter| lens.parameters()[parameter] != 0.0);
        let (pull, unknown) = match knowledge {
            LensKnowledge::Exact => (None, [Vec::new(), Vec::new()]),
            LensKnowledge::Free => (None, [free(&start.left), free(&start.right)]),
            LensKnowledge::Within { left, right } => {
                (Some([root(left)?, root(right)?]), [unknown_within(left), unknown_within(right)])
            }
        };
        Some(Self { start, pull, unknown })
    }

    /// The unknowns of the left lens and of the right one.
    pub fn numbers(&self) -> Vec<RigNumber> {
        let of = |(side, unknown): (Side, &Vec<usize>)| -> Vec<RigNumber> {
            unknown.iter().map(|&parameter| RigNumber::Lens { side, parameter }).collect()
        };
        [Side::Left, Side::Right].into_iter().zip(&self.unknown).flat_map(of).collect()
    }

    /// Number of unknowns of both lenses.
    pub fn dimension(&self) -> usize {
        self.unknown.iter().map(Vec::len).sum()
    }

    /// `lenses` moved by a step of the left lens's unknowns and then the right lens's.
    pub fn moved(&self, lenses: &Lenses, step: &[f64]) -> Lenses {
        let [left, right] = &self.unknown;
        let part = |first: usize, unknown: &[usize]| {
            let mut delta = SVector::<f64, LENS>::zeros();
            unknown.iter().zip(step.iter().skip(first)).for_each(|(&parameter, by)| delta[parameter] = *by);
            delta
        };
        if self.dimension() == 0 {
            return *lenses;
        }
        Lenses { left: lenses.left.moved(&part(0, left)), right: lenses.right.moved(&part(left.len(), right)) }
    }

    /// Adds the pull of the lenses' own calibration; their columns begin at `column` of the shared block.
    pub fn add_to(&self, lenses: &Lenses, column: usize, equations: &mut Equations<POSE>) {
        let Some(pull) = &self.pull else { return };
        let moves = [
            lenses.left.parameters() - self.start.left.parameters(),
            lenses.right.parameters() - self.start.right.parameters(),
        ];
        let mut first = column;
        for ((pull, lens_move), unknown) in pull.iter().zip(&moves).zip(&self.unknown) {
            let residual = pull * DVector::from_iterator(unknown.len(), unknown.iter().map(|&i| lens_move[i]));
            for row in 0..unknown.len() {
                let mut shared = vec![[0.0]; first + unknown.len()];
                for (slot, derivative) in shared.iter_mut().skip(first).zip(pull.row(row).iter()) {
                    *slot = [*derivative];
                }
                equations.add_plain(&[residual[row]], &shared, &[[0.0]; POSE]);
            }
            first += unknown.len();
        }
    }
}

/// The parameters of a lens that are unknown by this covariance.
fn unknown_within(covariance: &SMatrix<f64, LENS, LENS>) -> Vec<usize> {
    unknown_by(|parameter| covariance[(parameter, parameter)] > 0.0)
}

/// The parameters of a central and symmetric lens, and of the others those that the lens `has`.
fn unknown_by(has: impl Fn(usize) -> bool) -> Vec<usize> {
    (0..LENS).filter(|&parameter| parameter < CENTRAL || has(parameter)).collect()
}

impl Pair {
    /// The residual of `corner`, seen by the camera on `side`, of the target at `left_from_target`. `None` where the
    /// corner cannot be projected.
    pub fn residual(&self, side: Side, corner: &Corner, left_from_target: &Isometry3<f64>) -> Option<StereoResidual> {
        let turned = left_from_target.rotation * self.shape.point_mm(corner.target_mm);
        let in_left = turned + left_from_target.translation.vector;
        let by_target = point_by_move(&turned);
        let by_height = left_from_target.rotation * Vector3::z();
        let (projection, by_relative_pose, by_target, by_height) = match side {
            Side::Left => (self.lenses.left.project(&in_left)?, Matrix3x6::zeros(), by_target, by_height),
            Side::Right => {
                // Rᵀ(p - t) with R ← exp(ω) R, t ← t + δ.
                let right_from_left = self.left_from_right.rotation.inverse().to_rotation_matrix();
                let arm = in_left - self.left_from_right.translation.vector;
                let in_right = right_from_left * arm;
                let by_move = -(right_from_left.matrix() * point_by_move(&arm));
                let by_height = right_from_left * by_height;
                (self.lenses.right.project(&in_right)?, by_move, right_from_left.matrix() * by_target, by_height)
            }
        };
        Some(StereoResidual {
            error: projection.pixel - Vector2::new(corner.pixel.u, corner.pixel.v),
            by_relative_pose: projection.by_point * by_relative_pose,
            by_lens: projection.by_lens,
            by_target: projection.by_point * by_target,
            by_height: projection.by_point * by_height,
        })
    }

    /// Length of each residual of `view` in the order of [`StereoView::corners`]; infinite where a corner cannot be
    /// projected.
    pub fn errors_px(&self, view: &StereoView, left_from_target: &Isometry3<f64>) -> Vec<f64> {
        view.corners()
            .map(|(side, corner)| {
                self.residual(side, corner, left_from_target).map_or(f64::INFINITY, |residual| residual.error.norm())
            })
            .collect()
    }
}

#[cfg(test)]
mod tests {
    use nalgebra::UnitQuaternion;
    use vergence_vision::{Angle, ImageSize, Pixel};

    use super::*;
    use crate::reprojection::moved;

    fn pair() -> Pair {
        let size = ImageSize { width: 2048, height: 2048 };
        let centre = Pixel { u: 1020.0, v: 1030.0 };
        let camera = KannalaBrandt::new([600.0, 5.0, -2.0, 0.5, -0.1], 1.01, centre, Angle::from_deg(98.0), size);
        let lens = Lens::of(&camera.unwrap());
        let rotation = UnitQuaternion::from_scaled_axis(Vector3::new(0.1, 1.9, -0.2));
        let left_from_right = Isometry3::from_parts(Vector3::new(90.0, 4.0, -110.0).into(), rotation);
        Pair { left_from_right, lenses: Lenses { left: lens, right: lens }, shape: TargetShape::FLAT }
    }

    /// By central differences, of a target from in front to beyond 90°.
    #[test]
    fn derivatives_are_those_of_the_residual() {
        let pair = pair();
        let corner = Corner::new([125.0, -40.0], Pixel { u: 0.0, v: 0.0 });
        for turn in [0.0, 0.5, 1.0, 1.4] {
            let rotation = UnitQuaternion::from_scaled_axis(Vector3::new(0.2, turn, 0.3));
            let target = Isometry3::from_parts((rotation * Vector3::new(20.0, -30.0, 400.0)).into(), rotation);
            for side in [Side::Left, Side::Right] {
                let derivative = pair.residual(side, &corner, &target).unwrap();
                let difference =
                    |changed: &dyn Fn(f64) -> Vector2<f64>, step: f64| (changed(step) - changed(-step)) / (2.0 * step);
                for component in 0..POSE {
                    let by = |step: f64| SVector::<f64, POSE>::from_fn(|i, _| if i == component { step } else { 0.0 });
                    let step = if component < 3 { 1e-5 } else { 1e-3 };
                    let by_target = |s: f64| pair.residual(side, &corner, &moved(&target, &by(s))).unwrap().error;
                    let by_relative_pose = |s: f64| {
                        let left_from_right = moved(&pair.left_from_right, &by(s));
                        Pair { left_from_right, ..pair }.residual(side, &corner, &target).unwrap().error
                    };
                    let tolerance = if component < 3 { 1e-5 } else { 1e-8 };
                    let target_error = difference(&by_target, step) - derivative.by_target.column(component);
                    let pose_error =
                        difference(&by_relative_pose, step) - derivative.by_relative_pose.column(component);
                    assert!(target_error.norm() < tolerance, "target {component}: {target_error}");
                    assert!(pose_error.norm() < tolerance, "relative pose {component}: {pose_error}");
                }
            }
        }
    }
}
