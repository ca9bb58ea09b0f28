//! How often the board sends its pose: as it is set to, unless that is too seldom to follow it.

use vergence_protocol::{Request, SettingItem, SettingKey};

use super::Board;
use crate::failure::Failure;

/// A board that sends its pose more seldom than this cannot be followed.
const SLOWEST_US: i64 = 100_000;
/// What is asked of such a board for as long as the session lasts.
const ASKED_US: u32 = 10_000;

impl Board {
    /// Leaves the pose stream as the board is set to. Where that is too seldom to follow it, more is asked for; the next
    /// session begins with the setting again.
    pub(super) async fn follow_stream(&mut self) -> Result<(), Failure> {
        let own = self.setting(SettingKey { item: SettingItem::StreamPeriod, axis: 0 }).await?;
        if own.is_some_and(|own| (1..=SLOWEST_US).contains(&own)) {
            return Ok(());
        }
        self.ask(Request::SetStream { period_us: ASKED_US }).await?;
        let set = match own {
            Some(0) => "the board is set to send no poses (stream_period 0s)".to_owned(),
            Some(own) => format!("the board is set to send its pose only every {} ms (stream_period)", own / 1000),
            None => return Ok(()),
        };
        let asked = ASKED_US / 1000;
        self.stream_note = Some(format!(
            "{set}: it was asked for one every {asked} ms while this command runs, and the setting stays as it is"
        ));
        Ok(())
    }

    /// A sentence where the board's own stream was too slow to follow.
    #[must_use]
    pub fn stream_note(&self) -> Option<&str> {
        self.stream_note.as_deref()
    }
}
