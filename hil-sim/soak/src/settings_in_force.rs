//! The settings that a board has accepted, and those that it has saved, as far as promises depend on them: speed and range.

use vergence_protocol::{Request, SettingItem, SettingKey, Status};

/// Limits of an axis.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct AxisLimits {
    /// Largest speed in micro-units per second.
    pub speed: u32,
    /// Highest position of the range in micro-units.
    pub max: i32,
}

/// Settings of all axes.
#[derive(Debug)]
pub struct SettingsInForce {
    now: Vec<AxisLimits>,
    /// What the board may have at its next start.
    saved: Vec<AxisLimits>,
    /// The request that was not answered yet, and its sequence number.
    asked: Option<(u8, Request)>,
}

impl SettingsInForce {
    pub fn new(limits: impl IntoIterator<Item = AxisLimits>) -> Self {
        let now: Vec<AxisLimits> = limits.into_iter().collect();
        Self { saved: now.clone(), now, asked: None }
    }

    /// Limits of each axis.
    pub fn limits(&self) -> &[AxisLimits] {
        &self.now
    }

    /// Notes a request that reaches the board.
    pub fn requested(&mut self, seq: u8, request: &Request) {
        match request {
            Request::SetSetting { .. } => self.asked = Some((seq, request.clone())),
            Request::SaveSettings => {
                self.asked = Some((seq, request.clone()));
                for (saved, now) in self.saved.iter_mut().zip(&self.now) {
                    // A restart may find either.
                    *saved = AxisLimits { speed: saved.speed.max(now.speed), max: saved.max.max(now.max) };
                }
            }
            _ => {}
        }
    }

    /// Notes an answer that leaves the board.
    pub fn answered(&mut self, to: u8, status: Status) {
        let Some((_, request)) = self.asked.take_if(|(seq, _)| *seq == to && status == Status::Accepted) else {
            return;
        };
        match request {
            Request::SetSetting { key, value } => self.set(key, value),
            Request::SaveSettings => self.saved.clone_from(&self.now),
            _ => {}
        }
    }

    fn set(&mut self, key: SettingKey, value: i64) {
        let Some(limits) = self.now.get_mut(usize::from(key.axis)) else { return };
        match key.item {
            SettingItem::Speed => limits.speed = u32::try_from(value).unwrap_or(u32::MAX),
            SettingItem::Max => limits.max = i32::try_from(value).unwrap_or(i32::MAX),
            _ => {}
        }
    }

    /// Notes a restart of the board: what was not saved is lost.
    pub fn restarted(&mut self) {
        self.asked = None;
        self.now.clone_from(&self.saved);
    }
}
