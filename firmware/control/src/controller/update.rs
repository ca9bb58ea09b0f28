//! States in which nothing may move: self-test, firmware update and trial.

use vergence_protocol::{ControllerState, Refusal};

use super::Controller;
use crate::self_test::SelfTest;

impl Controller {
    /// Begins a firmware update: nothing moves until [`Self::end_update`]. A latched fault stays latched and reported, but
    /// does not prevent the update: new firmware may be the cure.
    ///
    /// # Errors
    /// [`Refusal::NotIdle`] while the drivers are on; [`Refusal::Updating`] while an image is received or on trial.
    pub fn begin_update(&mut self) -> Result<(), Refusal> {
        if self.on_trial || self.state == ControllerState::Updating {
            return Err(Refusal::Updating);
        }
        // States before Idle are allowed: an update may begin in the board's first ticks.
        if self.drivers_on {
            return Err(Refusal::NotIdle);
        }
        // No session holds the board during an update, so that no lease can expire.
        self.holder = None;
        self.before_update = self.state;
        self.state = ControllerState::Updating;
        Ok(())
    }

    /// Gives up an update. A completed update ends in a restart instead.
    pub fn end_update(&mut self) {
        if self.state == ControllerState::Updating {
            self.state = self.before_update;
        }
    }

    /// Notes that the running firmware is on trial: nothing moves until [`Self::confirm_trial`]. Call it at the start.
    pub fn set_trial(&mut self) {
        self.on_trial = true;
        if self.state == ControllerState::Idle {
            self.state = ControllerState::Trial;
        }
    }

    /// Ends the trial: the firmware is good.
    pub fn confirm_trial(&mut self) {
        self.on_trial = false;
        if self.state == ControllerState::Trial {
            self.state = ControllerState::Idle;
        }
    }

    /// State of a disarmed board without fault.
    pub(super) fn at_rest(&self) -> ControllerState {
        if self.on_trial { ControllerState::Trial } else { ControllerState::Idle }
    }

    /// Repeats the self-test after a fault is cleared, if it had not been passed.
    pub(super) fn repeat_self_test(&mut self) {
        if !self.self_test.has_passed() {
            self.self_test = SelfTest::default();
            self.state = ControllerState::SelfTest;
        }
    }
}
