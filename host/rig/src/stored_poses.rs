//! What images told of the pose in each mode, kept for the next visit.
//!
//! The way x from the pose by the joints to the true pose is a + j. The part a lasts from visit to visit: errors of the calibration. The
//! part j is drawn anew: play, and where a servo rests within its count. Nothing but a is worth keeping. With a of mean m and covariance
//! A before a visit, and J that of j, x has the mean m and the covariance A + J before any image, and what joints and images tell
//! together at the visit, of mean x' and covariance C, leaves of a (H. Rauch, F. Tung and C. Striebel, AIAA Journal 3(8), 1965)
//!
//! ```text
//! m' = m + K (x' - m)        A' = A - K (A + J - C) Kᵀ        K = A (A + J)⁻¹
//! ```

use std::collections::BTreeMap;

use nalgebra::{Matrix6, SymmetricEigen, UnitQuaternion, Vector3, Vector6};
use serde::{Deserialize, Serialize};
use vergence_vision::{Angle, Left, Length, Right, Transform};

use crate::pose::difference;
use crate::rig::Rig;
use crate::{Mode, RigPose};

/// Version of the file.
const FORMAT: u32 = 1;
/// What is kept narrows the rotation before any image of the next visit at least by this part; else it is not worth a file.
const WORTH: f64 = 0.1;

/// The part of the error of the pose by the joints that lasts from visit to visit of a mode.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LastingError {
    /// Its mean: a turn in radians and a shift in millimetres, as in [`RigPose::covariance`].
    pub mean: Vector6<f64>,
    /// Its covariance.
    pub covariance: Matrix6<f64>,
    /// Number of visits that told it.
    pub visits: u32,
}

/// Lasting errors by mode, and the rig that they belong to.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct StoredPoses {
    rig: String,
    modes: BTreeMap<String, LastingError>,
}

/// Why stored poses are not used. The text ends a sentence that begins with the file's name.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum StoredPosesError {
    /// It is not what this program writes.
    #[error("is no file of stored poses: {0}")]
    Unreadable(String),
    /// Another version wrote it.
    #[error("has format {0} of stored poses, this program reads {FORMAT}: remove it, and it is made anew")]
    OtherFormat(u32),
    /// It belongs to another rig, or to this one before its file was changed.
    #[error(
        "belongs to another rig file, or to this one before it was changed: name another file, or remove it and it is made anew"
    )]
    OtherRig,
    /// A covariance is none.
    #[error("has no covariance of mode '{0}' that could be one: remove it, and it is made anew")]
    NoCovariance(String),
}

#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct File {
    format: u32,
    rig_sha256: String,
    #[serde(default)]
    modes: BTreeMap<String, Entry>,
}

#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct Entry {
    visits: u32,
    mean: [f64; 6],
    covariance: [[f64; 6]; 6],
}

#[derive(Deserialize)]
struct Version {
    format: u32,
}

impl StoredPoses {
    /// None yet, of the rig whose file has this hash.
    #[must_use]
    pub fn none(rig_sha256: &str) -> Self {
        Self { rig: rig_sha256.to_owned(), modes: BTreeMap::new() }
    }

    /// Reads what [`Self::to_toml`] wrote for the rig whose file has this hash.
    ///
    /// # Errors
    /// [`StoredPosesError`].
    pub fn from_toml(text: &str, rig_sha256: &str) -> Result<Self, StoredPosesError> {
        let unreadable = |error: toml::de::Error| StoredPosesError::Unreadable(error.message().to_owned());
        let Version { format } = toml::from_str(text).map_err(unreadable)?;
        if format != FORMAT {
            return Err(StoredPosesError::OtherFormat(format));
        }
        let file: File = toml::from_str(text).map_err(unreadable)?;
        if file.rig_sha256 != rig_sha256 {
            return Err(StoredPosesError::OtherRig);
        }
        let mut stored = Self::none(rig_sha256);
        for (mode, entry) in file.modes {
            let mean = Vector6::from(entry.mean);
            let covariance = Matrix6::from_fn(|row, column| entry.covariance[row][column]);
            let is_one = covariance.iter().chain(&mean).all(|value| value.is_finite())
                && (covariance - covariance.transpose()).amax() <= 1e-9 * covariance.amax()
                && without_negative(&covariance).relative_eq(&covariance, 1e-9, 1e-6);
            if !is_one {
                return Err(StoredPosesError::NoCovariance(mode));
            }
            stored.modes.insert(mode, LastingError { mean, covariance, visits: entry.visits });
        }
        Ok(stored)
    }

    /// The text of a file that keeps them.
    ///
    /// # Errors
    /// Where a number cannot be written.
    pub fn to_toml(&self) -> Result<String, toml::ser::Error> {
        let entry = |lasting: &LastingError| Entry {
            visits: lasting.visits,
            mean: lasting.mean.into(),
            covariance: std::array::from_fn(|row| std::array::from_fn(|column| lasting.covariance[(row, column)])),
        };
        let modes = self.modes.iter().map(|(mode, lasting)| (mode.clone(), entry(lasting))).collect();
        toml::to_string(&File { format: FORMAT, rig_sha256: self.rig.clone(), modes })
    }

    /// What is kept of a mode.
    #[must_use]
    pub fn of(&self, mode: &str) -> Option<&LastingError> {
        self.modes.get(mode)
    }

    /// Keeps what a visit of `mode` left, in place of what was kept.
    pub fn keep(&mut self, mode: &str, lasting: LastingError) {
        self.modes.insert(mode.to_owned(), lasting);
    }

    /// Whether nothing is kept.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.modes.is_empty()
    }
}

impl LastingError {
    /// What the calibration says of it before any visit, at this pose by the joints.
    #[must_use]
    pub fn by_calibration(rig: &Rig, by_joints: &RigPose) -> Self {
        Self { mean: Vector6::zeros(), covariance: rig.lasting_covariance(by_joints), visits: 0 }
    }

    /// The pose before any image of a visit.
    #[must_use]
    pub fn before_images(&self, rig: &Rig, by_joints: &RigPose) -> RigPose {
        let covariance = self.covariance + passing(rig, by_joints);
        let part = |first: usize| covariance.fixed_view::<3, 3>(first, first).trace().max(0.0).sqrt();
        RigPose {
            left_from_right: moved(&by_joints.left_from_right, &self.mean),
            shared: by_joints.shared.with_pose(&covariance),
            rotation_sigma: Angle::from_rad(part(0)),
            translation_sigma: Length::from_mm(part(3)),
            ..by_joints.clone()
        }
    }

    /// What lasts, after joints and images told at a visit that the pose is `found`, with this covariance. `None` where nothing of it
    /// can be told apart from what passes.
    #[must_use]
    pub fn after(
        &self,
        rig: &Rig,
        by_joints: &RigPose,
        found: &Transform<Left, Right>,
        covariance: &Matrix6<f64>,
    ) -> Option<Self> {
        let before = self.covariance + passing(rig, by_joints);
        let gain = before.cholesky()?.solve(&self.covariance).transpose();
        let told = self.covariance - gain * (before - covariance) * gain.transpose();
        let mean = self.mean + gain * (difference(&by_joints.left_from_right, found) - self.mean);
        Some(Self { mean, covariance: without_negative(&told), visits: self.visits.saturating_add(1) })
    }

    /// Whether this narrows the rotation before the first image of a visit, beside what the joints say alone.
    #[must_use]
    pub fn helps(&self, rig: &Rig, by_joints: &RigPose) -> bool {
        let turn = |covariance: &Matrix6<f64>| covariance.fixed_view::<3, 3>(0, 0).trace();
        let before = self.covariance + passing(rig, by_joints);
        turn(&before).sqrt() < (1.0 - WORTH) * turn(&by_joints.covariance()).sqrt()
    }
}

impl Rig {
    /// The mode whose targets the axes of `pose` stand at.
    #[must_use]
    pub fn mode_at(&self, pose: &RigPose) -> Option<&Mode> {
        self.modes.iter().find(|mode| mode.holds(&self.axes, &pose.axes))
    }

    /// The part of the covariance of `pose` by the joints that lasts from visit to visit: that of the calibration.
    #[must_use]
    pub fn lasting_covariance(&self, pose: &RigPose) -> Matrix6<f64> {
        let values: Vec<f64> = pose.axes.iter().map(|axis| axis.value()).collect();
        self.trunk_calibration_covariance(&values)
            .unwrap_or_else(|| self.calibration_covariance(&values, &values).pose())
    }
}

/// The part of the covariance that is drawn anew at each visit.
fn passing(rig: &Rig, by_joints: &RigPose) -> Matrix6<f64> {
    without_negative(&(by_joints.covariance() - rig.lasting_covariance(by_joints)))
}

fn moved(pose: &Transform<Left, Right>, by: &Vector6<f64>) -> Transform<Left, Right> {
    let turn = UnitQuaternion::from_scaled_axis(Vector3::new(by[0], by[1], by[2]));
    Transform::new(turn * pose.rotation(), pose.origin().mm() + by.fixed_rows::<3>(3))
}

/// The covariance nearest to a symmetric matrix that rounding may have given negative variances.
fn without_negative(matrix: &Matrix6<f64>) -> Matrix6<f64> {
    // Turns in radians and shifts in millimetres differ by orders of magnitude.
    let sigmas = matrix.diagonal().map(|variance| variance.max(0.0).sqrt());
    let inverse = sigmas.map(|sigma| if sigma > 0.0 { sigma.recip() } else { 0.0 });
    let [scale, inverse] = [sigmas, inverse].map(|diagonal| Matrix6::from_diagonal(&diagonal));
    let eigen = SymmetricEigen::new(inverse * (matrix + matrix.transpose()) * inverse / 2.0);
    let values = Matrix6::from_diagonal(&eigen.eigenvalues.map(|value| value.max(0.0)));
    scale * eigen.eigenvectors * values * eigen.eigenvectors.transpose() * scale
}

#[cfg(test)]
mod tests {
    #![allow(clippy::expect_used, reason = "a test may fail")]

    use super::*;
    use crate::RigCalibration;

    /// The robot with cameras that are mounted by eye.
    fn robot() -> Rig {
        let rig = Rig::from_toml(include_str!("../../../docs/rigs/origaker.toml")).expect("the robot");
        let calibration = RigCalibration::Sigmas { rotation: Angle::from_deg(1.0), translation: Length::from_mm(2.0) };
        Rig { calibration, ..rig }
    }

    fn in_mode(rig: &Rig, name: &str) -> RigPose {
        let mode = rig.mode(name).expect("a mode");
        rig.pose_at_values(&mode.targets.iter().map(|target| target.value()).collect::<Vec<_>>())
    }

    fn turn(covariance: &Matrix6<f64>) -> f64 {
        covariance.fixed_view::<3, 3>(0, 0).trace().sqrt().to_degrees()
    }

    /// Images that tell the pose exactly leave of the lasting part what passes hides; many visits tell it better.
    #[test]
    fn visits_tell_what_lasts_and_play_is_drawn_anew() {
        let rig = robot();
        let by_joints = in_mode(&rig, "spider");
        let off = Vector6::new(0.02, -0.01, 0.015, 1.0, 2.0, -1.0);
        let truth = moved(&by_joints.left_from_right, &off);
        let mut lasting = LastingError::by_calibration(&rig, &by_joints);
        let first = turn(&lasting.before_images(&rig, &by_joints).covariance());
        assert!((first / turn(&by_joints.covariance()) - 1.0).abs() < 1e-6);
        let exactly = Matrix6::identity() * 1e-12;
        for _ in 0..10 {
            lasting = lasting.after(&rig, &by_joints, &truth, &exactly).expect("a covariance");
        }
        let passes = turn(&passing(&rig, &by_joints));
        let next = turn(&lasting.before_images(&rig, &by_joints).covariance());
        assert!(next < 0.3 * first && next > passes, "{first} {next} {passes}");
        assert!((lasting.mean - off).fixed_rows::<3>(0).norm() < 0.003, "{}", lasting.mean);
        assert!(lasting.helps(&rig, &by_joints) && lasting.visits == 10);
        // What is known from the start is not worth a file.
        assert!(!LastingError::by_calibration(&rig, &by_joints).helps(&rig, &by_joints));
    }

    #[test]
    fn a_file_is_read_as_it_was_written_and_only_for_its_rig() {
        let rig = robot();
        let by_joints = in_mode(&rig, "spider");
        let mut stored = StoredPoses::none("abc");
        let lasting = LastingError::by_calibration(&rig, &by_joints);
        stored.keep("spider", LastingError { mean: Vector6::new(0.1, 0.2, 0.3, 4.0, 5.0, 6.0), visits: 2, ..lasting });
        let text = stored.to_toml().expect("a file");
        assert_eq!(StoredPoses::from_toml(&text, "abc"), Ok(stored));
        assert_eq!(StoredPoses::from_toml(&text, "abd"), Err(StoredPosesError::OtherRig));
        let later = text.replace("format = 1", "format = 2");
        assert_eq!(StoredPoses::from_toml(&later, "abc"), Err(StoredPosesError::OtherFormat(2)));
        assert!(matches!(StoredPoses::from_toml("nonsense", "abc"), Err(StoredPosesError::Unreadable(_))));
        let negative = text.replacen("0.0003", "-0.0003", 1);
        assert_ne!(negative, text);
        assert_eq!(StoredPoses::from_toml(&negative, "abc"), Err(StoredPosesError::NoCovariance("spider".into())));
    }
}
