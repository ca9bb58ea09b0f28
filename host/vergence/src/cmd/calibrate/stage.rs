//! `vergence calibrate stage`: cameras that move.

mod live;
mod trunk;

use std::path::PathBuf;

use vergence_calibration::{StageError, StageOptions, calibrate_stage, check_fit, validate_stage, with_enough_views};
use vergence_calibration_input::{InputHash, KnownLenses, RecordedSet, StageViews, TrueError, stage_poses_in_corners};
use vergence_calibration_report::{
    LeftOut, ReportAbout, left_out_json, stage_json, stage_lines, stage_report, stage_verdict,
};
use vergence_panel::CapturePanel;
use vergence_rig::Rig;
use vergence_targets::corners_can_be_held;

use super::options::{LensOptions, ResultOptions, VerdictPlaces};
use super::print_views;
use crate::cli::CommonOptions;
use crate::cmd::mask_options::MaskOptions;
use crate::cmd::panel_options::GOES_ON;
use crate::cmd::target_options::TargetOptions;
use crate::console::Console;
use crate::failure::{Failure, FailureKind};
use crate::interrupt::interrupted;
use crate::rig_file;
use crate::stopwatch::Stopwatch;
use vergence_plausibility::pose::{cameras_are_near, right_is_on_the_right};
use vergence_plausibility::views::views_of_pair;

/// Calibrates how the axes carry the cameras, from views at several stage poses; --rig names the nominal rig.
#[derive(Debug, clap::Args)]
#[group(id = "source", required = true, multiple = false, args = ["set", "csv"])]
pub struct Args {
    #[command(flatten)]
    lenses: LensOptions,
    #[command(flatten)]
    target: TargetOptions,
    /// A folder with the images and poses.csv; --live creates it.
    ///
    /// It has one folder for each stage pose, with images left000.png, right000.png and so on, as `vergence capture --out
    /// DIR/pose01` takes them. The columns of poses.csv are `folder` and, for every axis of the rig, its encoder reading,
    /// named after the axis: baseline_mm, separation_deg.
    #[arg(long, value_name = "DIR")]
    set: Option<PathBuf>,
    /// Corners and encoder readings instead of images, in a CSV file.
    ///
    /// The columns are camera,file,frame,idx,x,y,bx_mm,by_mm and, for every axis of the rig, its encoder reading, named
    /// after the axis: baseline_mm, separation_deg. Frame numbers count through the whole file. Rows of both cameras with
    /// the same number are a pair; pairs with the same readings are one stage pose.
    #[arg(long, value_name = "FILE", conflicts_with_all = ["left_mask", "right_mask"])]
    csv: Option<PathBuf>,
    /// The left and the right camera: their names in the CSV file (left right unless given), or with --live their devices,
    /// or sim.
    #[arg(long, num_args = 1..=2, value_name = "CAMERA")]
    cameras: Vec<String>,
    #[command(flatten)]
    masks: MaskOptions,
    #[command(flatten)]
    live: live::Options,
    /// Fit all corners by least squares, without a search for outliers.
    #[arg(long)]
    no_loss: bool,
    /// Check the calibration by leaving out one stage pose after the other; needs at least four.
    #[arg(long)]
    holdout: bool,
    /// Where the verdict is told: ranges from the middle of the cameras, directions from straight ahead (the right camera's
    /// side is positive), and the standard deviation of matches: "350mm,1m at -40deg,0deg,40deg with 0.1px".
    #[arg(long, value_name = "PLACES", default_value_t)]
    verdict: VerdictPlaces,
    #[command(flatten)]
    result: ResultOptions,
}

pub async fn run(args: &Args, common: &CommonOptions, console: Console) -> Result<(), Failure> {
    let drawn = rig_file::load(common.rig.as_deref())?;
    let mut panel = args.live.panel(&drawn, args.cameras == ["sim"], console)?;
    let calibrated = calibrate(args, common, panel.as_mut(), console).await;
    let shown = match &calibrated {
        Ok(verdict) => verdict.clone(),
        // The views do not calibrate the rig, which who took them wants to know.
        Err(failure) if failure.kind() == FailureKind::CheckFailed => vec![failure.to_string()],
        Err(_) => Vec::new(),
    };
    if let (Some(panel), false) = (&mut panel, shown.is_empty()) {
        panel.conclude(shown);
        console.say(GOES_ON)?;
        interrupted().await;
    }
    calibrated.map(drop)
}

/// Returns the verdict.
async fn calibrate(
    args: &Args,
    common: &CommonOptions,
    panel: Option<&mut CapturePanel>,
    console: Console,
) -> Result<Vec<String>, Failure> {
    args.result.check()?;
    let drawn = rig_file::load(common.rig.as_deref())?;
    if drawn.axes.is_empty() {
        return Err(Failure::usage(format!(
            "rig '{}' has no axes: 'vergence calibrate extrinsics' is for pairs whose pose is fixed",
            drawn.name
        )));
    }
    if drawn.trunk.is_some() && args.live.live {
        return Err(Failure::usage(format!(
            "rig '{}' has a trunk: no command drives it yet; record its views and readings, and name them with --set or --csv",
            drawn.name
        )));
    }
    let mut hash = InputHash::default();
    common.rig.iter().try_for_each(|path| hash.add(path))?;
    let (drawn, knowledge) = match args.lenses.read(&mut hash, console)? {
        Some(KnownLenses { left, right, shutters, knowledge, .. }) => {
            (Rig { left_camera: left, right_camera: right, shutters, ..drawn }, knowledge)
        }
        None => (drawn, args.lenses.without_files()?),
    };
    let built = live(args, common, (panel, console)).await?;
    let (poses, mut left_out) = poses(args, &drawn, &mut hash, console)?;
    let (poses, unseen) = with_enough_views(&drawn, poses);
    for (pose, reason) in unseen {
        let pose = LeftOut { view: format!("stage pose {pose}"), reason: reason.to_string() };
        console.warn(pose.to_string());
        left_out.push(pose);
    }
    let force = args.result.force;
    for pose in &poses {
        force.unless_forced(
            corners_can_be_held(pose.views.iter().map(|view| &view.left)).map_err(Failure::from),
            console,
        )?;
        force.unless_forced(views_of_pair(&pose.views, [&drawn.left_camera, &drawn.right_camera]), console)?;
    }
    let options = StageOptions { lenses: knowledge, robust: !args.no_loss, ..StageOptions::default() };
    if drawn.trunk.is_some() {
        return trunk::run(
            args,
            trunk::Input { drawn: &drawn, poses: &poses, left_out, options: &options },
            hash,
            console,
        )
        .map(|()| Vec::new());
    }
    let solving = Stopwatch::start();
    let stage = calibrate_stage(&drawn, &poses, &options).map_err(|error| no_calibration(&error))?;
    let seconds = solving.seconds();
    check_fit(stage.rms_inlier_px, stage.corners_inlier, stage.corners_total)?;
    if !stage.observability.never_moved.is_empty() {
        return Err(Failure::check(format!("{}", stage.observability)));
    }
    let held_out = match args.holdout {
        true => validate_stage(&drawn, &poses, &options)
            .map_err(|error| Failure::check(format!("without one stage pose there is no calibration: {error}")))?,
        false => Vec::new(),
    };
    let rig = Rig { name: args.result.name(&drawn.name), masks: args.masks.kept(&drawn), ..stage.rig(&drawn) };
    for pose in &poses {
        let values: Vec<f64> = pose.readings.iter().map(|reading| reading.value()).collect();
        let found = rig.pose_at_values(&values).left_from_right;
        force.unless_forced(cameras_are_near(&found).and_then(|()| right_is_on_the_right(&found)), console)?;
    }
    let verdict = stage_verdict(&stage, &rig, &args.verdict);
    let provenance = args.result.provenance(hash);
    args.result.write(&rig.to_toml(&provenance).map_err(Failure::check)?, || {
        let about = ReportAbout::new(rig.name.clone(), args.target.spec().ok().as_ref(), &provenance, None);
        stage_report(&stage, &rig, &held_out, &about.of_rig(&args.verdict, &left_out))
    })?;
    console.say_lines(stage_lines(&stage, &held_out))?;
    console.say_lines(verdict.lines())?;
    let mut result = stage_json(&rig, &stage, &held_out);
    result["seconds"] = seconds.into();
    result["verdict"] = verdict.json();
    result["left_out"] = left_out_json(&left_out);
    if let Some(built) = built {
        let truth = TrueError::of(&stage, &built, args.live.seed);
        console.say(truth)?;
        result["truth"] = truth.json();
    }
    console.result(&result)?;
    Ok(verdict.lines())
}

/// Takes the views of --live; returns the true rig where it is simulated.
async fn live(
    args: &Args,
    common: &CommonOptions,
    (panel, console): (Option<&mut CapturePanel>, Console),
) -> Result<Option<Rig>, Failure> {
    match (&args.set, args.live.live) {
        (Some(set), true) => {
            live::fill(
                set,
                (&args.live, &args.masks),
                &args.cameras,
                args.target.checked_spec(args.result.force, console)?,
                common,
                (panel, console),
            )
            .await
        }
        (None, true) => Err(Failure::usage("say where the images go: --live --set DIR")),
        (_, false) => Ok(None),
    }
}

fn poses(args: &Args, rig: &Rig, hash: &mut InputHash, console: Console) -> Result<StageViews, Failure> {
    match (&args.set, &args.csv) {
        (Some(set), _) => {
            let (set, lenses) = (RecordedSet::read(set, rig, hash)?, [&rig.left_camera, &rig.right_camera]);
            let target = args.target.checked_spec(args.result.force, console)?;
            set.stage_poses(&target, (lenses, args.masks.of(rig)), hash, &mut print_views(console))
        }
        (_, Some(csv)) => Ok((stage_poses_in_corners(csv, rig, &args.cameras, hash)?, Vec::new())),
        _ => Err(Failure::usage("name the views: --set DIR or --csv FILE")),
    }
}

/// Views that contradict the nominal rig are valid data with a result that fails; all else is wrong input.
fn no_calibration(error: &StageError) -> Failure {
    let message = format!("no calibration: {error}");
    match error {
        StageError::Diverged | StageError::Joint(_) | StageError::Unobservable(_) => Failure::check(message),
        _ => Failure::usage(message),
    }
}
