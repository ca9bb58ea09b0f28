//! Questions and requests besides motion: limits, settings, flight recorder, camera trigger, log.

use std::time::Duration;

use tokio::time::timeout;
use vergence_protocol::{
    DriverState, EncoderState, Micro, RecordedEvent, Refusal, Report, Request, SettingItem, SettingKey, Status,
    Trigger, TriggerMark,
};

use super::Board;
use crate::error::BoardError;
use crate::firmware::PublicKey;
use crate::move_plan::AxisLimits;

/// Events of the flight recorder.
#[derive(Clone, Debug, PartialEq)]
pub struct RecordedEvents {
    /// The events, oldest first.
    pub events: Vec<RecordedEvent>,
    /// Number of events that the recorder has overwritten since the first one asked for.
    pub lost: u32,
    /// The number of the next event.
    pub next: u32,
}

impl Board {
    /// Limits and backlash of each axis, as the board's planner uses them.
    ///
    /// # Errors
    /// [`BoardError`] where the link ended.
    pub async fn limits(&self) -> Result<Vec<AxisLimits>, BoardError> {
        let mut limits = Vec::new();
        for (&info, axis) in self.axes.iter().zip(0u8..) {
            let backlash = self.setting(SettingKey { item: SettingItem::Backlash, axis }).await?;
            let backlash = Micro(backlash.and_then(|value| i32::try_from(value).ok()).unwrap_or(0));
            limits.push(AxisLimits { info, backlash });
        }
        Ok(limits)
    }

    /// The value of a setting in wire units; `None` where the board has no such setting.
    ///
    /// # Errors
    /// [`BoardError`]: a refusal, or a link that ended.
    pub async fn setting(&self, key: SettingKey) -> Result<Option<i64>, BoardError> {
        match self.client.ask(Request::GetSetting(key)).await? {
            Report::Setting { value, .. } => Ok(Some(value)),
            Report::Ack { status: Status::Refused(Refusal::NoSetting | Refusal::Invalid), .. } => Ok(None),
            Report::Ack { status: Status::Refused(refusal), .. } => Err(self.refused(refusal)),
            _ => Err(BoardError::OtherAnswer("a question about a setting")),
        }
    }

    /// The public key whose images the board takes; `None` where its firmware does not say.
    ///
    /// # Errors
    /// [`BoardError`]: a link that ended.
    pub async fn trusted_key(&self) -> Result<Option<PublicKey>, BoardError> {
        match self.client.ask(Request::GetKey).await? {
            Report::Key { key, .. } => Ok(Some(PublicKey(key))),
            _ => Ok(None),
        }
    }

    /// Names of the axes whose hard limit switches are normally open, so that the board cannot notice a broken wire.
    ///
    /// # Errors
    /// [`BoardError`]: a refusal, or a link that ended.
    pub async fn open_limits(&self) -> Result<Vec<String>, BoardError> {
        let mut names = Vec::new();
        for (axis, rig_axis) in (0..).zip(&self.rig().axes) {
            if self.setting(SettingKey { item: SettingItem::HardLimit, axis }).await? == Some(1) {
                names.push(rig_axis.name.clone());
            }
        }
        Ok(names)
    }

    /// Names of the axes whose home switch lies at the other end of the range than the setting `home_end` says: they cannot
    /// be homed.
    ///
    /// # Errors
    /// [`BoardError`]: a refusal, or a link that ended.
    pub async fn homes_aside(&self) -> Result<Vec<String>, BoardError> {
        let mut names = Vec::new();
        for ((axis, rig_axis), info) in (0..).zip(&self.rig().axes).zip(&self.axes) {
            let end = self.setting(SettingKey { item: SettingItem::HomeEnd, axis }).await?;
            let at = self.setting(SettingKey { item: SettingItem::HomeSwitchAt, axis }).await?;
            if let (Some(end), Some(at)) = (end, at)
                && (end == 1) != (at > i64::from(info.max.0))
            {
                names.push(rig_axis.name.clone());
            }
        }
        Ok(names)
    }

    /// Changes a setting to a value in wire units, or returns the board's refusal.
    ///
    /// # Errors
    /// [`BoardError`] where the link ended.
    pub async fn set(&self, key: SettingKey, value: i64) -> Result<Result<(), Refusal>, BoardError> {
        self.request(Request::SetSetting { key, value }).await
    }

    /// State of the motor driver of an axis; `None` where the board has no such axis or its firmware cannot tell.
    ///
    /// # Errors
    /// [`BoardError`]: a refusal, or a link that ended.
    pub async fn driver(&self, axis: u8) -> Result<Option<DriverState>, BoardError> {
        match self.client.ask(Request::GetDriver { axis }).await? {
            Report::Driver { state, .. } => Ok(Some(state)),
            Report::Ack { status: Status::Refused(Refusal::Invalid), .. } => Ok(None),
            Report::Ack { status: Status::Refused(refusal), .. } => Err(self.refused(refusal)),
            _ => Err(BoardError::OtherAnswer("a question about a motor driver")),
        }
    }

    /// The motor drivers that the board can tell of, with the names of their axes.
    ///
    /// # Errors
    /// [`BoardError`]: a refusal, or a link that ended.
    pub async fn drivers(&self) -> Result<Vec<(String, DriverState)>, BoardError> {
        let mut drivers = Vec::new();
        for (axis, known) in (0u8..).zip(&self.rig.axes) {
            let state = self.driver(axis).await?;
            drivers.extend(state.filter(|state| *state != DriverState::Plain).map(|state| (known.name.clone(), state)));
        }
        Ok(drivers)
    }

    /// State of the encoder of an axis; `None` where the board has no such axis or its firmware cannot tell.
    ///
    /// # Errors
    /// [`BoardError`]: a refusal, or a link that ended.
    pub async fn encoder(&self, axis: u8) -> Result<Option<EncoderState>, BoardError> {
        match self.client.ask(Request::GetEncoder { axis }).await? {
            Report::Encoder { state, .. } => Ok(Some(state)),
            Report::Ack { status: Status::Refused(Refusal::Invalid), .. } => Ok(None),
            Report::Ack { status: Status::Refused(refusal), .. } => Err(self.refused(refusal)),
            _ => Err(BoardError::OtherAnswer("a question about an encoder")),
        }
    }

    /// The encoders of which the board can tell more than a count, with the names of their axes.
    ///
    /// # Errors
    /// [`BoardError`]: a refusal, or a link that ended.
    pub async fn encoders(&self) -> Result<Vec<(String, EncoderState)>, BoardError> {
        let mut encoders = Vec::new();
        for (axis, known) in (0u8..).zip(&self.rig.axes) {
            let state = self.encoder(axis).await?;
            let told = state.filter(|state| *state != EncoderState::Plain);
            encoders.extend(told.map(|state| (known.name.clone(), state)));
        }
        Ok(encoders)
    }

    /// All events in the flight recorder.
    ///
    /// # Errors
    /// [`BoardError`]: a board without recorder, or a link that ended.
    pub async fn events(&self) -> Result<RecordedEvents, BoardError> {
        self.events_from(0).await
    }

    /// The events in the flight recorder from number `first` on; from the first one where the board has started again and has
    /// not reached that number.
    ///
    /// # Errors
    /// [`BoardError`]: a board without recorder, or a link that ended.
    pub async fn events_from(&self, first: u32) -> Result<RecordedEvents, BoardError> {
        let mut recorded = RecordedEvents { events: Vec::new(), lost: 0, next: first };
        loop {
            let answer = match self.client.ask(Request::GetEvents { first: recorded.next }).await? {
                Report::Events { events, .. } => events,
                Report::Ack { status: Status::Refused(refusal), .. } => return Err(self.refused(refusal)),
                _ => return Err(BoardError::OtherAnswer("a question about events")),
            };
            if answer.total < recorded.next {
                recorded = RecordedEvents { events: Vec::new(), lost: 0, next: 0 };
                continue;
            }
            if !answer.events.is_empty() {
                recorded.lost += answer.first.saturating_sub(recorded.next);
                recorded.next = answer.first.saturating_add(answer.events.len() as u32);
                recorded.events.extend(answer.events.iter().copied());
            }
            if answer.events.is_empty() || recorded.next >= answer.total {
                return Ok(recorded);
            }
        }
    }

    /// Fires the cameras once, and waits for the mark of that pulse.
    ///
    /// # Errors
    /// [`BoardError`]: a refusal, a link that ended, or a mark that was lost.
    pub async fn fire_cameras(&mut self) -> Result<TriggerMark, BoardError> {
        const PATIENCE: Duration = Duration::from_secs(1);
        self.client.forget_marks();
        self.ask(Request::SetTrigger(Trigger::Once)).await?;
        let mark = timeout(PATIENCE, self.next_mark()).await;
        mark.unwrap_or(Err(BoardError::NoMark))
    }

    /// Waits for the next pulse of the camera trigger.
    ///
    /// # Errors
    /// [`BoardError::Link`] where the link ended.
    pub async fn next_mark(&mut self) -> Result<TriggerMark, BoardError> {
        Ok(self.client.next_mark().await?)
    }

    /// Waits for the next bytes of the board's log.
    ///
    /// # Errors
    /// [`BoardError::Link`] where the link ended.
    pub async fn next_log(&mut self) -> Result<Vec<u8>, BoardError> {
        Ok(self.client.next_log().await?)
    }
}
