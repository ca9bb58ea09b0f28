//! Takes a set of target views with one camera or a pair, and says what it has and still needs.

use std::path::{Path, PathBuf};
use std::pin::pin;

use serde_json::{Value, json};
use vergence_calibration::{IntrinsicsOptions, calibrate_intrinsics, check_fit};
use vergence_calibration_report::intrinsics_verdict;
use vergence_camera::{Camera, CameraError, CameraImage, CameraSet};
use vergence_files::{make_folder, write_png};
use vergence_rig::Rig;
use vergence_scene::LensChoice;
use vergence_sim::{HeldTarget, TargetCamera};
use vergence_targets::{TargetKind, TargetView};
use vergence_vision::{BodyMask, ImageSize, Side};

use crate::target_watch::{NAMES, TargetWatch, look};
use crate::{InputError, printed};

/// A set of target views that is taken.
pub struct TargetCapture<'a> {
    /// Folder of the images. In a folder that has views already, more are added.
    pub folder: &'a Path,
    /// The target that is shown.
    pub target: TargetKind,
    /// Ends after this many views, complete or not.
    pub views: usize,
    /// Ends after this many images of each camera.
    pub images: u64,
}

/// What was seen at one instant.
pub struct Looked<'a> {
    /// The images, left before right.
    pub images: &'a [CameraImage],
    /// The set, with the views of these images.
    pub watch: &'a TargetWatch,
    /// Whether the target is held still.
    pub is_still: bool,
    /// Whether the images were added to the set.
    pub is_taken: bool,
}

/// What became of a set.
pub struct Captured {
    /// The set.
    pub watch: TargetWatch,
    /// Sizes of the images, left before right.
    pub sizes: Vec<ImageSize>,
    /// Number of images of each camera.
    pub images: u64,
    /// Number of images without a partner of the other camera.
    pub alone: u64,
    /// Number of images that were lost between the cameras and this program.
    pub missed: u64,
    /// Whether it was interrupted before it was complete.
    pub was_interrupted: bool,
}

impl TargetCapture<'_> {
    /// Takes images until the set is complete, has its views, or is interrupted. Every image of the set is written at once: whatever ends the
    /// capture, the views are kept. `masks` says what is left out of images of these sizes; `tell` is called with all that was seen.
    ///
    /// # Errors
    /// Those of the cameras and of the folder, of `masks` and of `tell`.
    pub async fn fill<E>(
        &self,
        mut cameras: CameraSet,
        masks: impl Fn([ImageSize; 2]) -> Result<[Option<BodyMask>; 2], E>,
        interruption: impl Future<Output = ()>,
        mut tell: impl FnMut(&Looked<'_>) -> Result<(), E>,
    ) -> Result<Captured, E>
    where
        E: From<InputError>,
    {
        make_folder(self.folder).map_err(InputError::from)?;
        let first = first_free(self.folder);
        let mut interruption = pin!(interruption);
        let watch = TargetWatch::new(Vec::new());
        let mut captured =
            Captured { watch, sizes: Vec::new(), images: 0, alone: 0, missed: 0, was_interrupted: false };
        while captured.watch.taken() < self.views && captured.images < self.images && !captured.watch.is_complete() {
            let (images, views);
            (cameras, images, views) = tokio::select! {
                looked = look(cameras, CameraSet::grab, self.target) => match looked {
                    // A folder or a video that was seen to its end.
                    Err(InputError::Camera(CameraError::Ended)) if captured.images > 0 => break,
                    looked => looked?,
                },
                () = &mut interruption => {
                    captured.was_interrupted = true;
                    break;
                }
            };
            if let (0, Some(left), Some(right)) = (captured.images, images.first(), images.last()) {
                captured.watch = TargetWatch::of_cameras(&images, masks([left.size(), right.size()])?);
                captured.sizes = images.iter().map(CameraImage::size).collect();
            }
            captured.images += 1;
            (captured.alone, captured.missed) = (cameras.alone(), cameras.missed());
            let watch = &mut captured.watch;
            let is_still = watch.observe(views);
            let is_taken = is_still && watch.is_news();
            if is_taken {
                for (image, name) in images.iter().zip(NAMES) {
                    write_png(&file_of(self.folder, name, first + watch.taken()), &image.image)
                        .map_err(InputError::from)?;
                }
                watch.take();
            }
            tell(&Looked { images: &images, watch, is_still, is_taken })?;
        }
        Ok(captured)
    }
}

/// Simulated cameras of `rig` in its mode `human`, before which a target is held: `both`, or the left one alone, with these lenses; `seed` is that of
/// the places and of the noise.
#[must_use]
pub fn held_before(
    rig: &Rig,
    target: &TargetKind,
    (both, seed, lens): (bool, u64, LensChoice),
) -> Vec<Box<dyn Camera>> {
    let targets = rig.mode("human").map(|mode| mode.targets.iter().map(|target| target.value()).collect::<Vec<_>>());
    let pose = rig.pose_at_values(&targets.unwrap_or_default());
    let right = (rig.right_camera, pose.left_from_right);
    let held = HeldTarget { left: rig.left_camera, right, both, target: printed(target), seed };
    let sides = if both { &[Side::Left, Side::Right][..] } else { &[Side::Left] };
    sides.iter().map(|&side| Box::new(TargetCamera::new(held, side).with_lens(lens)) as Box<dyn Camera>).collect()
}

impl Captured {
    /// What was captured into `folder`, for people.
    #[must_use]
    pub fn in_words(&self, folder: &Path) -> Vec<String> {
        let Self { watch, alone, missed, was_interrupted, .. } = self;
        let state = match (watch.is_complete(), was_interrupted) {
            (true, _) => "the set is complete",
            (false, true) => "interrupted: they are kept, and the same command adds to them",
            (false, false) => "the set is not complete",
        };
        let mut lines = vec![format!("{} views in {}; {state}", watch.taken(), folder.display())];
        if *alone > 0 {
            lines.push(format!("{alone} images had no partner of the other camera taken at the same time"));
        }
        if *missed > 0 {
            lines.push(format!("{missed} images were lost between the cameras and this program"));
        }
        lines
    }

    /// The same for programs.
    #[must_use]
    pub fn json(&self) -> Value {
        json!({
            "views": self.watch.taken(),
            "frames": self.images,
            "frames_alone": self.alone,
            "frames_missed": self.missed,
            "complete": self.watch.is_complete(),
            "interrupted": self.was_interrupted,
        })
    }

    /// A sentence for each camera: how well the views of this set calibrate its lens, or why they do not.
    #[must_use]
    pub fn verdicts(&self) -> Vec<String> {
        let verdict = |(number, size): (usize, &ImageSize)| {
            let views: Vec<TargetView> = self.watch.views_of(number).cloned().collect();
            let said = lens_verdict(&views, *size);
            match self.sizes.len() {
                0 | 1 => said,
                _ => format!("{} camera: {said}", NAMES[number.min(1)]),
            }
        };
        self.sizes.iter().enumerate().map(verdict).collect()
    }
}

fn lens_verdict(views: &[TargetView], size: ImageSize) -> String {
    let calibration = match calibrate_intrinsics(views, size, &IntrinsicsOptions::default()) {
        Ok(calibration) => calibration,
        Err(error) => return format!("no calibration: {error}"),
    };
    match check_fit(calibration.rms_inlier_px, calibration.corners_inlier, calibration.corners_total) {
        Ok(()) => intrinsics_verdict(&calibration, views).sentence,
        Err(error) => error.to_string(),
    }
}

fn file_of(folder: &Path, camera: &str, number: usize) -> PathBuf {
    folder.join(format!("{camera}{number:03}.png"))
}

/// The first number that no image in `folder` has.
fn first_free(folder: &Path) -> usize {
    let is_free = |number: &usize| NAMES.iter().all(|name| !file_of(folder, name, *number).exists());
    (0..).find(is_free).unwrap_or_default()
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used, reason = "a test may fail")]

    use std::sync::Arc;
    use std::sync::atomic::{AtomicBool, Ordering};
    use std::time::Duration;

    use tokio::sync::Notify;
    use vergence_rig::BENCH_TOML;
    use vergence_targets::TargetSpec;
    use vergence_vision::Length;

    use super::*;

    /// A time in which a camera sends nothing.
    #[derive(Default)]
    struct Silence {
        begun: Notify,
        is_over: AtomicBool,
    }

    /// Shows the same target some times, then is gone, after a silence where there is one.
    struct Ending {
        image: CameraImage,
        images_left: u32,
        silence: Option<Arc<Silence>>,
    }

    impl Camera for Ending {
        fn grab(&mut self) -> Result<Option<CameraImage>, CameraError> {
            if let Some(left) = self.images_left.checked_sub(1) {
                self.images_left = left;
                return Ok(Some(self.image.clone()));
            }
            if let Some(silence) = &self.silence {
                silence.begun.notify_one();
                std::thread::park_timeout(Duration::from_secs(3));
                silence.is_over.store(true, Ordering::SeqCst);
            }
            Err(CameraError::Vanished { device: "/dev/video0".into(), why: "no such device".into() })
        }
    }

    /// Captures into `folder` with a camera that ends after three images, and is interrupted in its silence. Returns the image that the camera
    /// shows, and the outcome.
    async fn capture_until_the_end(
        folder: &Path,
        silence: Option<Arc<Silence>>,
    ) -> (CameraImage, Result<Captured, InputError>) {
        let rig = Rig::from_toml(BENCH_TOML).unwrap().with_sensors(640).unwrap();
        let target = TargetKind::Chessboard(TargetSpec { columns: 9, rows: 6, square: Length::from_mm(20.0) });
        let nowhere = rig.pose_at_values(&[0.0, 0.0]).left_from_right;
        let held = HeldTarget {
            left: rig.left_camera,
            right: (rig.right_camera, nowhere),
            both: false,
            target: printed(&target),
            seed: 1,
        };
        let image = TargetCamera::new(held, Side::Left).grab().unwrap().unwrap();
        let camera = Ending { image: image.clone(), images_left: 3, silence: silence.clone() };
        let interruption = async {
            match silence {
                Some(silence) => silence.begun.notified().await,
                None => std::future::pending().await,
            }
        };
        let capture = TargetCapture { folder, target, views: 40, images: 100 };
        let cameras = CameraSet::new(vec![Box::new(camera)]);
        (image, capture.fill(cameras, |_| Ok([None, None]), interruption, |_| Ok(())).await)
    }

    #[tokio::test]
    async fn views_taken_before_a_camera_vanished_are_kept() {
        let folder = tempfile::tempdir().unwrap();
        let set = folder.path().join("set");
        let (image, outcome) = capture_until_the_end(&set, None).await;
        assert!(matches!(outcome, Err(InputError::Camera(CameraError::Vanished { .. }))));
        assert_eq!(image::open(set.join("left000.png")).unwrap().to_rgb8(), image.image);
    }

    /// An interruption does not wait for a camera that sends nothing, and the next capture overwrites nothing.
    #[tokio::test]
    async fn an_interrupted_capture_ends_at_once_and_goes_on_later() {
        let folder = tempfile::tempdir().unwrap();
        let set = folder.path().join("set");
        let silence = Arc::new(Silence::default());
        let (_, interrupted) = capture_until_the_end(&set, Some(Arc::clone(&silence))).await;
        assert!(interrupted.is_ok_and(|captured| captured.was_interrupted));
        assert!(!silence.is_over.load(Ordering::SeqCst));
        let first = std::fs::read(set.join("left000.png")).unwrap();
        assert!(capture_until_the_end(&set, None).await.1.is_err());
        assert_eq!(std::fs::read(set.join("left000.png")).unwrap(), first);
        assert!(set.join("left001.png").exists());
    }
}
