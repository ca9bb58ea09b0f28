//! `vergence capture`: a set of target views, with advice on what to show.

use std::path::{Path, PathBuf};
use std::pin::pin;

use serde_json::json;
use tokio::task::spawn_blocking;
use vergence_board::HostClock;
use vergence_calibration_input::{NAMES, TargetViews, TargetWatch, observe, printed};
use vergence_camera::{Camera, CameraError, CameraImage, CameraSet};
use vergence_files::{make_folder, write_png};
use vergence_rig::Rig;
use vergence_scene::LensChoice;
use vergence_sim::{HeldTarget, TargetCamera};
use vergence_targets::TargetKind;
use vergence_vision::Side;

use super::camera_options::CameraOptions;
use super::mask_options::MaskOptions;
use super::target_options::TargetOptions;
use crate::cli::CommonOptions;
use crate::cmd::force_option::ForceOption;
use crate::console::Console;
use crate::failure::Failure;
use crate::interrupt::interrupted;
use crate::rig_file;

/// Watches one camera or a pair, and keeps an image whenever a still target is seen where few views were. Every image is
/// written at once: whatever ends the capture, the views are kept. In a folder that has views already, more are added.
#[derive(Debug, clap::Args)]
pub struct Args {
    #[command(flatten)]
    target: TargetOptions,
    /// The cameras: one device such as /dev/video0, or left and right; or `sim` for simulated ones.
    #[arg(long, num_args = 1..=2, required = true, value_name = "DEVICE")]
    cameras: Vec<String>,
    /// The folder for the images: left000.png, right000.png and so on.
    #[arg(long, value_name = "DIR")]
    out: PathBuf,
    /// Stops after this many views, complete or not.
    #[arg(long, default_value_t = 40)]
    views: usize,
    /// Give up after this many images of each camera.
    #[arg(long, default_value_t = 100_000)]
    frames: u64,
    #[command(flatten)]
    masks: MaskOptions,
    #[command(flatten)]
    camera: CameraOptions,
    /// With simulated cameras: one camera instead of the pair in its human pose.
    #[arg(long)]
    mono: bool,
    /// With simulated cameras: seed of the places where the target is held, and of the noise.
    #[arg(long, default_value_t = 1)]
    seed: u64,
    /// With simulated cameras: their lenses, ideal, sigma8_f18 or nikkor6_f28.
    #[arg(long, default_value_t)]
    lens: LensChoice,
    #[command(flatten)]
    force: ForceOption,
}

pub async fn run(args: &Args, common: &CommonOptions, console: Console) -> Result<(), Failure> {
    let target = args.target.checked_spec(args.force, console)?;
    let rig = rig_file::load(common.rig.as_deref())?;
    let cameras = CameraSet::new(open(args, &rig, &target)?);
    if args.cameras == ["sim"] {
        console.say(format!("simulated cameras, lens: {}", args.lens))?;
    }
    capture(cameras, target, (args, &rig), interrupted(), console).await
}

/// Counts of a capture.
#[derive(Default)]
struct Counts {
    images: u64,
    alone: u64,
    missed: u64,
}

async fn capture(
    mut cameras: CameraSet,
    target: TargetKind,
    (args, rig): (&Args, &Rig),
    interruption: impl Future<Output = ()>,
    console: Console,
) -> Result<(), Failure> {
    make_folder(&args.out)?;
    let first = first_free(&args.out);
    let mut interruption = pin!(interruption);
    let mut watch = TargetWatch::new(Vec::new());
    let progress = console.progress("show the target");
    let advice = |watch: &TargetWatch| watch.advice().unwrap_or_else(|| "the set is complete".into());
    let mut counts = Counts::default();
    let mut was_interrupted = false;
    while watch.taken() < args.views && counts.images < args.frames && !watch.is_complete() {
        let (images, views);
        (cameras, images, views) = tokio::select! {
            looked = look(cameras, target) => looked?,
            () = &mut interruption => {
                was_interrupted = true;
                break;
            }
        };
        if let (0, Some(left), Some(right)) = (counts.images, images.first(), images.last()) {
            watch = TargetWatch::of_cameras(&images, args.masks.read_for(rig, [left.size(), right.size()])?);
        }
        counts = Counts { images: counts.images + 1, alone: cameras.alone(), missed: cameras.missed() };
        let is_wanted = watch.observe(views) && watch.is_news();
        if is_wanted {
            for (image, name) in images.iter().zip(NAMES) {
                write_png(&args.out.join(file_name(name, first + watch.taken())), &image.image)?;
            }
            watch.take();
        }
        progress.set_message(format!("{} views; {}", watch.taken(), advice(&watch)));
        progress.tick();
        if is_wanted {
            progress.suspend(|| console.say(format!("view {} taken; {}", watch.taken(), advice(&watch))))?;
        }
    }
    progress.finish_and_clear();
    report(&watch, &counts, was_interrupted, args, console)
}

/// Takes one image with each camera and looks for the target in them, on a thread of its own.
async fn look(
    mut cameras: CameraSet,
    target: TargetKind,
) -> Result<(CameraSet, Vec<CameraImage>, TargetViews), Failure> {
    let looked = spawn_blocking(move || {
        let images = cameras.grab()?;
        let views = observe(&images, &target);
        Ok((cameras, images, views))
    });
    looked.await.map_err(|error| Failure::device(format!("looking through the cameras failed: {error}")))?
}

fn report(
    watch: &TargetWatch,
    counts: &Counts,
    was_interrupted: bool,
    args: &Args,
    console: Console,
) -> Result<(), Failure> {
    let complete = watch.is_complete();
    let state = match (complete, was_interrupted) {
        (true, _) => "the set is complete",
        (false, true) => "interrupted: they are kept, and the same command adds to them",
        (false, false) => "the set is not complete",
    };
    console.say(format!("{} views in {}; {state}", watch.taken(), args.out.display()))?;
    if counts.alone > 0 {
        console.say(format!("{} images had no partner of the other camera taken at the same time", counts.alone))?;
    }
    if counts.missed > 0 {
        console.say(format!("{} images were lost between the cameras and this program", counts.missed))?;
    }
    console.result(&json!({
        "views": watch.taken(),
        "frames": counts.images,
        "frames_alone": counts.alone,
        "frames_missed": counts.missed,
        "lens": (args.cameras == ["sim"]).then(|| args.lens.to_string()),
        "complete": complete,
        "interrupted": was_interrupted,
        "out": args.out,
    }))
}

fn file_name(camera: &str, number: usize) -> String {
    format!("{camera}{number:03}.png")
}

/// The first number that no image in `folder` has.
fn first_free(folder: &Path) -> usize {
    let is_free = |number: &usize| NAMES.iter().all(|name| !folder.join(file_name(name, *number)).exists());
    (0..).find(is_free).unwrap_or_default()
}

fn open(args: &Args, rig: &Rig, target: &TargetKind) -> Result<Vec<Box<dyn Camera>>, Failure> {
    if args.cameras == ["sim"] {
        args.camera.none_for_simulated()?;
        return Ok(simulated(args, rig, target));
    }
    let clock = HostClock::start();
    Ok(args.cameras.iter().map(|device| args.camera.open(device, clock)).collect::<Result<_, CameraError>>()?)
}

fn simulated(args: &Args, rig: &Rig, target: &TargetKind) -> Vec<Box<dyn Camera>> {
    let targets = rig.mode("human").map(|mode| mode.targets.iter().map(|target| target.value()).collect::<Vec<_>>());
    let pose = rig.pose_at_values(&targets.unwrap_or_default());
    let held = HeldTarget {
        left: rig.left_camera,
        right: (rig.right_camera, pose.left_from_right),
        both: !args.mono,
        target: printed(target),
        seed: args.seed,
    };
    let sides = if args.mono { &[Side::Left][..] } else { &[Side::Left, Side::Right] };
    sides.iter().map(|&side| Box::new(TargetCamera::new(held, side).with_lens(args.lens)) as Box<dyn Camera>).collect()
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used, reason = "a test may fail")]

    use std::sync::Arc;
    use std::sync::atomic::{AtomicBool, Ordering};
    use std::time::Duration;

    use clap::Parser;
    use tokio::sync::Notify;

    use super::*;
    use crate::rig_file::bench_with_sensors;

    #[derive(Parser)]
    struct Line {
        #[command(flatten)]
        args: Args,
    }

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

    /// Captures into `out` with a camera that ends after three images, and is interrupted in its silence. Returns the image
    /// that the camera shows, and the outcome.
    async fn capture_until_the_end(out: &Path, silence: Option<Arc<Silence>>) -> (CameraImage, Result<(), Failure>) {
        let rig = bench_with_sensors(640).unwrap();
        let command = ["capture", "--corners", "9x6", "--square", "20mm", "--cameras", "/dev/video0", "--out"];
        let Line { args } = Line::parse_from(command.into_iter().map(Into::into).chain([out.as_os_str().to_owned()]));
        let target = args.target.spec().unwrap();
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
        let cameras = CameraSet::new(vec![Box::new(camera)]);
        (image, capture(cameras, target, (&args, &rig), interruption, Console::new(true)).await)
    }

    #[tokio::test]
    async fn views_taken_before_a_camera_vanished_are_kept() {
        let folder = tempfile::tempdir().unwrap();
        let out = folder.path().join("set");
        let (image, outcome) = capture_until_the_end(&out, None).await;
        let failure = outcome.unwrap_err();
        assert_eq!(failure.kind().exit_code(), 3);
        assert!(failure.to_string().contains("vanished"));
        assert_eq!(image::open(out.join("left000.png")).unwrap().to_rgb8(), image.image);
    }

    /// An interruption does not wait for a camera that sends nothing, and the next capture overwrites nothing.
    #[tokio::test]
    async fn an_interrupted_capture_ends_at_once_and_goes_on_later() {
        let folder = tempfile::tempdir().unwrap();
        let out = folder.path().join("set");
        let silence = Arc::new(Silence::default());
        capture_until_the_end(&out, Some(Arc::clone(&silence))).await.1.unwrap();
        assert!(!silence.is_over.load(Ordering::SeqCst));
        let first = std::fs::read(out.join("left000.png")).unwrap();
        capture_until_the_end(&out, None).await.1.unwrap_err();
        assert_eq!(std::fs::read(out.join("left000.png")).unwrap(), first);
        assert!(out.join("left001.png").exists());
    }
}
