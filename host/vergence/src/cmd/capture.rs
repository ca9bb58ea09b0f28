//! `vergence capture`: a set of target views, with advice on what to show.

use std::net::SocketAddr;
use std::path::PathBuf;
use std::sync::Arc;

use serde_json::json;
use vergence_board::HostClock;
use vergence_calibration_input::{Captured, Looked, TargetCapture, printed};
use vergence_camera::{Camera, CameraError, CameraSet};
use vergence_panel::Setting;
use vergence_rig::Rig;
use vergence_scene::LensChoice;
use vergence_sim::{HeldTarget, TargetCamera};
use vergence_targets::TargetKind;
use vergence_vision::Side;

use super::camera_options::CameraOptions;
use super::capture_panel::CapturePanel;
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
    /// Serves a page that shows what the views cover, what to show next, and at the end how well they calibrate each lens; until Ctrl-C.
    #[arg(long, value_name = "ADDRESS", num_args = 0..=1, default_missing_value = "127.0.0.1:8088")]
    panel: Option<SocketAddr>,
    /// Lets other computers see that page, such as the telephone of who holds the target; they need the token in the address that is printed:
    /// --panel 0.0.0.0:8088 --network.
    #[arg(long, requires = "panel")]
    network: bool,
    #[command(flatten)]
    force: ForceOption,
}

pub async fn run(args: &Args, common: &CommonOptions, console: Console) -> Result<(), Failure> {
    let target = args.target.checked_spec(args.force, console)?;
    let rig = Arc::new(rig_file::load(common.rig.as_deref())?);
    let cameras = CameraSet::new(open(args, &rig, &target)?);
    let is_simulated = args.cameras == ["sim"];
    if is_simulated {
        console.say(format!("simulated cameras, lens: {}", args.lens))?;
    }
    let simulated = is_simulated.then(|| format!("target and cameras, lenses {}", args.lens));
    let setting = Setting { rig: Arc::clone(&rig), simulated, has_cameras: true };
    let serve = |address| CapturePanel::serve(setting, (address, args.network), console);
    let panel = args.panel.map(serve).transpose()?;
    capture(cameras, target, (args, &rig), panel, interrupted, console).await
}

async fn capture<I: Future<Output = ()>>(
    cameras: CameraSet,
    target: TargetKind,
    (args, rig): (&Args, &Rig),
    mut panel: Option<CapturePanel>,
    interruption: impl Fn() -> I,
    console: Console,
) -> Result<(), Failure> {
    let progress = console.progress("show the target");
    let wanted = TargetCapture { folder: &args.out, target, views: args.views, images: args.frames };
    let tell = |looked: &Looked<'_>| {
        let advice = looked.watch.advice().unwrap_or_else(|| "the set is complete".into());
        let taken = looked.watch.taken();
        progress.set_message(format!("{taken} views; {advice}"));
        progress.tick();
        if let Some(panel) = &mut panel {
            panel.show(looked, args.views);
        }
        match looked.is_taken {
            true => progress.suspend(|| console.say(format!("view {taken} taken; {advice}"))),
            false => Ok(()),
        }
    };
    let captured = wanted.fill(cameras, |sizes| args.masks.read_for(rig, sizes), interruption(), tell).await?;
    progress.finish_and_clear();
    report(&captured, args, console)?;
    match panel {
        Some(panel) if !captured.was_interrupted => panel.conclude(captured, interruption(), console).await,
        _ => Ok(()),
    }
}

fn report(captured: &Captured, args: &Args, console: Console) -> Result<(), Failure> {
    let Captured { watch, images, alone, missed, was_interrupted, .. } = captured;
    let complete = watch.is_complete();
    let state = match (complete, was_interrupted) {
        (true, _) => "the set is complete",
        (false, true) => "interrupted: they are kept, and the same command adds to them",
        (false, false) => "the set is not complete",
    };
    console.say(format!("{} views in {}; {state}", watch.taken(), args.out.display()))?;
    if *alone > 0 {
        console.say(format!("{alone} images had no partner of the other camera taken at the same time"))?;
    }
    if *missed > 0 {
        console.say(format!("{missed} images were lost between the cameras and this program"))?;
    }
    console.result(&json!({
        "views": watch.taken(),
        "frames": images,
        "frames_alone": alone,
        "frames_missed": missed,
        "lens": (args.cameras == ["sim"]).then(|| args.lens.to_string()),
        "complete": complete,
        "interrupted": was_interrupted,
        "out": args.out,
    }))
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

    use std::path::Path;
    use std::sync::atomic::{AtomicBool, Ordering};
    use std::time::Duration;

    use clap::Parser;
    use tokio::sync::Notify;
    use vergence_camera::CameraImage;

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
        let interruption = || async {
            match &silence {
                Some(silence) => silence.begun.notified().await,
                None => std::future::pending().await,
            }
        };
        let cameras = CameraSet::new(vec![Box::new(camera)]);
        (image, capture(cameras, target, (&args, &rig), None, interruption, Console::new(true)).await)
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
