//! What a board can be asked besides motion: its settings, its recorder, its camera trigger.

use std::time::Duration;

use tokio::time::timeout;
use vergence_protocol::{
    FrameMark, Micro, RecordedEvent, Refusal, Report, Request, SettingItem, SettingKey, Status, Trigger,
};

use super::Board;
use crate::failure::Failure;
use crate::move_plan::AxisLimits;

impl Board {
    /// What the board's planner works with.
    ///
    /// # Errors
    /// Where the link ended.
    pub async fn limits(&self) -> Result<Vec<AxisLimits>, Failure> {
        let mut limits = Vec::new();
        for (&info, axis) in self.axes.iter().zip(0u8..) {
            let backlash = self.setting(SettingKey { item: SettingItem::Backlash, axis }).await?;
            let backlash = Micro(backlash.and_then(|value| i32::try_from(value).ok()).unwrap_or(0));
            limits.push(AxisLimits { info, backlash });
        }
        Ok(limits)
    }

    /// What a setting is, in the units of the wire; `None` where the board has no such setting.
    ///
    /// # Errors
    /// Where the link ended.
    pub async fn setting(&self, key: SettingKey) -> Result<Option<i64>, Failure> {
        match self.client.ask(Request::GetSetting(key)).await? {
            Report::Setting { value, .. } => Ok(Some(value)),
            Report::Ack { status: Status::Refused(Refusal::NoSetting | Refusal::Invalid), .. } => Ok(None),
            Report::Ack { status: Status::Refused(refusal), .. } => Err(self.refused(refusal)),
            _ => Err(Failure::protocol("the board answered a question about a setting with something else")),
        }
    }

    /// Changes a setting, in the units of the wire, or says why the board refuses.
    ///
    /// # Errors
    /// Where the link ended.
    pub async fn set(&self, key: SettingKey, value: i64) -> Result<Result<(), Refusal>, Failure> {
        self.request(Request::SetSetting { key, value }).await
    }

    /// What the flight recorder kept, oldest first, and how many earlier events it has forgotten.
    ///
    /// # Errors
    /// A board without recorder, or a link that ended.
    pub async fn events(&self) -> Result<(Vec<RecordedEvent>, u32), Failure> {
        let (mut kept, mut next, mut gone) = (Vec::new(), 0, 0);
        loop {
            let answer = match self.client.ask(Request::GetEvents { first: next }).await? {
                Report::Events { events, .. } => events,
                Report::Ack { status: Status::Refused(refusal), .. } => return Err(self.refused(refusal)),
                _ => return Err(Failure::protocol("the board answered a question about events with something else")),
            };
            gone += answer.first.saturating_sub(next);
            next = answer.first.saturating_add(answer.events.len() as u32);
            kept.extend(answer.events.iter().copied());
            if answer.events.is_empty() || next >= answer.total {
                return Ok((kept, gone));
            }
        }
    }

    /// Fires the cameras once, and waits for the mark of that pulse.
    ///
    /// # Errors
    /// A refusal, a link that ended, or a mark that was lost.
    pub async fn fire_cameras(&mut self) -> Result<FrameMark, Failure> {
        const PATIENCE: Duration = Duration::from_secs(1);
        self.client.forget_marks();
        self.ask(Request::SetTrigger(Trigger::Once)).await?;
        let mark = timeout(PATIENCE, self.next_mark()).await;
        mark.unwrap_or_else(|_| Err(Failure::device("the board fired the cameras but did not say where the axes were")))
    }

    /// The next pulse of the camera trigger.
    ///
    /// # Errors
    /// Where the link ended, or the board is silent.
    pub async fn next_mark(&mut self) -> Result<FrameMark, Failure> {
        Ok(self.client.next_mark().await?)
    }

    /// The next bytes of the board's log.
    ///
    /// # Errors
    /// Where the link ended.
    pub async fn next_log(&mut self) -> Result<Vec<u8>, Failure> {
        Ok(self.client.next_log().await?)
    }
}
