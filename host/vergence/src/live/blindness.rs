//! Which cameras are dead, and for how long both are.

use std::time::Duration;

use tokio::time::Instant;

use super::exposures::UNHEARD;

/// Both cameras dead for this long: nothing will come any more.
const HOPE: Duration = Duration::from_secs(5);

/// What was known of the cameras last.
pub struct Blindness {
    dead: [Option<String>; 2],
    since: Option<Instant>,
}

impl Default for Blindness {
    fn default() -> Self {
        Self { dead: [(); 2].map(|()| Some(UNHEARD.to_owned())), since: None }
    }
}

impl Blindness {
    /// Says which camera died, and which is back; whether both have been dead so long that there is no hope.
    pub fn note(&mut self, dead: [Option<&str>; 2], mut warn: impl FnMut(String)) -> bool {
        for ((name, before), now) in ["left", "right"].iter().zip(&self.dead).zip(dead) {
            let before = before.as_deref();
            match (before, now) {
                _ if now == Some(UNHEARD) || (before == Some(UNHEARD) && now.is_none()) => {}
                (_, Some(why)) if before != now => warn(format!("the {name} camera is dead: {why}")),
                (Some(_), None) => warn(format!("the {name} camera is there")),
                _ => {}
            }
        }
        self.dead = dead.map(|why| why.map(ToOwned::to_owned));
        if self.dead.iter().any(Option::is_none) {
            self.since = None;
            return false;
        }
        self.since.get_or_insert_with(Instant::now).elapsed() > HOPE
    }
}
