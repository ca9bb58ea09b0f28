//! What images told of a pose while the rig stood somewhere, kept for when it comes back.
//!
//! The error of a pose by the joints has a part c that lasts, that of the calibration, and a part p that is new at each visit: play,
//! readings. Images tell their sum. With C and P the covariances of both before the visit, and m and T the mean of the sum and its covariance
//! after it, the lasting part is (H. Rauch, F. Tung and C. Striebel, "Maximum likelihood estimates of linear dynamic systems", AIAA
//! Journal 3(8), 1965, eq. 3.28 with 3.29):
//!
//! ```text
//! G = C (C + P)⁻¹        c = G m        C' = C - G C + G T Gᵀ
//! ```
//!
//! Where play hides the lasting part, G is small, and a visit tells the next one little.

use nalgebra::{Matrix6, Vector6};
use vergence_rig::{Rig, RigPose};
use vergence_vision::{FusedPose, moved_pose};

use crate::pose_source::told_otherwise;

/// Two positions of an axis are one where they differ by less than this part of its range: the calibration's error is the same there.
const SAME: f64 = 5e-3;
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
                let anew = by_joints.covariance() - rig.lasting_covariance(by_joints);
                let moved = moved_pose(&by_joints.left_from_right, &lasting.error);
                told_otherwise(by_joints, moved, &(lasting.covariance + anew))
            }
        }
    }

    /// Keeps for the next visit what images say of the lasting error of `by_joints`: `told` is the pose by them and by [`Self::corrected`].
    pub(crate) fn keep(&mut self, rig: &Rig, by_joints: &RigPose, told: &FusedPose) {
        let before = self.at(rig, by_joints);
        let (visits, error, lasting) = before.map_or_else(
            || (0, Vector6::zeros(), rig.lasting_covariance(by_joints)),
            |before| (before.visits, before.error, before.covariance),
        );
        let anew = by_joints.covariance() - rig.lasting_covariance(by_joints);
        let Some(gain) = gain(&lasting, &anew) else { return };
        let kept = Lasting {
            axes: by_joints.axes.iter().map(|axis| axis.value()).collect(),
            visits: visits + 1,
            error: error + gain * told.correction,
            covariance: symmetric(&(lasting - gain * lasting + gain * told.covariance * gain.transpose())),
        };
        self.known.retain(|lasting| !is_at(lasting, rig, by_joints));
        if self.known.len() == KEPT {
            self.known.remove(0);
        }
        self.known.push(kept);
    }

    fn at(&self, rig: &Rig, by_joints: &RigPose) -> Option<&Lasting> {
        self.known.iter().find(|lasting| is_at(lasting, rig, by_joints))
    }
}

/// Whether the axes stand where `lasting` holds.
fn is_at(lasting: &Lasting, rig: &Rig, by_joints: &RigPose) -> bool {
    lasting.axes.len() == by_joints.axes.len()
        && rig.axes.iter().zip(&lasting.axes).zip(&by_joints.axes).all(|((axis, then), now)| {
            let [low, high] = axis.range.map(|end| end.value());
            (now.value() - then).abs() <= SAME * (high - low).abs()
        })
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
