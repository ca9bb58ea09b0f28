//! Management requests: identify, update, confirm, roll back, reboot.

use vergence_protocol::management::{BootState, Identity, ImageHeader, Management, ManagementReport, Outcome};
use vergence_protocol::{ControllerState, Microseconds};

use super::Node;
use crate::services::{BoardServices, Flash, PAGE};

/// Time in microseconds after which an update without management requests is given up; the host may resume it later.
const PATIENCE_US: u64 = 10_000_000;

impl Node {
    /// Carries out a management request; the session fills in the number of the request.
    pub(super) fn manage(
        &mut self,
        now: Microseconds,
        request: &Management,
        services: &mut impl BoardServices,
    ) -> ManagementReport {
        self.managed_at = now;
        let outcome = match request {
            Management::Identify => return ManagementReport::Identity(self.identify(services)),
            Management::Begin(header) => self.begin_update(header, services),
            Management::Chunk { offset, data } => self.in_update(|node| node.updater.chunk(*offset, data, services)),
            Management::Commit(signature) => self.in_update(|node| node.updater.commit(signature, services)),
            Management::Confirm => self.confirm(services),
            Management::Rollback | Management::Reboot(_) if self.controller.drivers_on() => Outcome::Busy,
            Management::Rollback => match services.roll_back() {
                Ok(true) => Outcome::Done,
                Ok(false) => Outcome::NothingToRollBack,
                Err(_) => Outcome::FlashFailed,
            },
            Management::Reboot(to) => {
                self.reboot = Some(*to);
                Outcome::Done
            }
        };
        ManagementReport::Progress { to: 0, next: self.updater.next(), outcome }
    }

    fn identify(&self, services: &mut impl BoardServices) -> Identity {
        Identity {
            hardware: self.identity.hardware,
            version: self.identity.firmware,
            oldest: self.identity.oldest,
            build: self.identity.build,
            boot: services.boot_state(),
            capacity: u32::try_from(services.image_flash().pages() * PAGE).unwrap_or(u32::MAX),
        }
    }

    fn begin_update(&mut self, header: &ImageHeader, services: &mut impl BoardServices) -> Outcome {
        if header.hardware != self.identity.hardware {
            return Outcome::WrongHardware;
        }
        if header.version < self.identity.oldest {
            return Outcome::TooOld;
        }
        let goes_on = self.controller.state() == ControllerState::Updating;
        if !goes_on && self.controller.begin_update().is_err() {
            return Outcome::Busy;
        }
        let outcome = self.updater.begin(header, services);
        if outcome != Outcome::Done && !goes_on {
            self.controller.end_update();
        }
        outcome
    }

    /// Runs `go_on` if an update is under way.
    fn in_update(&mut self, go_on: impl FnOnce(&mut Self) -> Outcome) -> Outcome {
        if self.controller.state() == ControllerState::Updating { go_on(self) } else { Outcome::NotBegun }
    }

    fn confirm(&mut self, services: &mut impl BoardServices) -> Outcome {
        if services.boot_state() != BootState::Confirmed && services.confirm().is_err() {
            return Outcome::FlashFailed;
        }
        self.controller.confirm_trial();
        Outcome::Done
    }

    /// Gives up an update whose host has gone silent.
    pub(super) fn watch_update(&mut self, now: Microseconds) {
        if now.0.saturating_sub(self.managed_at.0) > PATIENCE_US {
            self.controller.end_update();
        }
    }
}
