//! States in which nothing may move: self-test, taking a firmware image, and its trial.

use vergence_protocol::{ControllerState, Refusal};

use super::Controller;
use crate::self_test::SelfTest;

impl Controller {
    /// A firmware image is about to be taken: nothing moves until [`Self::end_update`].
    ///
    /// # Errors
    /// [`Refusal::NotIdle`] unless disarmed without fault, [`Refusal::Updating`] while an image is taken or on trial.
    pub fn begin_update(&mut self) -> Result<(), Refusal> {
        match self.state {
            ControllerState::Idle => {
                self.state = ControllerState::Updating;
                Ok(())
            }
            ControllerState::Updating | ControllerState::Trial => Err(Refusal::Updating),
            _ => Err(Refusal::NotIdle),
        }
    }

    /// The image was given up; one that was taken ends in a restart instead.
    pub fn end_update(&mut self) {
        if self.state == ControllerState::Updating {
            self.state = ControllerState::Idle;
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
