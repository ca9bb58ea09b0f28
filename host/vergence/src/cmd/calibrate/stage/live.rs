//! `vergence calibrate stage --live`: the rig drives itself through the stage poses while a person holds the target.

use std::path::Path;
use std::sync::Arc;

use indicatif::ProgressBar;
use vergence_board::{Board, HostClock, Port, fresh_session};
use vergence_calibration::stage_plan;
use vergence_calibration_input::{LiveEvent, LiveSet, RigCameras, SimulatedTarget};
use vergence_camera::CameraError;
use vergence_panel::{CapturePanel, Setting};
use vergence_rig::Rig;
use vergence_scene::LensChoice;
use vergence_targets::TargetKind;

use crate::cli::CommonOptions;
use crate::cmd::camera_options::CameraOptions;
use crate::cmd::connect::{connect, port};
use crate::cmd::mask_options::MaskOptions;
use crate::cmd::panel_options::PanelOptions;
use crate::console::Console;
use crate::failure::Failure;
use crate::interrupt::interrupted;
use crate::rig_file;
use crate::sim::{SharedRig, board_of, built, simulated_rig};

/// Options of a rig that drives itself.
#[derive(Debug, clap::Args)]
pub struct Options {
    /// Drives the rig itself through the stage poses and takes the views.
    ///
    /// It homes the rig, moves it to poses far apart, and says at each where to show the target. A view counts where
    /// both cameras see the target held still, somewhere new. The views stay in the set, whatever ends the program.
    #[arg(long, requires = "set")]
    pub live: bool,
    /// With --live: number of stage poses.
    #[arg(long, default_value_t = 6, value_parser = clap::value_parser!(u16).range(3..=81))]
    poses: u16,
    /// With --live: number of views at each stage pose.
    #[arg(long, default_value_t = 12, value_parser = clap::value_parser!(u16).range(3..))]
    views: u16,
    /// With --live: give up after this many images at one stage pose.
    #[arg(long, default_value_t = 100_000)]
    frames: u64,
    /// With a simulated rig: seed of how it was really built, of the places of the target, and of the noise.
    #[arg(long, default_value_t = 1)]
    pub seed: u64,
    /// With simulated cameras: their lenses, ideal, sigma8_f18 or nikkor6_f28.
    #[arg(long, default_value_t)]
    lens: LensChoice,
    #[command(flatten)]
    camera: CameraOptions,
    #[command(flatten)]
    panel: PanelOptions,
}

impl Options {
    /// The page that shows how the views are taken, if one is wanted.
    pub fn panel(&self, drawn: &Rig, is_simulated: bool, console: Console) -> Result<Option<CapturePanel>, Failure> {
        if self.panel.panel.is_some() && !self.live {
            return Err(Failure::usage("--panel shows how views are taken: add --live"));
        }
        let simulated = is_simulated.then(|| format!("mechanics, target and cameras, lenses {}", self.lens));
        let setting = Setting { rig: Arc::new(drawn.clone()), simulated, has_cameras: true, recorded_ms: None };
        let mut panel = self.panel.serve(setting, console)?.map(CapturePanel::new);
        panel.iter_mut().for_each(|panel| panel.tell("the rig finds its reference and moves to the first pose: wait"));
        Ok(panel)
    }
}

/// Takes the views of the set `folder`. Returns the rig as it was really built where it is simulated.
///
/// # Errors
/// Those of the board and the cameras; a stage that does not stand still; an interruption.
pub async fn fill(
    folder: &Path,
    (options, masks): (&Options, &MaskOptions),
    cameras: &[String],
    target: TargetKind,
    common: &CommonOptions,
    (panel, console): (Option<&mut CapturePanel>, Console),
) -> Result<Option<Rig>, Failure> {
    LiveSet::check_free(folder)?;
    let nominal = rig_file::load(common.rig.as_deref())?;
    let masks = masks.read(&nominal)?;
    let (mut rig_board, mut rig_cameras) = open(options, cameras, &nominal, target, common, console).await?;
    let set = LiveSet { folder, target, nominal: &nominal, views: options.views.into(), images: options.frames, masks };
    let plan = stage_plan(&nominal.axes, options.poses.into());
    set.fill(&plan, &mut rig_board, &mut rig_cameras, interrupted(), print_events(panel, console)).await?;
    Ok(match rig_cameras {
        RigCameras::Simulated(simulated) => Some(simulated.built),
        RigCameras::Attached(_) => None,
    })
}

fn print_events(
    mut panel: Option<&mut CapturePanel>,
    console: Console,
) -> impl FnMut(LiveEvent<'_>) -> Result<(), Failure> {
    let mut progress: Option<ProgressBar> = None;
    move |event| {
        panel.iter_mut().for_each(|panel| panel.follow(&event));
        match event {
            LiveEvent::Looked(..) => {}
            LiveEvent::Begins(heading) => progress = Some(console.progress(heading)),
            LiveEvent::Advice(text) => {
                if let Some(progress) = &progress {
                    progress.set_message(text);
                    progress.tick();
                }
            }
            LiveEvent::Complete(sentence) => {
                _ = progress.take().map(|progress| progress.finish_and_clear());
                console.say(sentence)?;
            }
        }
        Ok(())
    }
}

/// Connects to the board and opens the cameras.
///
/// # Errors
/// Those of the board and the cameras; simulated cameras on a real rig, or the other way round.
async fn open(
    options: &Options,
    cameras: &[String],
    nominal: &Rig,
    target: TargetKind,
    common: &CommonOptions,
    console: Console,
) -> Result<(Board, RigCameras), Failure> {
    match (port(common)?, cameras) {
        (Port::Simulated(firmware), [only]) if only == "sim" => {
            options.camera.none_for_simulated()?;
            let (seed, built, lens) = (options.seed, built(nominal, options.seed), options.lens);
            let rig = SharedRig::new(simulated_rig(firmware.as_deref(), &built, seed)?);
            let (session, progress) = (fresh_session()?, console.progress("homing"));
            let board_of_rig = board_of(&rig, nominal.clone(), session, common.lease, progress).await?;
            console.say(format!("simulated cameras, lens: {}", options.lens))?;
            Ok((board_of_rig, RigCameras::Simulated(Box::new(SimulatedTarget { rig, built, target, lens, seed }))))
        }
        (Port::Simulated(_), _) => {
            Err(Failure::usage("a simulated rig has simulated cameras: use --port sim with --cameras sim"))
        }
        (_, [left, right]) => {
            let clock = HostClock::start();
            let attached = [left, right].map(|device| options.camera.open(device, clock, std::time::Duration::ZERO));
            let attached = attached.into_iter().collect::<Result<_, CameraError>>()?;
            Ok((connect(common, console, "homing").await?, RigCameras::Attached(attached)))
        }
        _ => Err(Failure::usage("name the left and the right camera: --cameras /dev/video0 /dev/video2")),
    }
}
