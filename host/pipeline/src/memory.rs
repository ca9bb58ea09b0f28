//! What a live rig remembers of its pose from pair to pair, and from visit to visit of a mode.

use vergence_rig::{JointsAt, LastingError, Rig, StoredPoses};

use crate::cloud::PairCloud;
use crate::pose::PairPose;
use crate::standing::StandingPose;

/// What images told of the pose.
#[derive(Clone, Debug, Default)]
pub struct PoseMemory {
    /// The pose while the rig stands.
    pub standing: StandingPose,
    /// What visits of modes left.
    pub stored: StoredPoses,
    /// The joints as the images told them, where no encoder tells some.
    pub(crate) found: Option<JointsAt>,
    /// The mode at which the rig stands, and what was kept of it when it came.
    visit: Option<(String, Option<LastingError>)>,
}

impl PoseMemory {
    /// The memory of a rig whose modes were visited before.
    #[must_use]
    pub fn of_visits(stored: StoredPoses) -> Self {
        Self { stored, ..Self::default() }
    }

    /// Forgets what images told since the rig stands.
    pub(crate) fn forget(&mut self) {
        self.standing.begin(None);
        (self.found, self.visit) = (None, None);
    }

    /// Notes where the rig stands before a pair is measured.
    pub(crate) fn arrive(&mut self, rig: &Rig, pose: &PairPose) {
        self.found = None;
        self.standing.forget_if_moved(rig, pose);
        let mode = rig.mode_at(pose.at_middle()).filter(|_| pose.is_steady()).map(|mode| mode.name.clone());
        // A joint that trembles in its place is not a new visit.
        if self.visit.as_ref().map(|(mode, _)| mode) != mode.as_ref() {
            self.visit = mode.map(|mode| {
                let lasting = self.stored.of(&mode).copied();
                (mode, lasting)
            });
            self.standing.begin(self.visit.as_ref().and_then(|(_, lasting)| *lasting));
        }
    }

    /// Keeps what lasts of the pose that a pair told, where that will help at the next visit.
    pub(crate) fn keep(&mut self, rig: &Rig, pose: &PairPose, cloud: &PairCloud) {
        let (Some((mode, lasting)), Some(fused)) = (&self.visit, &cloud.fused_pose) else { return };
        let by_joints = pose.at_middle();
        let before = lasting.unwrap_or_else(|| LastingError::by_calibration(rig, by_joints));
        let after = before.after(rig, by_joints, &fused.left_from_right, &fused.covariance);
        if let Some(after) = after.filter(|after| after.helps(rig, by_joints)) {
            self.stored.keep(mode, after);
        }
    }
}
