//! Requests that move nothing: the camera trigger, settings, a firmware update.

use vergence_protocol::management::{ImageHeader, Management};
use vergence_protocol::{Microseconds, Request, Trigger};

use super::{Host, PAUSE_US, Purpose};
use crate::scenario::Errand;

/// Length of the image that an update announces, in bytes.
const IMAGE_LENGTH: u32 = 4_096;

impl Host {
    /// Continues with an errand; `idle` says whether the drivers are off.
    pub(super) fn run_errand(&mut self, now: Microseconds, errand: Errand, idle: bool) {
        match errand {
            Errand::Trigger(period_us) => {
                let trigger = if period_us == 0 { Trigger::Off } else { Trigger::Every { period_us } };
                self.ask(now, Purpose::Errand, Request::SetTrigger(trigger));
            }
            _ if !idle => self.ask(now, Purpose::Disarm, Request::Disarm),
            Errand::Set(..) if self.unsaved => self.ask(now, Purpose::Errand, Request::SaveSettings),
            Errand::Set(key, value) => self.ask(now, Purpose::Set, Request::SetSetting { key, value }),
            Errand::Update => self.begin_update(now),
        }
    }

    /// Asks for the identity of the board, then announces an image for it. Both are repeated until the board updates.
    fn begin_update(&mut self, now: Microseconds) {
        if !self.may_ask() {
            return;
        }
        let request = self.identity.map_or(Management::Identify, |identity| {
            Management::Begin(ImageHeader {
                hardware: identity.hardware,
                version: identity.version,
                length: IMAGE_LENGTH,
                ..ImageHeader::default()
            })
        });
        self.notes.push(format!("host: {request:?}"));
        let _ = self.session.manage(request);
        self.wait_until = Microseconds(now.0 + PAUSE_US);
    }
}
