//! `vergence calibrate extrinsics`: a pair.

use std::path::PathBuf;

use vergence_calibration::{ExtrinsicsOptions, calibrate_extrinsics, check_fit, validate_extrinsics};
use vergence_calibration_input::{InputHash, KnownLenses, PairImages, PairLenses, PairViews, pairs_in_corners};
use vergence_calibration_report::{
    ReportAbout, extrinsics_json, extrinsics_lines, extrinsics_report, extrinsics_verdict, fixed_pair, held_out_json,
    held_out_line, left_out_json,
};
use vergence_rig::Rig;
use vergence_targets::corners_can_be_held;

use super::options::{LensOptions, ResultOptions, VerdictPlaces};
use super::print_views;
use crate::cmd::mask_options::MaskOptions;
use crate::cmd::target_options::TargetOptions;
use crate::console::Console;
use crate::failure::Failure;
use crate::stopwatch::Stopwatch;
use vergence_plausibility::pose::{cameras_are_near, right_is_on_the_right};
use vergence_plausibility::views::views_of_pair;

/// Calibrates a fixed pair: the pose of the right camera, from views of a target that both cameras see. The rig file that
/// it writes is for `vergence depth --rig`.
#[derive(Debug, clap::Args)]
pub struct Args {
    #[command(flatten)]
    lenses: LensOptions,
    #[command(flatten)]
    target: TargetOptions,
    /// Images of the left camera: files, patterns such as 'left*.jpg', or a folder. They pair with the right ones by name
    /// (left007.png with right007.png), number or time stamp.
    #[arg(long, num_args = 1.., required_unless_present = "csv", conflicts_with = "csv", requires = "right_images")]
    left_images: Vec<String>,
    /// Images of the right camera, as those of the left one.
    #[arg(long, num_args = 1.., requires = "left_images")]
    right_images: Vec<String>,
    #[command(flatten)]
    masks: MaskOptions,
    /// Corners instead of images: a CSV file with the columns camera,file,frame,idx,x,y,bx_mm,by_mm. Rows of both cameras
    /// with the same frame number are a pair.
    #[arg(long, value_name = "FILE", conflicts_with_all = ["left_mask", "right_mask"])]
    csv: Option<PathBuf>,
    /// Names of the left and the right camera in the CSV file.
    #[arg(long, num_args = 2, value_names = ["LEFT", "RIGHT"], default_values = ["left", "right"])]
    cameras: Vec<String>,
    /// Fit all corners by least squares, without a search for outliers.
    #[arg(long)]
    no_loss: bool,
    /// Check against views that the calibration does not use: divide the views into this many parts and hold out each in
    /// turn.
    #[arg(long, value_name = "PARTS", value_parser = clap::value_parser!(u16).range(2..))]
    holdout: Option<u16>,
    /// Where the verdict is told: ranges from the middle of the cameras, directions from straight ahead (the right camera's
    /// side is positive), and the standard deviation of matches: "350mm,1m at -40deg,0deg,40deg with 0.1px".
    #[arg(long, value_name = "PLACES", default_value_t)]
    verdict: VerdictPlaces,
    #[command(flatten)]
    result: ResultOptions,
}

pub fn run(args: &Args, console: Console) -> Result<(), Failure> {
    args.result.check()?;
    let mut hash = InputHash::default();
    let KnownLenses { left, right, shutters, knowledge, .. } =
        args.lenses.read(&mut hash, console)?.ok_or_else(|| {
            Failure::usage("name the camera files with --left and --right: vergence calibrate intrinsics makes them")
        })?;
    let PairViews { views, left_out, images } = views(args, [&left, &right], &mut hash, console)?;
    let force = args.result.force;
    force.unless_forced(corners_can_be_held(views.iter().map(|view| &view.left)).map_err(Failure::from), console)?;
    force.unless_forced(views_of_pair(&views, [&left, &right]), console)?;
    let options = ExtrinsicsOptions { lenses: knowledge, robust: !args.no_loss };
    let solving = Stopwatch::start();
    let calibration = calibrate_extrinsics(&left, &right, &views, &options)
        .map_err(|error| Failure::usage(format!("no calibration: {error}")))?;
    let seconds = solving.seconds();
    check_fit(calibration.rms_inlier_px, calibration.corners_inlier, calibration.corners_total)?;
    force.unless_forced(cameras_are_near(&calibration.joint.left_from_right), console)?;
    force.unless_forced(right_is_on_the_right(&calibration.joint.left_from_right), console)?;
    let held_out = args
        .holdout
        .map(|parts| validate_extrinsics((&left, &right), &views, &options, &calibration, parts.into()))
        .transpose()
        .map_err(|error| Failure::check(format!("without the views held out there is no calibration: {error}")))?;
    held_out.as_ref().map_or(Ok(()), |held_out| held_out.check(calibration.rms_inlier_px))?;
    let verdict = extrinsics_verdict(&calibration, &args.verdict);
    let provenance = args.result.provenance(hash);
    let pair = fixed_pair(&calibration, &args.result.name("pair"));
    let rig = Rig { shutters, masks: args.masks.kept(&pair), ..pair }.to_toml(&provenance).map_err(Failure::check)?;
    args.result.write(&rig, || {
        let about = ReportAbout::new(args.result.name("Pair"), args.target.spec().ok().as_ref(), &provenance, None);
        extrinsics_report(
            &calibration,
            &views,
            &ReportAbout { held_out: held_out.clone(), images, ..about.of_rig(&args.verdict, &left_out) },
        )
    })?;
    console.say_lines(extrinsics_lines(&calibration))?;
    console.say_lines(held_out_line(held_out.as_ref()))?;
    console.say_lines(verdict.lines())?;
    let mut result = extrinsics_json(&calibration, seconds);
    result["held_out"] = held_out_json(held_out.as_ref());
    result["verdict"] = verdict.json();
    result["left_out"] = left_out_json(&left_out);
    console.result(&result)
}

fn views(args: &Args, lenses: PairLenses<'_>, hash: &mut InputHash, console: Console) -> Result<PairViews, Failure> {
    match &args.csv {
        Some(path) => {
            let frames = pairs_in_corners(path, &args.cameras, hash)?;
            Ok(PairViews { views: frames.into_iter().map(|(_, view)| view).collect(), ..PairViews::default() })
        }
        None => {
            let mut print = print_views(console);
            let images = PairImages::named([&args.left_images, &args.right_images], &mut print)?;
            images.views(
                &args.target.checked_spec(args.result.force, console)?,
                (lenses, args.masks.given()),
                hash,
                &mut print,
            )
        }
    }
}
