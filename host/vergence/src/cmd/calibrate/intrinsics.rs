//! `vergence calibrate intrinsics`: one camera.

use std::path::PathBuf;

use serde_json::{Value, json};
use vergence_calibration::{
    IntrinsicsCalibration, IntrinsicsOptions, TargetView, calibrate_intrinsics, validate_intrinsics,
};
use vergence_calibration_report::{ReportAbout, ReportImage, intrinsics_report, intrinsics_verdict};
use vergence_rig::{CalibrationTable, CameraDocument, CameraTable};
use vergence_vision::{Angle, ImageSize, OpenCvFisheye};

use super::options::{ResultOptions, check_fit, check_held_out, held_out_json, tell_held_out, verdict_json};
use super::views::{about, from_corners, from_images};
use crate::camera_files::toml_of;
use crate::cmd::camera_options::parse_size;
use crate::cmd::target_options::TargetOptions;
use crate::console::Console;
use crate::failure::Failure;
use crate::provenance::InputHash;
use crate::stopwatch::Stopwatch;
use crate::target_images::files;

/// Calibrates one camera from views of a target at different tilts, out to the rim of the image.
#[derive(Debug, clap::Args)]
pub struct Args {
    #[command(flatten)]
    target: TargetOptions,
    /// Images of the target: files, patterns such as 'left*.jpg', or folders.
    #[arg(long, num_args = 1.., required_unless_present = "csv", conflicts_with = "csv")]
    images: Vec<String>,
    /// Corners instead of images: a CSV file with the columns camera,file,frame,idx,x,y,bx_mm,by_mm.
    #[arg(long, value_name = "FILE", requires = "size")]
    csv: Option<PathBuf>,
    /// The camera whose corners are taken from the CSV file.
    #[arg(long, requires = "csv")]
    camera: Option<String>,
    /// Size of the images of the CSV file, such as 960x600.
    #[arg(long, value_parser = parse_size, requires = "csv")]
    size: Option<ImageSize>,
    /// Also estimate how the target bows out of its plane.
    #[arg(long)]
    warp: bool,
    /// Full field of view of the lens by its data sheet, such as 195.95deg: the report then measures coverage against it.
    #[arg(long, value_name = "ANGLE")]
    fov: Option<Angle>,
    /// Check against views that the calibration does not use: divide the views into this many parts and hold out each in
    /// turn.
    #[arg(long, value_name = "PARTS", value_parser = clap::value_parser!(u16).range(2..))]
    holdout: Option<u16>,
    #[command(flatten)]
    result: ResultOptions,
}

const NAMES: [&str; 8] = ["fx", "fy", "cx", "cy", "k1", "k2", "k3", "k4"];

pub fn run(args: &Args, console: Console) -> Result<(), Failure> {
    args.result.check()?;
    let mut hash = InputHash::default();
    let Views { views, size, images } = views(args, &mut hash, console)?;
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
        let about = about(title, &args.target, &provenance, half_field);
        intrinsics_report(
            &calibration,
            &views,
            &ReportAbout { held_out: held_out.clone(), images: [images, Vec::new()], ..about },
        )
    })?;
    tell(&calibration, &views, console)?;
    tell_held_out(held_out.as_ref(), console)?;
    console.say(&verdict.sentence)?;
    let mut result = in_json(&calibration, seconds);
    result["held_out"] = held_out_json(held_out.as_ref());
    result["verdict"] = verdict_json(&verdict);
    console.result(&result)
}

/// The views of a target, the size of their images, and the images, reduced for the report, where there are any.
struct Views {
    views: Vec<TargetView>,
    size: ImageSize,
    images: Vec<ReportImage>,
}

fn views(args: &Args, hash: &mut InputHash, console: Console) -> Result<Views, Failure> {
    match (&args.csv, args.size) {
        (Some(csv), Some(size)) => {
            let views = from_corners(csv, args.camera.as_deref(), hash)?;
            Ok(Views { views, size, images: Vec::new() })
        }
        _ => {
            let targets = from_images(&files(&args.images)?, &args.target, None, hash, console)?;
            Ok(Views { views: targets.found(), size: targets.size, images: targets.images })
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

fn tell(calibration: &IntrinsicsCalibration, views: &[TargetView], console: Console) -> Result<(), Failure> {
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
