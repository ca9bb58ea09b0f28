//! `vergence calibrate extrinsics`: a pair.

use std::path::PathBuf;

use nalgebra::Matrix6;
use serde_json::{Value, json};
use vergence_calibration::{
    ExtrinsicsCalibration, ExtrinsicsOptions, RelativePose, StereoView, calibrate_extrinsics, validate_extrinsics,
};
use vergence_calibration_report::{ReportAbout, ReportImage, extrinsics_report, extrinsics_verdict};
use vergence_rig::Rig;
use vergence_vision::{Angle, KannalaBrandt, Length};

use super::options::{
    KnownLenses, LensOptions, ResultOptions, check_fit, check_held_out, held_out_json, tell_held_out, verdict_json,
};
use super::views::{PairPatterns, about, pairs_from_corners};
use crate::cmd::target_options::TargetOptions;
use crate::console::Console;
use crate::failure::Failure;
use crate::provenance::InputHash;
use crate::stopwatch::Stopwatch;

/// Calibrates a fixed pair: the pose of the right camera, from views of a target that both cameras see. The rig file that
/// it writes is for `vergence depth --rig`.
#[derive(Debug, clap::Args)]
pub struct Args {
    #[command(flatten)]
    lenses: LensOptions,
    #[command(flatten)]
    target: TargetOptions,
    /// Images of the left camera: files, patterns such as 'left*.jpg', or a folder. They pair with the right ones by the
    /// last number in their names, or in the order of their names.
    #[arg(long, num_args = 1.., required_unless_present = "csv", conflicts_with = "csv", requires = "right_images")]
    left_images: Vec<String>,
    /// Images of the right camera, as those of the left one.
    #[arg(long, num_args = 1.., requires = "left_images")]
    right_images: Vec<String>,
    /// Corners instead of images: a CSV file with the columns camera,file,frame,idx,x,y,bx_mm,by_mm. Rows of both cameras
    /// with the same frame number are a pair.
    #[arg(long, value_name = "FILE")]
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
    #[command(flatten)]
    result: ResultOptions,
}

pub fn run(args: &Args, console: Console) -> Result<(), Failure> {
    args.result.check()?;
    let mut hash = InputHash::default();
    let KnownLenses { left, right, shutters, knowledge } = args.lenses.read(&mut hash, console)?.ok_or_else(|| {
        Failure::usage("name the camera files with --left and --right: vergence calibrate intrinsics makes them")
    })?;
    let (views, images) = views(args, (&left, &right), &mut hash, console)?;
    let options = ExtrinsicsOptions { lenses: knowledge, robust: !args.no_loss };
    let solving = Stopwatch::start();
    let calibration = calibrate_extrinsics(&left, &right, &views, &options)
        .map_err(|error| Failure::usage(format!("no calibration: {error}")))?;
    let seconds = solving.seconds();
    check_fit(calibration.rms_inlier_px, calibration.corners_inlier, calibration.corners_total)?;
    let held_out = args
        .holdout
        .map(|parts| validate_extrinsics((&left, &right), &views, &options, &calibration, parts.into()))
        .transpose()
        .map_err(|error| Failure::check(format!("without the views held out there is no calibration: {error}")))?;
    held_out.as_ref().map_or(Ok(()), |held_out| check_held_out(held_out, calibration.rms_inlier_px))?;
    let verdict = extrinsics_verdict(&calibration, &views);
    let provenance = args.result.provenance(hash);
    let rig = Rig { shutters, ..rig(&calibration, &args.result.name("pair")) }
        .to_toml(&provenance)
        .map_err(Failure::check)?;
    args.result.write(&rig, || {
        let about = about(args.result.name("Pair"), &args.target, &provenance, None);
        extrinsics_report(&calibration, &views, &ReportAbout { held_out: held_out.clone(), images, ..about })
    })?;
    tell(&calibration, console)?;
    tell_held_out(held_out.as_ref(), console)?;
    console.say(&verdict.sentence)?;
    let mut result = in_json(&calibration, seconds);
    result["held_out"] = held_out_json(held_out.as_ref());
    result["verdict"] = verdict_json(&verdict);
    console.result(&result)
}

fn views(
    args: &Args,
    cameras: (&KannalaBrandt, &KannalaBrandt),
    hash: &mut InputHash,
    console: Console,
) -> Result<(Vec<StereoView>, [Vec<ReportImage>; 2]), Failure> {
    match &args.csv {
        Some(path) => {
            let frames = pairs_from_corners(path, &args.cameras, hash)?;
            Ok((frames.into_iter().map(|(_, view)| view).collect(), Default::default()))
        }
        None => {
            let images =
                PairPatterns { left: &args.left_images, right: &args.right_images, target: &args.target, cameras };
            images.views(hash, console)
        }
    }
}

fn rig(calibration: &ExtrinsicsCalibration, name: &str) -> Rig {
    let sigma = sigma(&calibration.scattered_covariance);
    let norm = |part: &[f64]| part.iter().map(|x| x * x).sum::<f64>().sqrt();
    Rig::fixed_pair(
        name,
        (calibration.left, calibration.right),
        calibration.joint.left_from_right,
        (Angle::from_rad(norm(&sigma[..3])), Length::from_mm(norm(&sigma[3..]))),
    )
}

/// Of the rotation in radians about the left axes, and of the position in millimetres.
fn sigma(covariance: &Matrix6<f64>) -> [f64; 6] {
    std::array::from_fn(|index| covariance[(index, index)].max(0.0).sqrt())
}

fn tell(calibration: &ExtrinsicsCalibration, console: Console) -> Result<(), Failure> {
    let line = |name: &str, pose: &RelativePose| {
        let (origin, turn) = (pose.left_from_right.origin().mm(), pose.left_from_right.rotation());
        format!(
            "{name}: baseline {:.3} mm, rotation {:.4}°, {:.3} px rms",
            origin.norm(),
            turn.angle().to_degrees(),
            pose.rms_px
        )
    };
    console.say(line("each camera alone", &calibration.arun))?;
    console.say(line("joint            ", &calibration.joint))?;
    let sigma = sigma(&calibration.scattered_covariance);
    let degrees: Vec<_> = sigma[..3].iter().map(|rad| format!("{:.4}", rad.to_degrees())).collect();
    let mm: Vec<_> = sigma[3..].iter().map(|mm| format!("{mm:.3}")).collect();
    console.say(format!("  sigma: rotation {} °, position {} mm", degrees.join(" "), mm.join(" ")))?;
    console.say(format!(
        "  {} of {} corners, {:.3} px rms without the outliers",
        calibration.corners_inlier, calibration.corners_total, calibration.rms_inlier_px
    ))?;
    for outlier in &calibration.outliers {
        console.say(format!(
            "  left out: {} camera, {}, corner at {:?} mm, {:.2} px off: {}",
            outlier.side, outlier.view, outlier.target_mm, outlier.error_px, outlier.reason
        ))?;
    }
    for skipped in &calibration.skipped {
        console.say(format!("  view not used: {} ({} camera: {})", skipped.view, skipped.side, skipped.reason))?;
    }
    Ok(())
}

fn in_json(calibration: &ExtrinsicsCalibration, seconds: f64) -> Value {
    let pose = |pose: &RelativePose| {
        json!({
            "baseline_mm": pose.left_from_right.origin().mm().norm(),
            "rotation_deg": pose.left_from_right.rotation().angle().to_degrees(),
            "rms_px": pose.rms_px,
        })
    };
    let mut joint = pose(&calibration.joint);
    let turn = calibration.joint.left_from_right.rotation().scaled_axis();
    joint["rms_inlier_px"] = json!(calibration.rms_inlier_px);
    joint["translation_mm"] = json!(calibration.joint.left_from_right.origin().mm().as_slice());
    joint["rotation_vector"] = json!(turn.as_slice());
    joint["sigma"] = json!(sigma(&calibration.covariance));
    joint["view_scatter"] = json!(calibration.view_scatter);
    // The vectors above are left_from_right; others, OpenCV among them, write the way back.
    let back = calibration.joint.left_from_right.inverse();
    joint["right_from_left"] = json!({
        "translation_mm": back.origin().mm().as_slice(),
        "rotation_vector": back.rotation().scaled_axis().as_slice(),
    });
    json!({
        "arun": pose(&calibration.arun),
        "joint": joint,
        "corners_total": calibration.corners_total,
        "corners_inlier": calibration.corners_inlier,
        "views_used": calibration.views.len(),
        "seconds": seconds,
    })
}
