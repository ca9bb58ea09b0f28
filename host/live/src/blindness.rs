//! Which cameras are gone, and for how long both are.

use std::time::Duration;

use tokio::time::Instant;
use vergence_pipeline::CameraGone;

use crate::ladder::{Notice, Rung};

/// With both cameras gone for this long, nothing will come any more.
const HOPE: Duration = Duration::from_secs(5);

/// What was known of the cameras last (left, right).
pub struct Blindness {
    gone: [Option<CameraGone>; 2],
    since: Option<Instant>,
}

impl Default for Blindness {
    fn default() -> Self {
        Self { gone: [const { Some(CameraGone::Unknown) }; 2], since: None }
    }
}

impl Blindness {
    /// Warns of a camera that failed or is back. Whether both have been gone so long that there is no hope.
    pub fn note(&mut self, gone: [Option<&CameraGone>; 2], mut warn: impl FnMut(Notice)) -> bool {
        let is_alone = gone.iter().any(Option::is_some);
        for ((name, before), now) in ["left", "right"].iter().zip(&self.gone).zip(gone) {
            match (before.as_ref(), now) {
                (_, Some(CameraGone::Unknown)) | (Some(CameraGone::Unknown), None) => {}
                (before, Some(why)) if before != now => {
                    warn(Notice::step(Rung::CameraLost, true, format!("the {name} camera is dead: {why}")));
                }
                (Some(_), None) => {
                    warn(Notice::step(Rung::CameraLost, is_alone, format!("the {name} camera is there")));
                }
                _ => {}
            }
        }
        self.gone = gone.map(Option::<&CameraGone>::cloned);
        if self.gone.iter().any(Option::is_none) {
            self.since = None;
            return false;
        }
        self.since.get_or_insert_with(Instant::now).elapsed() > HOPE
    }
}
