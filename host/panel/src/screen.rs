//! A recording on the pages: what its replay hears, where it stands, and how the pages want it played.

use std::sync::Arc;
use std::time::Duration;

use serde_json::json;
use tokio::sync::watch;
use vergence_board::{BoardKnowledge, describe_fault};
use vergence_camera::CameraEvent;
use vergence_protocol::{ControllerState, Microseconds, Mode, PoseReport};
use vergence_recording::{Audience, Event, Heard, Jump};
use vergence_rig::Rig;
use vergence_vision::Side;

use crate::hub::{Hub, Wish, text_message};
use crate::log::Level;
use crate::panel::Panel;
use crate::pictures::tapped;
use crate::status::Reporter;
use crate::streams::Stream;

/// Shortest time between two messages on where the recording stands.
const PACE_US: u64 = 200_000;

/// Shows a recording while it is replayed. Results are shown by [`Panel::show`].
pub struct Screen {
    panel: Panel,
    reporter: Reporter,
    wishes: watch::Receiver<Wish>,
    jumps: u64,
    length: Option<Duration>,
    rate: Option<f64>,
    /// When pages were told last where the recording stands.
    told_us: Option<u64>,
    /// The time of the event that is played; `None` of one that is left out.
    at: Option<Duration>,
    /// State, mode and number of the fault that the board told last.
    board: Option<(ControllerState, Mode, Option<u16>)>,
}

impl Screen {
    /// Shows on `panel` a recording that is so long, as far as that is known, and that is played so many times as fast as it was recorded.
    #[must_use]
    pub fn new(panel: Panel, length: Option<Duration>, rate: Option<f64>) -> Self {
        let (reporter, wishes) = (Reporter::new(Arc::clone(&panel.hub)), panel.hub.wish.subscribe());
        Self { panel, reporter, wishes, jumps: 0, length, rate, told_us: None, at: None, board: None }
    }

    /// The panel that shows it.
    #[must_use]
    pub const fn panel(&self) -> &Panel {
        &self.panel
    }

    /// The recording is over: waits until a page wants to see it from elsewhere.
    pub async fn jump(&mut self) -> Jump {
        self.tell(self.length.unwrap_or_default(), "over");
        loop {
            if let Err(jump) = self.wish() {
                return jump;
            }
            // The hub keeps the sender: it is not closed.
            let _ = self.wishes.changed().await;
        }
    }

    /// Whether it is held.
    fn wish(&mut self) -> Result<bool, Jump> {
        let wish = *self.wishes.borrow_and_update();
        if std::mem::replace(&mut self.jumps, wish.jumps) == wish.jumps {
            return Ok(wish.is_paused);
        }
        self.told_us = None;
        self.panel.note(&format!("goes on from {:.1} s", wish.jump_to.as_secs_f64()));
        Err(Jump(wish.jump_to))
    }

    fn tell(&mut self, at: Duration, state: &str) {
        self.told_us = Some(self.hub().clock.now().0);
        let seconds = |time: Duration| (time.as_secs_f64() * 1000.0).round() / 1000.0;
        self.hub().put(
            Stream::Playback,
            text_message(&json!({
                "kind": "playback",
                "at_s": seconds(at),
                "length_s": self.length.map(seconds),
                "rate": self.rate,
                "state": state,
            })),
        );
    }

    fn hub(&self) -> &Hub {
        &self.panel.hub
    }

    /// Adds a line to the log, unless its event is left out.
    fn note(&self, level: Level, text: &str) {
        if let Some(at) = self.at {
            self.hub().note_at("recording", at.as_secs_f64(), level, text);
        }
    }

    /// Logs what the board did by how its poses change.
    fn compare(&mut self, rig: &Rig, pose: &PoseReport) {
        let now = (pose.state, pose.mode, pose.fault.map(|fault| fault.seq));
        let Some((state, mode, fault)) = self.board.replace(now) else { return };
        if let Some(new) = pose.fault.as_ref().filter(|new| Some(new.seq) != fault) {
            self.note(Level::Error, &describe_fault(rig, new));
        } else if fault.is_some() && pose.fault.is_none() {
            self.note(Level::Note, "the fault was cleared");
        }
        if state != pose.state {
            self.note(Level::Note, &pose.state.to_string());
        }
        if mode != pose.mode
            && let Some(mode) = rig.reported_mode(pose)
        {
            self.note(Level::Note, &format!("mode {mode}"));
        }
    }
}

impl Audience for Screen {
    async fn proceed(&mut self, since_first: Duration) -> Result<(), Jump> {
        self.at = Some(since_first);
        let now = self.hub().clock.now().0;
        if self.told_us.is_none_or(|told| now.saturating_sub(told) >= PACE_US) {
            self.tell(since_first, "plays");
        }
        while self.wish()? {
            self.tell(since_first, "paused");
            let _ = self.wishes.changed().await;
            self.told_us = None;
        }
        Ok(())
    }

    fn hear(&mut self, heard: &Heard, board: Option<&BoardKnowledge>) {
        let rig = Arc::clone(&self.hub().setting.rig);
        match (&heard.event, board) {
            (Event::Begun(_), _) => self.board = None,
            (Event::Pose(pose), Some(board)) => {
                self.reporter.report(&rig, pose, board, Microseconds(heard.host_us));
                self.compare(&rig, pose);
            }
            (Event::Attached(eye, _), _) => self.note(Level::Note, &format!("the {} camera is there", eye.name())),
            (Event::Lost(eye, why), _) => {
                self.note(Level::Warning, &format!("the {} camera is dead: {why}", eye.name()));
            }
            _ => {}
        }
        self.at = None;
    }

    fn camera(&mut self, side: Side, event: CameraEvent) -> CameraEvent {
        tapped(event, side, &self.panel.darkroom)
    }
}
