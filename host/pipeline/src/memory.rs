//! What a live rig remembers of its pose from pair to pair.

use vergence_rig::{JointsAt, Rig};

use crate::pose::PairPose;
use crate::standing::StandingPose;

/// What images told of the pose while the rig stands.
#[derive(Clone, Debug, Default)]
pub struct PoseMemory {
    /// The pose.
    pub standing: StandingPose,
    /// The joints as the images told them, where no encoder tells some.
    pub(crate) found: Option<JointsAt>,
}

impl PoseMemory {
    /// Forgets all that images told.
    pub(crate) fn forget(&mut self) {
        *self = Self::default();
    }

    /// Notes where the encoders say that the rig stands, before a pair is measured.
    pub(crate) fn arrive(&mut self, rig: &Rig, pose: &PairPose) {
        // What was found without an encoder is no pose by encoders.
        if self.found.is_some() {
            self.forget();
        }
        self.standing.forget_if_moved(rig, pose);
    }
}
