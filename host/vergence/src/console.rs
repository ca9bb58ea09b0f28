//! What a command says: results on standard output, progress on standard error when that is a terminal.

use std::fmt::Display;
use std::io::{IsTerminal, Write, stderr, stdout};
use std::time::Duration;

use indicatif::{ProgressBar, ProgressStyle};
use serde_json::Value;
use vergence_board::{describe_fault, describe_pose, pose_json};
use vergence_protocol::PoseReport;
use vergence_rig::Rig;

use crate::failure::Failure;

/// Results as text or as JSON.
#[derive(Clone, Copy, Debug)]
pub struct Console {
    json: bool,
}

impl Console {
    /// With `json`, results are JSON and text is left out.
    #[must_use]
    pub fn new(json: bool) -> Self {
        Self { json }
    }

    /// Whether results are JSON.
    #[must_use]
    pub fn is_json(self) -> bool {
        self.json
    }

    /// A line for people; nothing in JSON.
    ///
    /// # Errors
    /// Where standard output cannot be written.
    pub fn say(self, line: impl Display) -> Result<(), Failure> {
        if self.json { Ok(()) } else { print_line(&line) }
    }

    /// Lines for people; nothing in JSON.
    ///
    /// # Errors
    /// Where standard output cannot be written.
    pub fn say_lines(self, lines: impl IntoIterator<Item = String>) -> Result<(), Failure> {
        lines.into_iter().try_for_each(|line| self.say(line))
    }

    /// The result for programs; nothing in text.
    ///
    /// # Errors
    /// Where standard output cannot be written.
    pub fn result(self, value: &Value) -> Result<(), Failure> {
        if self.json { print_line(value) } else { Ok(()) }
    }

    /// Says where the board is now.
    ///
    /// # Errors
    /// Where standard output cannot be written.
    pub fn say_pose(self, rig: &Rig, pose: &PoseReport) -> Result<(), Failure> {
        self.say(describe_pose(rig, pose))?;
        if let Some(fault) = pose.fault {
            self.say(format!("  {}", describe_fault(rig, &fault)))?;
        }
        self.result(&pose_json(rig, pose))
    }

    /// Something that people should know while a command goes on: on standard error, in JSON too.
    pub fn warn(self, line: impl Display) {
        // Nobody is left to hear that standard error is closed.
        let _ = writeln!(stderr(), "vergence: {line}");
    }

    /// Whether results go to a person at a terminal.
    #[must_use]
    pub fn is_live(self) -> bool {
        !self.json && stdout().is_terminal()
    }

    /// A spinner on a terminal, silent elsewhere.
    #[must_use]
    pub fn progress(self, what: &str) -> ProgressBar {
        if !self.shows_progress() {
            return ProgressBar::hidden();
        }
        let bar = ProgressBar::new_spinner().with_message(what.to_owned());
        if let Ok(style) = ProgressStyle::with_template("{spinner} {msg}") {
            bar.set_style(style);
        }
        // Long computations do not come round to draw.
        bar.enable_steady_tick(Duration::from_millis(100));
        bar
    }

    /// A bar of `bytes` bytes on a terminal, silent elsewhere.
    #[must_use]
    pub fn byte_bar(self, what: &str, bytes: u64) -> ProgressBar {
        self.bar(what, bytes, "{msg} {wide_bar} {bytes}/{total_bytes} {bytes_per_sec}")
    }

    /// A bar of `count` things on a terminal, silent elsewhere.
    #[must_use]
    pub fn count_bar(self, what: &str, count: u64) -> ProgressBar {
        self.bar(what, count, "{msg} {wide_bar} {pos}/{len} {eta}")
    }

    fn bar(self, what: &str, length: u64, template: &str) -> ProgressBar {
        if !self.shows_progress() {
            return ProgressBar::hidden();
        }
        let bar = ProgressBar::new(length).with_message(what.to_owned());
        if let Ok(style) = ProgressStyle::with_template(template) {
            bar.set_style(style);
        }
        bar
    }

    fn shows_progress(self) -> bool {
        !self.json && stderr().is_terminal()
    }
}

/// Shows each pose of a board on `progress`.
pub fn shown_on(progress: ProgressBar) -> impl FnMut(&Rig, &PoseReport) + Send + 'static {
    move |rig, pose| {
        progress.set_message(describe_pose(rig, pose));
        progress.tick();
    }
}

fn print_line(line: &dyn Display) -> Result<(), Failure> {
    let mut out = stdout().lock();
    writeln!(out, "{line}").and_then(|()| out.flush()).map_err(|error| Failure::stdout(&error))
}
