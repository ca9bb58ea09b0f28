//! What the rig says while it is recorded, turned into messages and written by a thread of its own.

use std::path::Path;
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Arc, LazyLock};

use image::RgbImage;
use tokio::sync::mpsc::{Receiver, Sender, channel, error::TrySendError};
use tokio::task::spawn_blocking;
use vergence_board::BoardNews;
use vergence_camera::{CameraError, CameraEvent, Develop, PendingImage};
use vergence_pipeline::PairCloud;
use vergence_protocol::{Microseconds, TriggerMark};
use vergence_rig::{Rig, RigPose};
use vergence_vision::Side;

use crate::RecordingError;
use crate::bag::{self, Bag};
use crate::event::{Beginning, Event, Eye, Stamp};
use crate::messages::{self, Grade, Health};
use crate::png::Png;

/// Number of entries that may wait for the disk: about a second of a bench with its poses.
const WAITING: usize = 1024;

/// An image that is made once, by whoever wants it first.
type Developed = Arc<LazyLock<Result<RgbImage, CameraError>, Develop>>;

/// An entry on its way to the disk.
enum Entry {
    Event(Microseconds, Event),
    Image(Microseconds, Eye, Stamp, Developed),
    Cloud(Microseconds, Box<(PairCloud, RigPose)>),
    Warning(Microseconds, String),
    End,
}

/// Takes what the live loop hears and finds. Clones write to the same recording. It never waits: what the disk has no time for is counted and
/// left out.
#[derive(Clone)]
pub struct Recorder {
    entries: Sender<Entry>,
    left_out: Arc<AtomicU64>,
}

/// What became of a recording.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Recorded {
    /// Number of images that were written.
    pub images: u64,
    /// Number of images, readings and clouds for which the disk had no time.
    pub left_out: u64,
}

/// The task that writes.
pub struct Writing(tokio::task::JoinHandle<Result<u64, RecordingError>>);

impl Recorder {
    /// Begins a recording of `rig` in `folder`; `epoch_us` is the time at which the host's clock started, in microseconds since 1970. Call within a
    /// tokio runtime.
    ///
    /// # Errors
    /// A folder that holds something, a file that cannot be written; a rig that no file can hold.
    pub fn start(folder: &Path, rig: &Rig, rig_file: &str, epoch_us: u64) -> Result<(Self, Writing), RecordingError> {
        let bag = Bag::create(folder, rig_file)?;
        let (entries, waiting) = channel(WAITING);
        let task = tokio::spawn(write(Scribe { bag, rig: rig.clone(), epoch_us, images: 0 }, waiting));
        Ok((Self { entries, left_out: Arc::default() }, Writing(task)))
    }

    /// Notes how the recording begins.
    pub fn begin(&self, now: Microseconds, beginning: Beginning) {
        self.put(Entry::Event(now, Event::Begun(beginning)));
    }

    /// Notes what the board said, heard at `now` on the host's clock.
    pub fn news(&self, now: Microseconds, news: &BoardNews) {
        let event = match news {
            BoardNews::Pose(pose) => Event::Pose(pose.clone()),
            BoardNews::ProbeSent => Event::ProbeSent,
            BoardNews::Exchange(exchange) => (*exchange).into(),
        };
        self.put(Entry::Event(now, event));
    }

    /// Notes a pulse of the camera trigger.
    pub fn pulse(&self, now: Microseconds, mark: &TriggerMark) {
        self.put(Entry::Event(now, Event::Pulse(mark.clone())));
    }

    /// Notes what a camera did, and returns the same event for the live loop. An image is developed once, for both.
    pub fn camera(&self, now: Microseconds, side: Side, event: CameraEvent) -> CameraEvent {
        let eye = Eye::from(side);
        match event {
            CameraEvent::Attached(timing) => {
                self.put(Entry::Event(now, Event::Attached(eye, timing.into())));
                CameraEvent::Attached(timing)
            }
            CameraEvent::Lost(why) => {
                self.put(Entry::Event(now, Event::Lost(eye, why.clone())));
                CameraEvent::Lost(why)
            }
            CameraEvent::Image(PendingImage { seq, middle, develop }) => {
                let developed: Developed = Arc::new(LazyLock::new(develop));
                let stamp = Stamp { seq, middle_us: middle.us, error_us: middle.error_us };
                self.put(Entry::Image(now, eye, stamp, Arc::clone(&developed)));
                CameraEvent::Image(PendingImage { seq, middle, develop: Box::new(move || (**developed).clone()) })
            }
        }
    }

    /// Notes a cloud of the pair that was exposed at `exposed` on the host's clock.
    pub fn cloud(&self, exposed: Microseconds, cloud: &PairCloud, pose: &RigPose) {
        self.put(Entry::Cloud(exposed, Box::new((cloud.clone(), pose.clone()))));
    }

    /// Notes a sentence for people.
    pub fn warning(&self, now: Microseconds, sentence: &str) {
        self.put(Entry::Warning(now, sentence.to_owned()));
    }

    fn put(&self, entry: Entry) {
        if let Err(TrySendError::Full(_)) = self.entries.try_send(entry) {
            self.left_out.fetch_add(1, Ordering::Relaxed);
        }
    }
}

impl Writing {
    /// Ends the recording that `recorder` writes to, and waits until everything is on the disk. What others note later is left out.
    ///
    /// # Errors
    /// [`RecordingError::Write`], [`RecordingError::DiskFull`]
    pub async fn finish(self, recorder: Recorder) -> Result<Recorded, RecordingError> {
        // Nobody listens where writing has failed; its error follows.
        let _ = recorder.entries.send(Entry::End).await;
        let images = self.0.await.map_err(unwritten)??;
        Ok(Recorded { images, left_out: recorder.left_out.load(Ordering::Relaxed) })
    }
}

/// What cannot become bytes, whatever the disk.
fn unwritten(error: impl std::fmt::Display) -> RecordingError {
    RecordingError::Write { file: Path::new(bag::FILE).to_owned(), why: error.to_string() }
}

/// Writes until the end.
async fn write(mut scribe: Scribe, mut waiting: Receiver<Entry>) -> Result<u64, RecordingError> {
    while let Some(entry) = waiting.recv().await.filter(|entry| !matches!(entry, Entry::End)) {
        // Coding an image takes a while; a simulated clock stands still meanwhile.
        let (back, outcome) = spawn_blocking(move || {
            let outcome = scribe.write(entry);
            (scribe, outcome)
        })
        .await
        .map_err(unwritten)?;
        scribe = back;
        outcome?;
    }
    let images = scribe.images;
    scribe.bag.finish()?;
    Ok(images)
}

/// Turns entries into messages.
struct Scribe {
    bag: Bag,
    rig: Rig,
    epoch_us: u64,
    images: u64,
}

impl Scribe {
    fn ns(&self, at: Microseconds) -> u64 {
        (self.epoch_us + at.0) * 1000
    }

    fn write(&mut self, entry: Entry) -> Result<(), RecordingError> {
        match entry {
            Entry::Event(now, event) => {
                if let Event::Pose(pose) = &event {
                    let at = self.ns(now);
                    self.bag.write(bag::JOINTS, at, &messages::joint_state(at, &self.rig.axes, pose))?;
                }
                self.event(now, &event)
            }
            Entry::Image(now, eye, stamp, developed) => match &**developed {
                Ok(image) => self.image(now, eye, stamp, image),
                // The live loop names it too.
                Err(error) => self.warning(now, &error.to_string()),
            },
            Entry::Cloud(exposed, measured) => {
                let ((cloud, pose), at) = (*measured, self.ns(exposed));
                self.bag.write(bag::TRANSFORMS, at, &messages::transforms(at, &pose))?;
                self.bag.write(bag::POINTS, at, &messages::cloud(at, &cloud))
            }
            Entry::Warning(now, sentence) => self.warning(now, &sentence),
            Entry::End => Ok(()),
        }
    }

    fn warning(&mut self, now: Microseconds, sentence: &str) -> Result<(), RecordingError> {
        let at = self.ns(now);
        let warning =
            Health { grade: Grade::Warning, name: "vergence", message: sentence.to_owned(), values: Vec::new() };
        self.bag.write(bag::DIAGNOSTICS, at, &messages::diagnostics(at, &[warning]))
    }

    fn event(&mut self, now: Microseconds, event: &Event) -> Result<(), RecordingError> {
        // Memory is the only limit of an event's encoding.
        let postcard = postcard::to_allocvec(event).map_err(unwritten)?;
        self.bag.write(bag::EVENTS, self.ns(now), &messages::event(now.0, &postcard))
    }

    fn image(&mut self, now: Microseconds, eye: Eye, stamp: Stamp, image: &RgbImage) -> Result<(), RecordingError> {
        let (image_topic, info_topic, lens) = match eye {
            Eye::Left => (bag::LEFT_IMAGE, bag::LEFT_INFO, &self.rig.left_camera),
            Eye::Right => (bag::RIGHT_IMAGE, bag::RIGHT_INFO, &self.rig.right_camera),
        };
        let at = self.ns(now);
        let exposed = (self.epoch_us * 1000).saturating_add((stamp.middle_us.max(0.0) * 1000.0) as u64);
        let info = messages::camera_info(exposed, eye, lens);
        self.bag.write(info_topic, at, &info)?;
        self.bag.write(image_topic, at, &messages::image(exposed, eye, &Png::of(image).map_err(unwritten)?))?;
        self.images += 1;
        self.event(now, &Event::Image(eye, stamp))
    }
}
