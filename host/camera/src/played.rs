//! Image files and videos played as cameras: each image comes when its time has come, and says when it was exposed.
//!
//! The files say how long after each other their images were taken, and never when encoders were read: the pose of a pair of them is that of a rig
//! without axes.

use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::thread;
use std::time::Duration;

use image::RgbImage;
use vergence_rig::{ExposureTiming, HostInstant};

use crate::files::{image_files, read_image};
use crate::pairing::{PairedFiles, last_number, paired, stamp};
use crate::y4m::Y4m;
use crate::{Camera, CameraError, CameraImage};

/// Time from opening the cameras to their first images: both are read by then.
const LEAD: Duration = Duration::from_millis(300);

/// Images that come later than this are skipped, or later than four are taken: so many wait in the buffers of a camera of the kernel.
const LATEST: Duration = Duration::from_millis(400);
/// Images of a second, where files are numbered and nobody says it.
pub const PLAYED_HZ: f64 = 10.0;
/// Images farther apart than this are not of one film: the unit of their time stamps is another than it seems.
const LONGEST_STEP: Duration = Duration::from_secs(60);

/// Tells the time on the host's clock, as time since the clock started.
pub type SharedTime = Arc<dyn Fn() -> Duration + Send + Sync>;

/// Whether `name`, as it stands on a command line, is a folder or a file that can be played, rather than a device.
#[must_use]
pub fn is_played(name: &str) -> bool {
    Path::new(name).metadata().is_ok_and(|found| found.is_dir() || found.is_file())
}

/// Where the images come from.
enum Source {
    /// Files, each with its time since the first image of the pair.
    Files(std::vec::IntoIter<(Duration, PathBuf)>),
    Video(Box<Y4m>),
}

/// Images of one camera, played at the pace at which they were taken.
pub struct PlayedCamera {
    source: Source,
    /// Shortest time from one image to the next.
    period: Duration,
    now: SharedTime,
    /// When the first image of both cameras is due, on the host's clock.
    start: Duration,
    seq: u32,
    missed: u64,
}

/// Cameras that are played, and the image files without a partner.
#[derive(Default)]
pub struct Played {
    /// One, or the left one and the right one.
    pub cameras: Vec<PlayedCamera>,
    /// Images that are left out.
    pub alone: Vec<PathBuf>,
}

impl Played {
    /// Opens one folder or video, or that of the left and that of the right camera, whose images then are taken together. The time of an image is its name
    /// where that is a time stamp; else its number, of which `rate` make a second. A video has its own rate, and both begin together.
    ///
    /// # Errors
    /// Files that are not images, that do not pair up, or whose names tell no time.
    pub fn open(paths: &[&Path], rate: f64, now: &SharedTime) -> Result<Self, CameraError> {
        let start = now() + LEAD;
        let camera = |source, period| PlayedCamera { source, period, now: Arc::clone(now), start, seq: 0, missed: 0 };
        if paths.iter().any(|path| Y4m::is_named(path)) {
            let videos = paths.iter().map(|path| Y4m::open(path)).collect::<Result<Vec<_>, _>>()?;
            if let [left, right] = videos.as_slice()
                && (left.rate() - right.rate()).abs() > 1e-3 * left.rate()
            {
                return Err(CameraError::Rates {
                    paths: [paths[0].into(), paths[1].into()],
                    rates: [left.rate(), right.rate()].map(|rate| rate.to_string()),
                });
            }
            let period = |video: &Y4m| Duration::from_secs_f64(1.0 / video.rate());
            let cameras = videos.into_iter().map(|video| (period(&video), video));
            let cameras = cameras.map(|(period, video)| camera(Source::Video(Box::new(video)), period)).collect();
            return Ok(Self { cameras, alone: Vec::new() });
        }
        let (lists, alone) = match paths {
            [left, right] => {
                let PairedFiles { pairs, alone } = paired(&image_files(left)?, &image_files(right)?)?;
                let (left, right): (Vec<_>, Vec<_>) = pairs.into_iter().map(|[left, right]| (left, right)).unzip();
                (vec![left, right], alone)
            }
            paths => (paths.iter().map(|path| image_files(path)).collect::<Result<Vec<_>, _>>()?, Vec::new()),
        };
        let mut timed = lists.iter().map(|files| times(files, rate)).collect::<Result<Vec<_>, _>>()?;
        let first = timed.iter().flatten().map(|(at, _)| *at).min().unwrap_or_default();
        timed.iter_mut().flatten().for_each(|(at, _)| *at -= first);
        let steps = timed.iter().flat_map(|files| files.windows(2).map(|pair| pair[1].0.saturating_sub(pair[0].0)));
        let period = steps.filter(|step| !step.is_zero()).min().unwrap_or(Duration::from_secs_f64(1.0 / rate));
        let cameras = timed.into_iter().map(|files| camera(Source::Files(files.into_iter()), period)).collect();
        Ok(Self { cameras, alone })
    }
}

/// The cameras that are played of one folder or video, or of two, as [`Played::open`] opens them.
///
/// # Errors
/// As there.
pub fn play(names: &[String], rate: f64, now: &SharedTime) -> Result<Vec<Box<dyn Camera>>, CameraError> {
    let paths: Vec<&Path> = names.iter().map(Path::new).collect();
    let cameras = Played::open(&paths, rate, now)?.cameras.into_iter();
    Ok(cameras.map(|camera| Box::new(camera) as Box<dyn Camera>).collect())
}

/// The files in the order of the times in their names, by time stamp or by number.
fn times(files: &[PathBuf], rate: f64) -> Result<Vec<(Duration, PathBuf)>, CameraError> {
    let by_number = |file: &Path| Duration::try_from_secs_f64(last_number(file)? as f64 / rate).ok();
    let of_all = |time: &dyn Fn(&Path) -> Option<Duration>| {
        files.iter().map(|file| Some((time(file)?, file.clone()))).collect::<Option<Vec<_>>>()
    };
    let only = |files: &[PathBuf]| matches!(files, [_]).then(|| vec![(Duration::ZERO, files[0].clone())]);
    let close = |timed: &Vec<(Duration, PathBuf)>| {
        let (first, last) = (timed.iter().min(), timed.iter().max());
        let span = first.zip(last).map(|(first, last)| last.0 - first.0);
        span.is_none_or(|span| span <= LONGEST_STEP * timed.len() as u32)
    };
    let stamped = of_all(&stamp);
    let timed = if stamped.is_some() { stamped.filter(close) } else { of_all(&by_number).filter(close) };
    let timed = timed.or_else(|| only(files));
    let mut timed = timed.ok_or_else(|| CameraError::Untimed(files.first().cloned().unwrap_or_default()))?;
    timed.sort();
    match timed.windows(2).find(|pair| pair[0].0 == pair[1].0) {
        Some(same) => Err(CameraError::SameTime([same[0].1.clone(), same[1].1.clone()])),
        None => Ok(timed),
    }
}

impl PlayedCamera {
    /// The next image with its time since the first; `None` after the last one. An image that is `late` is skipped unread.
    fn next(
        &mut self,
        late: impl Fn(Duration) -> bool,
    ) -> Result<Option<(Duration, String, Option<RgbImage>)>, CameraError> {
        match &mut self.source {
            Source::Files(files) => {
                let Some((at, path)) = files.next() else { return Ok(None) };
                let name = path.file_stem().unwrap_or_default().to_string_lossy().into_owned();
                let image = if late(at) { None } else { Some(read_image(&path)?) };
                Ok(Some((at, name, image)))
            }
            Source::Video(video) => {
                let at = self.period * self.seq;
                let Some(image) = video.next()? else { return Ok(None) };
                Ok(Some((at, format!("image{:06}", self.seq), Some(image).filter(|_| !late(at)))))
            }
        }
    }
}

impl Camera for PlayedCamera {
    fn grab(&mut self) -> Result<Option<CameraImage>, CameraError> {
        let (now, start) = (Arc::clone(&self.now), self.start);
        let patience = LATEST.min(4 * self.period);
        let late = |at: Duration| now() > start + at + patience;
        loop {
            let Some((at, name, image)) = self.next(late)? else { return Ok(None) };
            let seq = self.seq;
            self.seq += 1;
            // A camera does not wait for a computer that is too slow for its images.
            let Some(image) = image else {
                self.missed += 1;
                continue;
            };
            let due = start + at;
            while let Some(wait) = due.checked_sub(now()).filter(|wait| !wait.is_zero()) {
                thread::park_timeout(wait);
            }
            let exposed_at = Some(HostInstant { us: due.as_secs_f64() * 1e6, error_us: 0.0 });
            return Ok(Some(CameraImage { image, name, seq: Some(seq), exposed_at, bytes: None }));
        }
    }

    fn timing(&self) -> Option<ExposureTiming> {
        let zero = Duration::ZERO;
        Some(ExposureTiming { period: self.period, exposure: Some(zero), rolling: zero, readout: zero })
    }

    fn missed(&self) -> u64 {
        self.missed
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn named(names: &[&str], rate: f64) -> Result<Vec<(u128, String)>, CameraError> {
        let files: Vec<_> = names.iter().map(PathBuf::from).collect();
        let plain = |(at, path): (Duration, PathBuf)| (at.as_millis(), path.display().to_string());
        times(&files, rate).map(|timed| timed.into_iter().map(plain).collect())
    }

    #[test]
    fn time_stamps_and_numbers_give_the_times() {
        let listed = |list: &[(u128, &str)]| Ok(list.iter().map(|&(at, name)| (at, name.to_owned())).collect());
        assert_eq!(named(&["left10.png", "left9.png"], 5.0), listed(&[(1800, "left9.png"), (2000, "left10.png")]));
        assert_eq!(named(&["12.5.png", "12.75.png"], 5.0), listed(&[(12_500, "12.5.png"), (12_750, "12.75.png")]));
        // Nanoseconds, microseconds and milliseconds since 1970 are told by their length.
        for (stamp, ms) in [
            ("1403636579763555584.png", 1_403_636_579_763),
            ("1403636579763555.png", 1_403_636_579_763),
            ("1403636579763.png", 1_403_636_579_763),
        ] {
            assert_eq!(named(&[stamp], 5.0), listed(&[(ms, stamp)]));
        }
    }

    #[test]
    fn names_without_a_time_are_refused() {
        assert!(named(&["wall.png", "roof.png"], 5.0).expect_err("no time").to_string().contains("wall.png"));
        assert!(named(&["a1.png", "b1.png"], 5.0).expect_err("the same time").to_string().contains("b1.png"));
        // Nanoseconds since the start of a computer look like milliseconds since 1970, of images hours apart.
        assert!(named(&["5233123456789.png", "5233156456789.png"], 5.0).is_err());
        assert_eq!(named(&["wall.png"], 5.0), Ok(vec![(0, "wall.png".into())]));
    }

    /// A clock that the test turns: what is late is skipped, and counted.
    #[test]
    fn images_that_a_slow_computer_cannot_show_in_time_are_counted() {
        let folder = std::env::temp_dir().join(format!("vergence-played-{}", std::process::id()));
        std::fs::create_dir_all(&folder).expect("a folder");
        for number in 0..4 {
            RgbImage::from_pixel(2, 2, image::Rgb([number; 3]))
                .save(folder.join(format!("{number}.png")))
                .expect("saved");
        }
        let time = Arc::new(std::sync::Mutex::new(Duration::ZERO));
        let clock: SharedTime = {
            let time = Arc::clone(&time);
            Arc::new(move || *time.lock().expect("a clock"))
        };
        let mut camera = Played::open(&[&folder], 10.0, &clock).expect("a folder").cameras.remove(0);
        *time.lock().expect("a clock") = LEAD + Duration::from_millis(590);
        let taken = camera.grab().expect("images").expect("an image");
        let due = (LEAD + Duration::from_millis(200)).as_secs_f64() * 1e6;
        assert_eq!((taken.name.as_str(), taken.seq, camera.missed()), ("2", Some(2), 2));
        assert!((taken.exposed_at.expect("a time").us - due).abs() < 1.0);
        assert_eq!(taken.image.get_pixel(0, 0).0, [2; 3]);
        *time.lock().expect("a clock") = Duration::from_secs(2);
        assert!(camera.grab().expect("no error").is_none() && camera.missed() == 3);
        std::fs::remove_dir_all(&folder).expect("removed");
    }
}
