//! A recording of a whole rig: its board, its cameras and its trigger pulses.

use std::path::Path;

use vergence_board::{BoardKnowledge, HostClock};
use vergence_camera::CameraEvent;
use vergence_live::{LiveLoop, LiveResult};
use vergence_rig::{Provenance, Rig};
use vergence_vision::Side;

use crate::RecordingError;
use crate::event::Beginning;
use crate::link_gap::LinkGap;
use crate::recorder::{Recorded, Recorder, Writing};
use crate::tap::{recorded_events, recorded_marks};

/// What is recorded.
pub struct Recordable<'a> {
    /// The rig, whose file is attached.
    pub rig: &'a Rig,
    /// What of it is simulated, in words; `None` of a real one.
    pub simulated: Option<&'a str>,
    /// Its board; `None` of a rig without axes.
    pub board: Option<BoardKnowledge>,
    /// The clock of images and pulses.
    pub clock: HostClock,
    /// The time at which that clock started, in microseconds since 1970.
    pub epoch_us: u64,
    /// Time between pulses of the trigger in microseconds; `None` where the cameras run freely.
    pub period_us: Option<f64>,
}

/// A recording under way.
pub struct Recording {
    /// Takes what is heard and found.
    pub recorder: Recorder,
    pub(crate) clock: HostClock,
    writing: Writing,
    gap: LinkGap,
}

impl Recording {
    /// Begins a recording in `folder`, and listens to the board. Call within a tokio runtime.
    ///
    /// # Errors
    /// A folder that holds something, a file that cannot be written, a rig that no file can hold.
    pub fn start(folder: &Path, recordable: Recordable<'_>) -> Result<Self, RecordingError> {
        let Recordable { rig, simulated, board, clock, epoch_us, period_us } = recordable;
        let program = concat!("vergence ", env!("CARGO_PKG_VERSION")).to_owned();
        let provenance = Provenance { program, inputs_sha256: String::new(), date: None };
        let unwritten = |why| RecordingError::Write { file: folder.to_owned(), why };
        let file = rig.to_toml(&provenance).map_err(unwritten)?;
        let (recorder, writing) = Recorder::start(folder, (rig, &file), simulated, epoch_us)?;
        let baud = board.as_ref().and_then(BoardKnowledge::baud);
        recorder.begin(clock.now(), Beginning { has_board: board.is_some(), baud, period_us });
        let gap = LinkGap::default();
        if let Some(board) = board {
            let (recorder, gap) = (recorder.clone(), gap.clone());
            board.listen(move |news| {
                let now = clock.now();
                recorder.news(now, news);
                gap.note(now, news).into_iter().for_each(|sentence| recorder.warning(now, &sentence));
            });
        }
        Ok(Self { recorder, clock, writing, gap })
    }

    /// The live loop `live`, recorded. Call within a tokio runtime.
    #[must_use]
    pub fn of(&self, live: LiveLoop) -> LiveLoop {
        let clock = live.clock;
        let live = self.marks_of(live);
        LiveLoop { events: recorded_events(live.events, self.recorder.clone(), clock), ..live }
    }

    /// The live loop `live`, whose pulses are recorded; its cameras are by [`Self::cameras`]. Call within a tokio runtime.
    #[must_use]
    pub fn marks_of(&self, live: LiveLoop) -> LiveLoop {
        let clock = live.clock;
        LiveLoop { marks: live.marks.map(|marks| recorded_marks(marks, self.recorder.clone(), clock)), ..live }
    }

    /// Records events of the cameras where they pass, and returns the same.
    pub fn cameras(&self) -> impl FnMut(Side, CameraEvent) -> CameraEvent + Send + 'static {
        let (recorder, clock) = (self.recorder.clone(), self.clock);
        move |side, event| recorder.camera(clock.now(), side, event)
    }

    /// Records results of the live loop.
    pub fn results(&self) -> impl FnMut(&LiveResult<'_>) + 'static {
        let (recorder, clock) = (self.recorder.clone(), self.clock);
        move |result| recorder.result(clock.now(), result)
    }

    /// Ends the recording, and says what is in it.
    ///
    /// # Errors
    /// As [`Writing::finish`].
    pub async fn finish(self) -> Result<Recorded, RecordingError> {
        let without_link = self.gap.total(self.clock.now());
        Ok(Recorded { without_link, ..self.writing.finish(self.recorder).await? })
    }
}
