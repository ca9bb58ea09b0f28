//! How often the board sends its pose: as its settings say, unless that is too rare to follow it.

use vergence_protocol::{Request, SettingItem, SettingKey};

use super::Board;
use crate::error::BoardError;

/// Longest pose period at which a board can be followed.
const SLOWEST_US: i64 = 100_000;
/// Pose period asked of a board whose own is longer, for as long as the session lasts.
const ASKED_US: u32 = 10_000;

impl Board {
    /// Keeps the pose period of the board's settings where it is short enough, or else asks for a shorter one; the next
    /// session begins with the setting again.
    pub(super) async fn follow_stream(&mut self) -> Result<(), BoardError> {
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

    /// A sentence for people where the board's own pose period was too long and another was asked for.
    #[must_use]
    pub fn stream_note(&self) -> Option<&str> {
        self.stream_note.as_deref()
    }
}
