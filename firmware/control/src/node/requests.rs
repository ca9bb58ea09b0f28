//! Requests: those of the node, and those that it passes on to the controller.

use vergence_protocol::{
    BoardInfo, ControllerState, Happening, Microseconds, Refusal, Report, Request, SessionId, SettingItem, SettingKey,
    Status,
};

use super::Node;
use crate::board_settings::{BoardSettings, SHORTEST_STREAM_US, SettingError};
use crate::io::RigIo;
use crate::services::BoardServices;
use crate::settings_store;

impl Node {
    /// Carries out a request; returns the answer, or `None` if the request needs none.
    pub(super) fn serve(
        &mut self,
        now: Microseconds,
        request: &Request,
        received: Microseconds,
        io: &mut impl RigIo,
        services: &mut impl BoardServices,
    ) -> Option<Report> {
        Some(match request {
            Request::Heartbeat { session, lease_ms } => {
                self.controller.heartbeat(received, *session, *lease_ms);
                return None;
            }
            Request::TimeProbe { t0 } => Report::TimeReply { t0: *t0, t1: received, t2: now },
            Request::GetInfo => Report::Info { to: 0, info: self.info() },
            Request::GetAxis { axis } => match self.controller.axis_info(usize::from(*axis)) {
                Some(info) => Report::Axis { to: 0, axis: *axis, info },
                None => refused(Refusal::Invalid),
            },
            Request::GetSetting(key) => match self.settings.get(*key) {
                Some(value) => Report::Setting { to: 0, key: *key, value },
                None => refused(Refusal::NoSetting),
            },
            Request::GetDriver { axis } if usize::from(*axis) < self.controller.axis_count() => {
                Report::Driver { to: 0, axis: *axis, state: io.driver(usize::from(*axis)) }
            }
            Request::GetEncoder { axis } if usize::from(*axis) < self.controller.axis_count() => {
                let state = self.controller.encoder_state((*axis).into(), io);
                Report::Encoder { to: 0, axis: *axis, state }
            }
            Request::GetDriver { .. } | Request::GetEncoder { .. } => refused(Refusal::Invalid),
            Request::GetEvents { first } => Report::Events { to: 0, events: self.recorder.page(*first) },
            Request::GetStatistics => Report::Statistics { to: 0, statistics: self.session.statistics() },
            Request::GetKey => Report::Key { to: 0, key: services.trusted_key() },
            change => {
                let status = self.change(now, change, io, services);
                match (&status, change) {
                    (Status::Refused(refusal), _) => self.recorder.record(now, Happening::Refused(*refusal)),
                    (_, Request::Stop { kind }) => self.recorder.record(now, Happening::Stop(*kind)),
                    _ => {}
                }
                Report::Ack { to: 0, status }
            }
        })
    }

    /// Carries out a request that changes something.
    fn change(
        &mut self,
        now: Microseconds,
        request: &Request,
        io: &mut impl RigIo,
        services: &mut impl BoardServices,
    ) -> Status {
        let outcome = match request {
            Request::SetStream { period_us } => {
                let period = if *period_us == 0 { 0 } else { (*period_us).max(SHORTEST_STREAM_US) };
                self.set_stream(now, period);
                Ok(())
            }
            Request::SetTrigger(trigger) => self.trigger.set(now, *trigger, io),
            Request::SetSetting { key, value } => self.set_setting(now, *key, *value, io),
            Request::RestoreSettings => self.apply(now, self.delivered.of(self.machine).clone(), io),
            Request::SaveSettings => self.save_settings(now, services),
            // Checked when arming, because settings cannot change while armed.
            Request::Arm { .. } if self.settings.machine != self.machine => Err(Refusal::NoSuchMachine),
            motion => {
                let session = self.session.session().unwrap_or(SessionId(0));
                return self.controller.handle(now, session, motion, io);
            }
        };
        match outcome {
            Ok(()) => Status::Accepted,
            Err(refusal) => Status::Refused(refusal),
        }
    }

    fn set_setting(
        &mut self,
        now: Microseconds,
        key: SettingKey,
        value: i64,
        io: &mut impl RigIo,
    ) -> Result<(), Refusal> {
        // First, because a check of all settings takes too long for a tick in motion.
        if self.settings.get(key).is_some() {
            self.must_be_idle()?;
        }
        let changed = self.settings.with(key, value).map_err(|error| match error {
            SettingError::Unknown => Refusal::NoSetting,
            SettingError::Value => Refusal::BadSetting,
        })?;
        let before = self.settings.baud;
        self.apply(now, changed, io)?;
        if key.item == SettingItem::Baud {
            self.line.try_out(self.settings.baud, before);
        }
        Ok(())
    }

    /// Puts settings into effect; the line keeps its speed.
    fn apply(&mut self, now: Microseconds, settings: BoardSettings, io: &mut impl RigIo) -> Result<(), Refusal> {
        self.must_be_idle()?;
        self.controller.replace_settings(&settings.axes).map_err(|_| Refusal::BadSetting)?;
        self.controller.hold_after(settings.hold_after_us.into());
        self.settings = settings;
        self.configure(io);
        self.recorder.record(now, Happening::Settings);
        Ok(())
    }

    fn save_settings(&mut self, now: Microseconds, services: &mut impl BoardServices) -> Result<(), Refusal> {
        self.must_be_idle()?;
        if self.line.is_on_trial() {
            return Err(Refusal::LineOnTrial);
        }
        settings_store::save(services.settings_flash(), &self.next_settings()).map_err(|_| Refusal::StorageFailed)?;
        self.recorder.record(now, Happening::Settings);
        Ok(())
    }

    /// The settings of the next start: of another machine, those delivered, with the board's own line and stream.
    fn next_settings(&self) -> BoardSettings {
        let BoardSettings { machine, stream_period_us, baud, hold_after_us, .. } = self.settings;
        if machine == self.machine {
            return self.settings.clone();
        }
        BoardSettings { stream_period_us, baud, hold_after_us, ..self.delivered.of(machine).clone() }
    }

    fn must_be_idle(&self) -> Result<(), Refusal> {
        match self.controller.state() {
            ControllerState::Idle => Ok(()),
            ControllerState::Updating | ControllerState::Trial => Err(Refusal::Updating),
            _ => Err(Refusal::NotIdle),
        }
    }

    fn info(&self) -> BoardInfo {
        let super::NodeIdentity { board, firmware, build, uid, reset, .. } = self.identity.clone();
        let axes = u8::try_from(self.controller.axis_count()).unwrap_or(u8::MAX);
        BoardInfo { board, firmware, build, uid, reset, axes }
    }
}

fn refused(refusal: Refusal) -> Report {
    Report::Ack { to: 0, status: Status::Refused(refusal) }
}
