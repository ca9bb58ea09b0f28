//! Settings that are saved, and those that a board has after a start.

use vergence_protocol::{Refusal, Report, Request, SettingItem, SettingKey, Status};

use super::talk::Talk;

/// Number of times that a request is made while the board tests itself. An answer takes milliseconds.
const PATIENCE: usize = 1_000;

/// Settings that change with each saving, from the first to the last of a record, and their values at saving 0. None of
/// them is that of the factory.
const CHANGED: [(SettingKey, i64); 5] = [
    (of(SettingItem::Speed, 0), 70_000),
    (of(SettingItem::Tolerance, 0), 25),
    (of(SettingItem::Backlash, 1), 1_000),
    (of(SettingItem::HomeTravel, 1), 2_400_000),
    (of(SettingItem::StreamPeriod, 0), 7_000),
];

const fn of(item: SettingItem, axis: u8) -> SettingKey {
    SettingKey { item, axis }
}

impl Talk {
    /// Sets and saves the settings of this number.
    pub fn save(&mut self, number: i64) -> Result<(), String> {
        for (key, first) in CHANGED {
            self.ask_done(&Request::SetSetting { key, value: first + number })?;
        }
        self.ask_done(&Request::SaveSettings)
    }

    /// The number of the saving that the board's settings are from.
    pub fn saved(&mut self) -> Result<i64, String> {
        let mut numbers = Vec::new();
        for (key, first) in CHANGED {
            match self.ask_session(&Request::GetSetting(key))? {
                Report::Setting { value, .. } => numbers.push(value - first),
                other => return Err(format!("{key:?} is answered by {other:?}")),
            }
        }
        match numbers.as_slice() {
            [number, rest @ ..] if rest.iter().all(|other| other == number) => Ok(*number),
            _ => Err(format!("the settings are those of savings {numbers:?}")),
        }
    }

    /// Asks again while the board tests itself.
    fn ask_done(&mut self, request: &Request) -> Result<(), String> {
        for _ in 0..PATIENCE {
            match self.ask_session(request)? {
                Report::Ack { status: Status::Accepted, .. } => return Ok(()),
                Report::Ack { status: Status::Refused(Refusal::NotIdle), .. } => {}
                other => return Err(format!("{request:?} is answered by {other:?}")),
            }
        }
        Err(format!("{request:?} is refused, because the board does not become idle"))
    }
}
