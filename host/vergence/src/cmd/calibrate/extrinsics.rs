//! `vergence calibrate extrinsics`: a pair.

use std::path::{Path, PathBuf};

use nalgebra::SMatrix;
use serde_json::{Value, json};
use vergence_calibration::{
    BoardView, ExtrinsicsCalibration, ExtrinsicsOptions, LensKnowledge, RelativePose, StereoView, calibrate_extrinsics,
    extrinsics_report,
};
use vergence_rig::Rig;
use vergence_vision::{Angle, KannalaBrandt, Length};

use super::views::{about, from_images};
use crate::camera_files::{self, CameraFile};
use crate::cmd::board_options::BoardOptions;
use crate::console::Console;
use crate::corners;
use crate::failure::Failure;
use crate::output::write_whole;
use crate::provenance::InputHash;
use crate::stopwatch::Stopwatch;

/// Calibrates the pose of the right camera from a board that both cameras see. The rig file that it writes is what
/// `vergence depth --rig` takes.
#[derive(Debug, clap::Args)]
pub struct Args {
    /// The left camera file.
    #[arg(long, value_name = "FILE")]
    left: PathBuf,
    /// The right camera file.
    #[arg(long, value_name = "FILE")]
    right: PathBuf,
    #[command(flatten)]
    board: BoardOptions,
    /// Images of the left camera; they pair with the right ones in the order of their names.
    #[arg(long, num_args = 1.., required_unless_present = "corners", conflicts_with = "corners", requires = "right_images")]
    left_images: Vec<String>,
    /// Images of the right camera.
    #[arg(long, num_args = 1.., requires = "left_images")]
    right_images: Vec<String>,
    /// Corners instead of images: CSV with columns camera,file,frame,idx,x,y,bx_mm,by_mm; frames pair the views.
    #[arg(long, value_name = "CSV")]
    corners: Option<PathBuf>,
    /// What the CSV file calls the left and the right camera.
    #[arg(long, num_args = 2, value_names = ["LEFT", "RIGHT"], default_values = ["left", "right"])]
    cameras: Vec<String>,
    /// What may change of the lenses: nothing, all of it as far as the covariance in the camera files allows, or all of it.
    #[arg(long, default_value = "exact")]
    lenses: Lenses,
    /// Least squares over all corners, without looking for gross errors.
    #[arg(long)]
    no_loss: bool,
    /// The rig file to write.
    #[arg(long, value_name = "FILE")]
    out: Option<PathBuf>,
    /// The report to write: one HTML page.
    #[arg(long, value_name = "FILE")]
    report: Option<PathBuf>,
    /// The date to keep with the calibration.
    #[arg(long)]
    date: Option<String>,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, clap::ValueEnum)]
enum Lenses {
    Exact,
    Known,
    Free,
}

pub fn run(args: &Args, console: Console) -> Result<(), Failure> {
    let mut hash = InputHash::default();
    let (left, right) = (camera(&args.left, &mut hash)?, camera(&args.right, &mut hash)?);
    let views = views(args, (&left.cameras.left, &right.cameras.left), &mut hash, console)?;
    let lenses = match args.lenses {
        Lenses::Exact => LensKnowledge::Exact,
        Lenses::Free => LensKnowledge::Free,
        Lenses::Known => LensKnowledge::within(covariance(&args.left, &left)?, covariance(&args.right, &right)?),
    };
    let options = ExtrinsicsOptions { lenses, robust: !args.no_loss };
    let solving = Stopwatch::start();
    let calibration = calibrate_extrinsics(&left.cameras.left, &right.cameras.left, &views, &options)
        .map_err(|error| Failure::usage(format!("no calibration: {error}")))?;
    let seconds = solving.seconds();
    let provenance = hash.provenance(args.date.as_deref());
    if let Some(path) = &args.report {
        let page = extrinsics_report(&calibration, &views, &about("Pair".into(), &args.board, &provenance));
        write_whole(path, page.as_bytes())?;
    }
    if let Some(path) = &args.out {
        let sigma = sigma(&calibration);
        let norm = |part: &[f64]| part.iter().map(|x| x * x).sum::<f64>().sqrt();
        let pair = Rig::fixed_pair(
            &path.file_stem().unwrap_or_default().to_string_lossy(),
            (calibration.left, calibration.right),
            calibration.joint.left_from_right,
            (Angle::from_rad(norm(&sigma[..3])), Length::from_mm(norm(&sigma[3..]))),
        );
        let text = pair.to_toml(&provenance).map_err(|error| Failure::output(path, error))?;
        write_whole(path, text.as_bytes())?;
    }
    tell(&calibration, console)?;
    console.result(&in_json(&calibration, seconds))
}

fn camera(path: &Path, hash: &mut InputHash) -> Result<CameraFile, Failure> {
    hash.add(path)?;
    camera_files::read(path)
}

fn covariance(path: &Path, file: &CameraFile) -> Result<SMatrix<f64, 8, 8>, Failure> {
    let table = file.document.as_ref().and_then(|document| document.calibration.as_ref());
    let table =
        table.ok_or_else(|| Failure::input(path, "it has no covariance: calibrate it here, or use --lenses exact"))?;
    Ok(SMatrix::from_fn(|row, column| table.covariance[row][column]))
}

fn views(
    args: &Args,
    (left, right): (&KannalaBrandt, &KannalaBrandt),
    hash: &mut InputHash,
    console: Console,
) -> Result<Vec<StereoView>, Failure> {
    if let Some(path) = &args.corners {
        hash.add(path)?;
        let [left, right] = args.cameras.as_slice() else { return Err(Failure::usage("--cameras needs two names")) };
        return Ok(pair_frames(corners::read(path, Some(left))?, &corners::read(path, Some(right))?));
    }
    let left = from_images(&args.left_images, &args.board, Some(left), hash, console)?;
    let right = from_images(&args.right_images, &args.board, Some(right), hash, console)?;
    if left.views.len() != right.views.len() {
        return Err(Failure::usage(format!(
            "{} left images and {} right ones: they must pair up",
            left.views.len(),
            right.views.len()
        )));
    }
    // A pair counts where both images show the board.
    let pairs = left.views.into_iter().zip(right.views);
    Ok(pairs.filter_map(|(left, right)| Some(stereo_view(left.ok()?, right.ok()?))).collect())
}

fn stereo_view(left: BoardView, right: BoardView) -> StereoView {
    StereoView { name: left.name.clone(), left, right }
}

/// The frames that both cameras have.
fn pair_frames(left: Vec<corners::FrameView>, right: &[corners::FrameView]) -> Vec<StereoView> {
    left.into_iter()
        .filter_map(|left| {
            let right = right.iter().find(|right| right.frame == left.frame)?;
            Some(stereo_view(left.view, right.view.clone()))
        })
        .collect()
}

/// Of the rotation in radians about the left axes, and of the position in millimetres.
fn sigma(calibration: &ExtrinsicsCalibration) -> [f64; 6] {
    std::array::from_fn(|index| calibration.covariance[(index, index)].max(0.0).sqrt())
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
    let sigma = sigma(calibration);
    let degrees: Vec<_> = sigma[..3].iter().map(|rad| format!("{:.4}", rad.to_degrees())).collect();
    let mm: Vec<_> = sigma[3..].iter().map(|mm| format!("{mm:.3}")).collect();
    console.say(format!("  sigma: rotation {} °, position {} mm", degrees.join(" "), mm.join(" ")))?;
    console.say(format!(
        "  {} of {} corners, {:.3} px rms without the gross ones",
        calibration.corners_inlier, calibration.corners_total, calibration.rms_inlier_px
    ))?;
    for outlier in &calibration.outliers {
        console.say(format!(
            "  left out: {:?} of {}, corner at {:?} mm, {:.2} px off ({:?})",
            outlier.side, outlier.view, outlier.board_mm, outlier.error_px, outlier.reason
        ))?;
    }
    for skipped in &calibration.skipped {
        console.say(format!("  view not used: {} ({:?} camera: {})", skipped.view, skipped.side, skipped.reason))?;
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
    joint["sigma"] = json!(sigma(calibration));
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
