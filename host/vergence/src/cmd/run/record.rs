//! What `vergence run --record` adds: a recording beside the measuring.

use std::path::Path;

use vergence_board::BoardKnowledge;
use vergence_live::LiveLoop;
use vergence_recording::{Beginning, Recorder, Writing, recorded_events, recorded_marks};
use vergence_rig::Provenance;

use crate::cmd::live_options::LiveRig;
use crate::console::Console;
use crate::failure::Failure;
use crate::stopwatch::started_us;

/// A recording under way.
pub struct Recording {
    /// Takes what is heard and found.
    pub recorder: Recorder,
    writing: Writing,
}

impl Recording {
    /// Begins a recording of `rig` in `folder`, and listens to its board.
    ///
    /// # Errors
    /// A folder that holds something, a file that cannot be written.
    pub fn start(folder: &Path, rig: &LiveRig) -> Result<Self, Failure> {
        let program = concat!("vergence ", env!("CARGO_PKG_VERSION")).to_owned();
        let provenance = Provenance { program, inputs_sha256: String::new(), date: None };
        let (known, clock) = (&rig.known, rig.clock);
        let file = known.to_toml(&provenance).map_err(Failure::usage)?;
        let (recorder, writing) = Recorder::start(folder, known, &file, started_us(clock))?;
        let knowledge = rig.board.as_ref().map(|board| board.client().knowledge());
        let baud = knowledge.as_ref().and_then(BoardKnowledge::baud);
        recorder.begin(clock.now(), Beginning { has_board: knowledge.is_some(), baud, period_us: rig.period_us });
        if let Some(knowledge) = knowledge {
            let recorder = recorder.clone();
            knowledge.listen(move |news| recorder.news(clock.now(), news));
        }
        Ok(Self { recorder, writing })
    }

    /// The live loop `live`, recorded.
    pub fn of(&self, live: LiveLoop) -> LiveLoop {
        let clock = live.clock;
        LiveLoop {
            events: recorded_events(live.events, self.recorder.clone(), clock),
            marks: live.marks.map(|marks| recorded_marks(marks, self.recorder.clone(), clock)),
            ..live
        }
    }

    /// Ends the recording, and says what is in it.
    ///
    /// # Errors
    /// A file that cannot be written.
    pub async fn finish(self, folder: &Path, console: Console) -> Result<(), Failure> {
        let recorded = self.writing.finish(self.recorder).await?;
        console.say(format!("recorded {} images in {}", recorded.images, folder.display()))?;
        if recorded.left_out > 0 {
            console.warn(format!(
                "the disk had no time for {} images, readings or clouds: record fewer frames (--rate), or on a faster disk",
                recorded.left_out
            ));
        }
        Ok(())
    }
}
