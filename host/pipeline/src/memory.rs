//! What a live rig remembers of its pose from pair to pair.

use vergence_rig::JointsAt;

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

    /// Forgets what images told while no encoder told some axes: that is no pose by encoders.
    pub(crate) fn forget_untold(&mut self) {
        if self.found.is_some() {
            self.forget();
        }
    }
}
