//! Takes what the rig says while it is recorded; a task writes it to the disk.

use std::io::{Seek, Write};
use std::path::Path;
use std::sync::{Arc, LazyLock};
use std::time::Duration;

use image::RgbImage;
use tokio::task::spawn_blocking;
use vergence_board::BoardNews;
use vergence_camera::{CameraError, CameraEvent, Develop, PendingImage};
use vergence_live::LiveResult;
use vergence_pipeline::{ColouredPoint, Observation, PairCloud};
use vergence_protocol::{Microseconds, TriggerMark};
use vergence_rig::{Rig, RigPose};
use vergence_vision::Side;

use crate::RecordingError;
use crate::bag::{self, Bag};
use crate::event::{Beginning, Event, Eye, Stamp};
use crate::queue::{LeftOut, MOST_BYTES, Queue, Weighed};
use crate::scribe::Scribe;

/// An entry on its way to the disk.
pub enum Entry {
    /// What the live loop heard.
    Event(Microseconds, Event),
    /// An image, whose event follows it in the recording.
    Image(Microseconds, Eye, Stamp, Developed),
    /// What was measured of an exposure at this time.
    Cloud(Microseconds, Box<(PairCloud, RigPose)>),
    /// A sentence for people.
    Warning(Microseconds, String),
}

/// An image that waits, with the size that it has or will have in memory.
#[derive(Clone)]
pub struct Developed {
    image: Arc<LazyLock<Result<RgbImage, CameraError>, Develop>>,
    bytes: usize,
}

impl Developed {
    /// The image, which is made now if nobody has made it yet.
    ///
    /// # Errors
    /// Those of its camera.
    pub fn get(&self) -> &Result<RgbImage, CameraError> {
        &self.image
    }
}

impl Weighed for Entry {
    fn bytes(&self) -> usize {
        size_of::<Self>()
            + match self {
                Self::Image(_, _, _, developed) => developed.bytes,
                Self::Cloud(_, measured) => measured.0.points.len() * size_of::<ColouredPoint>(),
                Self::Event(..) | Self::Warning(..) => 0,
            }
    }

    fn counter<'a>(&self, left_out: &'a mut LeftOut) -> Option<&'a mut u64> {
        match self {
            Self::Image(..) => Some(&mut left_out.images),
            Self::Cloud(..) => Some(&mut left_out.clouds),
            Self::Event(..) | Self::Warning(..) => None,
        }
    }
}

/// Takes what the live loop hears and finds. Clones write to the same recording. It never waits: images and clouds for which the disk has no
/// time are counted and left out; all else is kept.
#[derive(Clone)]
pub struct Recorder {
    queue: Queue<Entry>,
    /// Bytes of an image of each camera in memory.
    image_bytes: [usize; 2],
}

/// What became of a recording.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Recorded {
    /// Number of images that were written.
    pub images: u64,
    /// For how many images and clouds the disk had no time.
    pub left_out: LeftOut,
    /// For how long there was no link to the board.
    pub without_link: Duration,
}

impl Recorded {
    /// Sentences for people on what is missing.
    #[must_use]
    pub fn warnings(&self) -> Vec<String> {
        let seconds = self.without_link.as_secs_f64();
        let gap = (seconds > 0.0).then(|| {
            format!("encoder readings and pulses of {seconds:.1} s are missing: the link to the board was gone")
        });
        self.left_out.in_words().into_iter().chain(gap).collect()
    }
}

/// The task that writes.
pub struct Writing(tokio::task::JoinHandle<Result<u64, RecordingError>>);

impl Recorder {
    /// Begins a recording of `rig` in `folder`, of which `simulated` is simulated; `epoch_us` is the time at which the host's clock started, in
    /// microseconds since 1970. Call within a tokio runtime.
    ///
    /// # Errors
    /// A folder that holds something, a file that cannot be written; a rig that no file can hold.
    pub fn start(
        folder: &Path,
        (rig, rig_file): (&Rig, &str),
        simulated: Option<&str>,
        epoch_us: u64,
    ) -> Result<(Self, Writing), RecordingError> {
        Ok(Self::on(Bag::create(folder, rig_file, simulated)?, rig, epoch_us, MOST_BYTES))
    }

    /// Begins a recording of `rig` in `bag`; images and clouds of `most_bytes` in memory may wait for it.
    pub(crate) fn on<W: Write + Seek + Send + 'static>(
        bag: Bag<W>,
        rig: &Rig,
        epoch_us: u64,
        most_bytes: usize,
    ) -> (Self, Writing) {
        let queue = Queue::new(most_bytes);
        let task = tokio::spawn(write(Scribe::new(bag, rig.clone(), epoch_us), queue.clone()));
        let image_bytes = [&rig.left_camera, &rig.right_camera].map(|lens| {
            let size = lens.size();
            3 * size.width as usize * size.height as usize
        });
        (Self { queue, image_bytes }, Writing(task))
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
            BoardNews::LinkEnded => Event::LinkEnded,
            BoardNews::LinkBack => Event::LinkBack,
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
            CameraEvent::Image(PendingImage { seq, middle, bytes, develop }) => {
                // Developed once, by whoever wants it first.
                let (image, size) = (Arc::new(LazyLock::new(develop)), self.image_bytes[side.index()]);
                let developed = Developed { image, bytes: size };
                let stamp = Stamp { seq, middle_us: middle.us, error_us: middle.error_us };
                self.put(Entry::Image(now, eye, stamp, developed.clone()));
                let develop = Box::new(move || developed.get().clone());
                CameraEvent::Image(PendingImage { seq, middle, bytes, develop })
            }
        }
    }

    /// Notes a result of the live loop at `now` on the clock of its exposures: a cloud with its pose. Bearings are in the images.
    pub fn result(&self, now: Microseconds, result: &LiveResult<'_>) {
        if let Observation::Points { cloud, pose, .. } = &result.measurement.observation {
            let latency = u64::try_from(result.latency.as_micros()).unwrap_or(u64::MAX);
            let exposed = Microseconds(now.0.saturating_sub(latency));
            self.put(Entry::Cloud(exposed, Box::new((PairCloud::clone(cloud), RigPose::clone(pose)))));
        }
    }

    /// Notes a sentence for people.
    pub fn warning(&self, now: Microseconds, sentence: &str) {
        self.put(Entry::Warning(now, sentence.to_owned()));
    }

    /// A sentence where the disk became too slow, or writing failed: each is told once, and again at the end.
    #[must_use]
    pub fn take_trouble(&self) -> Option<String> {
        self.queue.take_trouble()
    }

    fn put(&self, entry: Entry) {
        self.queue.put(entry);
    }
}

impl Writing {
    /// Ends the recording that `recorder` writes to, and waits until everything is on the disk. What others note later is left out.
    ///
    /// # Errors
    /// [`RecordingError::Write`], [`RecordingError::DiskFull`]
    pub async fn finish(self, recorder: Recorder) -> Result<Recorded, RecordingError> {
        recorder.queue.close();
        let images = self.0.await.map_err(unwritten)??;
        Ok(Recorded { images, left_out: recorder.queue.left_out(), without_link: Duration::ZERO })
    }
}

/// What cannot become bytes, whatever the disk.
pub fn unwritten(error: impl std::fmt::Display) -> RecordingError {
    RecordingError::Write { file: Path::new(bag::FILE).to_owned(), why: error.to_string() }
}

/// Writes until the queue is closed. After an error, nothing waits for the disk any more.
async fn write<W: Write + Seek + Send + 'static>(
    mut scribe: Scribe<W>,
    queue: Queue<Entry>,
) -> Result<u64, RecordingError> {
    while queue.is_filled().await {
        // One thread writes all that waits. Then it ends: a simulated clock stands still as long as it works.
        let entries = queue.clone();
        let written = spawn_blocking(move || {
            let outcome = std::iter::from_fn(|| entries.take()).try_for_each(|entry| scribe.write(entry));
            (scribe, outcome)
        });
        let (back, outcome) = written.await.map_err(unwritten)?;
        scribe = back;
        if let Err(error) = outcome {
            queue.abandon(error.to_string());
            return Err(error);
        }
    }
    scribe.finish()
}

#[cfg(test)]
mod tests {
    #![allow(clippy::expect_used, reason = "a test may fail")]

    use std::fs::File;
    use std::io::{self, SeekFrom};
    use std::sync::{Condvar, Mutex};

    use vergence_protocol::{AxisList, Counts};
    use vergence_rig::{BENCH_TOML, HostInstant};

    use super::*;
    use crate::Reader;

    /// A disk that writes nothing before it is opened.
    #[derive(Clone, Default)]
    struct Gate(Arc<(Mutex<bool>, Condvar)>);

    impl Gate {
        fn open(&self) {
            *self.0.0.lock().expect("a lock") = true;
            self.0.1.notify_all();
        }

        fn pass(&self) {
            let is_open = self.0.0.lock().expect("a lock");
            drop(self.0.1.wait_while(is_open, |is_open| !*is_open).expect("a lock"));
        }
    }

    struct Slow(File, Gate);

    impl Write for Slow {
        fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
            self.1.pass();
            self.0.write(bytes)
        }

        fn flush(&mut self) -> io::Result<()> {
            self.0.flush()
        }
    }

    impl Seek for Slow {
        fn seek(&mut self, place: SeekFrom) -> io::Result<u64> {
            self.0.seek(place)
        }
    }

    fn small_rig() -> Rig {
        Rig::from_toml(BENCH_TOML).expect("the bench").with_sensors(320).expect("small cameras")
    }

    fn image(seq: u32) -> CameraEvent {
        // Noise, which no compression makes smaller: four images fill a chunk.
        let noise = |x: u32, y: u32| (x * 7919 + y * 104_729).wrapping_mul(2_654_435_761).to_be_bytes();
        let pixel = move |x, y| {
            let [red, green, blue, _] = noise(x, y);
            image::Rgb([red, green, blue])
        };
        let develop = Box::new(move || Ok(RgbImage::from_fn(320, 320, pixel)));
        let middle = HostInstant { us: 0.0, error_us: 0.0 };
        CameraEvent::Image(PendingImage { seq, middle, bytes: None, develop })
    }

    #[tokio::test]
    async fn a_slow_disk_costs_images_beyond_a_bounded_memory_and_no_pulse() {
        const PAIRS: u32 = 40;
        const ROOM: usize = 10 * 3 * 320 * 320;
        let folder = tempfile::tempdir().expect("a folder");
        let (file, gate) = (folder.path().join(bag::FILE), Gate::default());
        let slow = Slow(File::create(&file).expect("a file"), gate.clone());
        // The beginning of the file needs the disk.
        gate.open();
        let bag = Bag::on(slow, &file, BENCH_TOML).expect("a bag");
        *gate.0.0.lock().expect("a lock") = false;
        let (recorder, writing) = Recorder::on(bag, &small_rig(), 0, ROOM);
        for seq in 0..PAIRS {
            let at = Microseconds(u64::from(seq));
            let counts: AxisList<Counts> = AxisList::default();
            recorder.pulse(at, &TriggerMark { seq, at, counts });
            for side in [Side::Left, Side::Right] {
                drop(recorder.camera(at, side, image(seq)));
            }
            tokio::task::yield_now().await;
        }
        let left_out = recorder.queue.left_out().images;
        gate.open();
        let recorded = writing.finish(recorder).await.expect("it is written");
        assert_eq!(recorded.left_out, LeftOut { images: left_out, clouds: 0 });
        assert_eq!(recorded.images + left_out, u64::from(2 * PAIRS), "every image is written or counted");
        // Those of the room, and of the chunk that stood before the disk.
        assert!((8..=15).contains(&recorded.images), "{recorded:?}");

        let (mut reader, mut pulses, mut images) = (Reader::open(&file).expect("a recording"), 0, [0_u32; 2]);
        while let Some(heard) = reader.next_event().expect("an event") {
            match heard.event {
                Event::Pulse(mark) => {
                    assert_eq!(mark.seq, pulses, "a pulse is missing");
                    pulses += 1;
                }
                Event::Image(eye, _) => images[eye.side().index()] += 1,
                _ => {}
            }
        }
        assert_eq!((pulses, u64::from(images[0] + images[1])), (PAIRS, recorded.images));
        assert!(images[0].abs_diff(images[1]) <= 2, "pairs are kept, not images of one camera: {images:?}");
        assert!(recorded.left_out.in_words().is_some_and(|said| said.contains("readings and pulses are")));
    }
}
