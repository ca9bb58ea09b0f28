//! States in which nothing may move: self-test, taking a firmware image, and its trial.

use vergence_protocol::{ControllerState, Refusal};

use super::Controller;
use crate::self_test::SelfTest;

impl Controller {
    /// A firmware image is about to be taken: nothing moves until [`Self::end_update`]. A latched fault stays latched and
    /// reported: one that cannot be cleared must not keep out the firmware that can.
    ///
    /// # Errors
    /// [`Refusal::NotIdle`] while the drivers are on; [`Refusal::Updating`] while an image is taken or on trial.
    pub fn begin_update(&mut self) -> Result<(), Refusal> {
        if self.on_trial || self.state == ControllerState::Updating {
            return Err(Refusal::Updating);
        }
        // In its first ticks, too, a board may be told.
        if self.drivers_on {
            return Err(Refusal::NotIdle);
        }
        // A lease that ends meanwhile concerns nobody.
        self.holder = None;
        self.before_update = self.state;
        self.state = ControllerState::Updating;
        Ok(())
    }

    /// The image was given up; one that was taken ends in a restart instead.
    pub fn end_update(&mut self) {
        if self.state == ControllerState::Updating {
            self.state = self.before_update;
        }
    }

    /// The running firmware is on trial: nothing moves until [`Self::confirm_trial`]. To be called at the start.
    pub fn set_trial(&mut self) {
        self.on_trial = true;
        if self.state == ControllerState::Idle {
            self.state = ControllerState::Trial;
        }
    }

    /// The firmware on trial is good.
    pub fn confirm_trial(&mut self) {
        self.on_trial = false;
        if self.state == ControllerState::Trial {
            self.state = ControllerState::Idle;
        }
    }

    /// Where a disarmed board without fault is.
    pub(super) fn at_rest(&self) -> ControllerState {
        if self.on_trial { ControllerState::Trial } else { ControllerState::Idle }
    }

    /// A board that has not passed its test looks again once the fault is cleared.
    pub(super) fn repeat_self_test(&mut self) {
        if !self.self_test.has_passed() {
            self.self_test = SelfTest::default();
            self.state = ControllerState::SelfTest;
        }
    }
}
