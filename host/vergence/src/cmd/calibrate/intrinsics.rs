//! `vergence calibrate intrinsics`: one camera.

use std::path::PathBuf;

use serde_json::{Value, json};
use vergence_calibration::{
    BoardView, IntrinsicsCalibration, IntrinsicsOptions, ReportAbout, calibrate_intrinsics, intrinsics_report,
    intrinsics_verdict, validate_intrinsics,
};
use vergence_rig::{CalibrationTable, CameraDocument, CameraTable};
use vergence_vision::{Angle, ImageSize, OpenCvFisheye};

use super::options::{ResultOptions, check_fit, check_held_out, held_out_json, tell_held_out, verdict_json};
use super::views::{about, from_corners, from_images, parse_size};
use crate::camera_files::toml_of;
use crate::cmd::board_options::BoardOptions;
use crate::console::Console;
use crate::failure::Failure;
use crate::provenance::InputHash;
use crate::stopwatch::Stopwatch;

/// Calibrates one camera from views of a chessboard at different tilts, out to the rim of the image.
#[derive(Debug, clap::Args)]
pub struct Args {
    #[command(flatten)]
    board: BoardOptions,
    /// Images of the board; patterns such as 'left*.jpg' are understood.
    #[arg(long, num_args = 1.., required_unless_present = "corners", conflicts_with = "corners")]
    images: Vec<String>,
    /// Corners instead of images: CSV with columns camera,file,frame,idx,x,y,bx_mm,by_mm.
    #[arg(long, value_name = "CSV", requires = "size")]
    corners: Option<PathBuf>,
    /// Which camera of the CSV file.
    #[arg(long, requires = "corners")]
    camera: Option<String>,
    /// Size of the images of the CSV file, such as 960x600.
    #[arg(long, value_parser = parse_size, requires = "corners")]
    size: Option<ImageSize>,
    /// Estimate how the board bows out of its plane, too.
    #[arg(long)]
    warp: bool,
    /// The whole field of the lens where its maker tells, such as 195.95deg: the report then measures coverage against it.
    #[arg(long, value_name = "ANGLE")]
    fov: Option<Angle>,
    /// Check on views that the calibration does not see: so many parts of the views are held out in turn.
    #[arg(long, value_name = "PARTS", value_parser = clap::value_parser!(u16).range(2..))]
    holdout: Option<u16>,
    #[command(flatten)]
    result: ResultOptions,
}

const NAMES: [&str; 8] = ["fx", "fy", "cx", "cy", "k1", "k2", "k3", "k4"];

pub fn run(args: &Args, console: Console) -> Result<(), Failure> {
    args.result.check()?;
    let mut hash = InputHash::default();
    let (views, size) = views(args, &mut hash, console)?;
    let solving = Stopwatch::start();
    let options = IntrinsicsOptions { warp: args.warp, ..IntrinsicsOptions::default() };
    let calibration = calibrate_intrinsics(&views, size, &options)
        .map_err(|error| Failure::usage(format!("no calibration: {error}")))?;
    let seconds = solving.seconds();
    check_fit(calibration.rms_inlier_px, calibration.corners_inlier, calibration.corners_total)?;
    let held_out = args
        .holdout
        .map(|parts| validate_intrinsics(&views, size, &options, &calibration, parts.into()))
        .transpose()
        .map_err(|error| Failure::check(format!("without the views held out there is no calibration: {error}")))?;
    held_out.as_ref().map_or(Ok(()), |held_out| check_held_out(held_out, calibration.rms_inlier_px))?;
    let verdict = intrinsics_verdict(&calibration, &views);
    let provenance = args.result.provenance(hash);
    let document = CameraDocument {
        camera: CameraTable::of(&calibration.camera),
        calibration: Some(CalibrationTable {
            rms_inlier_px: calibration.rms_inlier_px,
            corners: calibration.corners_inlier,
            views: calibration.views_used,
            covariance: std::array::from_fn(|row| std::array::from_fn(|column| calibration.covariance[(row, column)])),
        }),
        provenance: Some(provenance.clone()),
    };
    args.result.write(&toml_of(&document)?, || {
        let title = args.result.name(args.camera.as_deref().unwrap_or("Camera"));
        let half_field = args.fov.map(|field| Angle::from_rad(0.5 * field.rad()));
        let about = about(title, &args.board, &provenance, half_field);
        intrinsics_report(&calibration, &views, &ReportAbout { held_out: held_out.clone(), ..about })
    })?;
    tell(&calibration, &views, console)?;
    tell_held_out(held_out.as_ref(), console)?;
    console.say(&verdict.sentence)?;
    let mut result = in_json(&calibration, seconds);
    result["held_out"] = held_out_json(held_out.as_ref());
    result["verdict"] = verdict_json(&verdict);
    console.result(&result)
}

fn views(args: &Args, hash: &mut InputHash, console: Console) -> Result<(Vec<BoardView>, ImageSize), Failure> {
    match (&args.corners, args.size) {
        (Some(corners), Some(size)) => Ok((from_corners(corners, args.camera.as_deref(), hash)?, size)),
        _ => {
            let boards = from_images(&args.images, &args.board, None, hash, console)?;
            Ok((boards.found(), boards.size))
        }
    }
}

fn parameters(calibration: &IntrinsicsCalibration) -> [f64; 8] {
    let OpenCvFisheye { fx, fy, cx, cy, k: [k1, k2, k3, k4] } = calibration.opencv;
    [fx, fy, cx, cy, k1, k2, k3, k4]
}

fn sigma(calibration: &IntrinsicsCalibration) -> [f64; 8] {
    std::array::from_fn(|index| calibration.covariance[(index, index)].max(0.0).sqrt())
}

fn tell(calibration: &IntrinsicsCalibration, views: &[BoardView], console: Console) -> Result<(), Failure> {
    console.say(format!(
        "{} of {} corners in {} of {} views: {:.3} px rms ({:.3} px with the outliers), valid to {:.2} from the axis",
        calibration.corners_inlier,
        calibration.corners_total,
        calibration.views_used,
        views.len(),
        calibration.rms_inlier_px,
        calibration.rms_px,
        calibration.camera.theta_max()
    ))?;
    for ((name, value), sigma) in NAMES.iter().zip(parameters(calibration)).zip(sigma(calibration)) {
        console.say(format!("  {name} {value:12.5} ± {sigma:.5}"))?;
    }
    for outlier in &calibration.outliers {
        let name = views.get(outlier.view).map_or("", |view| &view.name);
        let residual = outlier.residual_px.map(|px| format!(" ({px:.2} px)")).unwrap_or_default();
        console.say(format!("  left out: corner {} of {name}, {}{residual}", outlier.corner, outlier.reason))?;
    }
    Ok(())
}

fn in_json(calibration: &IntrinsicsCalibration, seconds: f64) -> Value {
    let named = |values: [f64; 8]| -> Value {
        NAMES
            .iter()
            .zip(values)
            .map(|(name, value)| ((*name).to_owned(), json!(value)))
            .collect::<serde_json::Map<_, _>>()
            .into()
    };
    let views: Vec<_> = calibration
        .views
        .iter()
        .map(|view| {
            json!({
                "name": view.name,
                "corners": view.corners,
                "corners_inlier": view.corners_inlier,
                "rms_px": view.rms_px,
                "rms_inlier_px": view.rms_inlier_px,
            })
        })
        .collect();
    json!({
        "rms_px": calibration.rms_px,
        "rms_inlier_px": calibration.rms_inlier_px,
        "corners_total": calibration.corners_total,
        "corners_inlier": calibration.corners_inlier,
        "views_used": calibration.views_used,
        "theta_max_deg": calibration.camera.theta_max().deg(),
        "pixel_sigma": calibration.sigma0_px,
        "opencv": named(parameters(calibration)),
        "sigma": named(sigma(calibration)),
        "seconds": seconds,
        "views": views,
    })
}
