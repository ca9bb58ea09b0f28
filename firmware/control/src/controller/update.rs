//! States in which nothing may move because of the firmware itself.

use vergence_protocol::{ControllerState, Refusal};

use super::Controller;

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
        if self.state == ControllerState::Idle {
            self.state = ControllerState::Trial;
        }
    }

    /// The firmware on trial is good.
    pub fn confirm_trial(&mut self) {
        if self.state == ControllerState::Trial {
            self.state = ControllerState::Idle;
        }
    }
}
