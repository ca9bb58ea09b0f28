//! `vergence capture`: a set of target views, with advice on what to show.

use std::path::PathBuf;
use std::sync::Arc;
use std::time::Duration;

use serde_json::json;
use vergence_board::HostClock;
use vergence_calibration_input::{Captured, Looked, TargetCapture, held_before};
use vergence_camera::{Camera, CameraError, CameraSet, PLAYED_HZ, SharedTime, is_played, play};
use vergence_panel::{CapturePanel, Setting};
use vergence_rig::Rig;
use vergence_scene::LensChoice;
use vergence_targets::TargetKind;

use super::camera_options::CameraOptions;
use super::mask_options::MaskOptions;
use super::panel_options::{GOES_ON, PanelOptions};
use super::target_options::TargetOptions;
use crate::cli::CommonOptions;
use crate::cmd::force_option::ForceOption;
use crate::console::Console;
use crate::failure::Failure;
use crate::interrupt::{interrupted, on_own_thread};
use crate::rig_file;

/// Watches one camera or a pair, and keeps an image whenever a still target is seen where few views were. Every image is
/// written at once: whatever ends the capture, the views are kept. In a folder that has views already, more are added.
#[derive(Debug, clap::Args)]
pub struct Args {
    #[command(flatten)]
    target: TargetOptions,
    /// The cameras: one device such as /dev/video0, or left and right; folders of images or Y4M videos; or `sim` for simulated ones.
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
    panel: PanelOptions,
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
    let setting = Setting { rig: Arc::clone(&rig), simulated, has_cameras: true, recorded_ms: None };
    let panel = args.panel.serve(setting, console)?.map(CapturePanel::new);
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
            panel.look(looked, args.views);
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
        Some(mut panel) if !captured.was_interrupted => {
            let verdicts = on_own_thread(move || Ok(captured.verdicts())).await?;
            console.say_lines(verdicts.clone())?;
            panel.conclude(verdicts);
            console.say(GOES_ON)?;
            interruption().await;
            Ok(())
        }
        _ => Ok(()),
    }
}

fn report(captured: &Captured, args: &Args, console: Console) -> Result<(), Failure> {
    console.say_lines(captured.in_words(&args.out))?;
    let mut result = captured.json();
    result["lens"] = json!((args.cameras == ["sim"]).then(|| args.lens.to_string()));
    result["out"] = json!(args.out);
    console.result(&result)
}

fn open(args: &Args, rig: &Rig, target: &TargetKind) -> Result<Vec<Box<dyn Camera>>, Failure> {
    if args.cameras == ["sim"] {
        args.camera.none_for_simulated()?;
        return Ok(held_before(rig, target, (!args.mono, args.seed, args.lens)));
    }
    let clock = HostClock::start();
    if args.cameras.iter().any(|name| is_played(name)) {
        args.camera.none_for_simulated()?;
        let now: SharedTime = Arc::new(move || Duration::from_micros(clock.now().0));
        return Ok(play(&args.cameras, PLAYED_HZ, &now)?);
    }
    let open = |device: &String| args.camera.open(device, clock, Duration::ZERO);
    Ok(args.cameras.iter().map(open).collect::<Result<_, CameraError>>()?)
}
