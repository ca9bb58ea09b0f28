//! What images told of a pose while the rig stood somewhere, kept for when it comes back.
//!
//! The error of a pose by the joints has a part c that lasts, that of the calibration, and a part p that is new at each visit: play,
//! readings. Images tell their sum. With C and P the covariances of both before the visit, and m and T the mean of the sum and its covariance
//! after it, the lasting part is (H. Rauch, F. Tung and C. Striebel, "Maximum likelihood estimates of linear dynamic systems", AIAA
//! Journal 3(8), 1965, the smoother's gain):
//!
//! ```text
//! G = C (C + P)⁻¹        c = G m        C' = C - G C + G T Gᵀ
//! ```
//!
//! Where play hides the lasting part, G is small, and a visit tells the next one little. Near a dead centre of a linkage the pose is no
//! linear function of its play, and nothing is kept.

use nalgebra::{Matrix6, Vector3, Vector6};
use vergence_alignment::{FusedPose, moved_pose};
use vergence_rig::{AxisPosition, Rig, RigAxis, RigPose};
use vergence_vision::Angle;

use crate::pose_source::told_otherwise;

/// Two positions of an axis are one where they differ by less than this part of its range: the calibration's error is the same there.
const SAME: f64 = 5e-3;
/// Standard deviation of the rotation by what is new at each visit, up to which its effect is taken as linear: half a degree bends a way of
/// 100 mm by 0.004 mm.
const LINEAR: Angle = Angle::from_deg(0.5);
/// Number of positions that are kept; the oldest one is forgotten for a new one.
const KEPT: usize = 16;

/// The lasting errors of the pose by the joints, by the positions of the axes at which the rig stood.
#[derive(Clone, Debug, Default)]
pub struct Visits {
    known: Vec<Lasting>,
}

/// The lasting error of the pose at one position of the axes, in the coordinates of [`RigPose::covariance`].
#[derive(Clone, Debug)]
struct Lasting {
    /// In millimetres or radians.
    axes: Vec<f64>,
    visits: usize,
    error: Vector6<f64>,
    covariance: Matrix6<f64>,
}

impl Visits {
    /// The number of earlier visits to the position of `by_joints`.
    #[must_use]
    pub fn count(&self, rig: &Rig, by_joints: &RigPose) -> usize {
        self.at(rig, by_joints).map_or(0, |lasting| lasting.visits)
    }

    /// The pose by the joints and by earlier visits to their position.
    pub(crate) fn corrected(&self, rig: &Rig, by_joints: &RigPose) -> RigPose {
        match self.at(rig, by_joints) {
            None => by_joints.clone(),
            Some(lasting) => {
                let moved = moved_pose(&by_joints.left_from_right, &lasting.error);
                told_otherwise(by_joints, moved, &(lasting.covariance + lasting.anew(rig, by_joints)))
            }
        }
    }

    /// Keeps for the next visit what images say of the lasting error of `by_joints`: `told` is the pose by them and by [`Self::corrected`].
    pub(crate) fn keep(&mut self, rig: &Rig, by_joints: &RigPose, told: &FusedPose) {
        let before = self.at(rig, by_joints).cloned().unwrap_or_else(|| Lasting::by_joints(rig, by_joints));
        let anew = before.anew(rig, by_joints);
        if anew.fixed_view::<3, 3>(0, 0).trace() > LINEAR.rad().powi(2) {
            return;
        }
        let Some(gain) = gain(&before.covariance, &anew) else { return };
        let left = before.covariance - gain * before.covariance + gain * told.covariance * gain.transpose();
        let kept = Lasting {
            visits: before.visits + 1,
            error: before.error + gain * told.correction,
            covariance: symmetric(&left),
            ..before
        };
        self.known.retain(|lasting| !lasting.is_at(rig, by_joints));
        if self.known.len() == KEPT {
            self.known.remove(0);
        }
        self.known.push(kept);
    }

    fn at(&self, rig: &Rig, by_joints: &RigPose) -> Option<&Lasting> {
        self.known.iter().find(|lasting| lasting.is_at(rig, by_joints))
    }
}

impl Lasting {
    /// What the calibration says of it.
    fn by_joints(rig: &Rig, by_joints: &RigPose) -> Self {
        Self {
            axes: by_joints.axes.iter().map(|axis| axis.value()).collect(),
            visits: 0,
            error: Vector6::zeros(),
            covariance: rig.lasting_covariance(by_joints),
        }
    }

    /// Whether the axes of `by_joints` stand where this holds.
    fn is_at(&self, rig: &Rig, by_joints: &RigPose) -> bool {
        let same = |((axis, then), now): ((&RigAxis, &f64), &AxisPosition)| {
            let [low, high] = axis.range.map(AxisPosition::value);
            (now.value() - then).abs() <= SAME * (high - low).abs()
        };
        self.axes.len() == by_joints.axes.len() && rig.axes.iter().zip(&self.axes).zip(&by_joints.axes).all(same)
    }

    /// The covariance of what is new at each visit. It is that of the joints, in a frame that is turned by this error where a mount is off
    /// that stands before the joints, and not where one behind them is: which of both is off is not known.
    fn anew(&self, rig: &Rig, by_joints: &RigPose) -> Matrix6<f64> {
        let of_joints = by_joints.covariance() - rig.lasting_covariance(by_joints);
        let turn = self.error.fixed_rows::<3>(0);
        let turned = self.covariance.fixed_view::<3, 3>(0, 0) + turn * turn.transpose();
        let mut total = of_joints;
        for (i, j) in (0..3).flat_map(|i| (0..3).map(move |j| (i, j))) {
            total += about(i) * of_joints * about(j).transpose() * turned[(i, j)];
        }
        total
    }
}

/// The derivative of a turn and a shift by a turn of their frame about its axis `index`.
fn about(index: usize) -> Matrix6<f64> {
    let cross = Vector3::ith(index, 1.0).cross_matrix();
    let mut both = Matrix6::zeros();
    both.fixed_view_mut::<3, 3>(0, 0).copy_from(&cross);
    both.fixed_view_mut::<3, 3>(3, 3).copy_from(&cross);
    both
}

/// C (C + P)⁻¹ on the space that C + P spans. Turns in radians and shifts in millimetres differ by orders of magnitude, so that the inverse
/// is that of the correlation.
fn gain(lasting: &Matrix6<f64>, anew: &Matrix6<f64>) -> Option<Matrix6<f64>> {
    let all = lasting + anew;
    let scale = Matrix6::from_diagonal(
        &all.diagonal().map(|variance| if variance > 0.0 { variance.sqrt().recip() } else { 0.0 }),
    );
    let inverse = symmetric(&(scale * all * scale)).pseudo_inverse(1e-9).ok()?;
    Some(lasting * scale * inverse * scale)
}

fn symmetric(matrix: &Matrix6<f64>) -> Matrix6<f64> {
    (matrix + matrix.transpose()) / 2.0
}
