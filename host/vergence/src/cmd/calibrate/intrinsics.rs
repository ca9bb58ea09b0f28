//! `vergence calibrate intrinsics`: one camera.

use std::path::PathBuf;

use vergence_calibration::{IntrinsicsOptions, LensModel, calibrate_intrinsics, check_fit, validate_intrinsics};
use vergence_calibration_input::{
    InputHash, Sought, camera_toml, document_of, named_images, views_in_corners, views_in_images,
};
use vergence_calibration_report::{
    ReportAbout, ReportImage, held_out_json, held_out_line, intrinsics_json, intrinsics_lines, intrinsics_report,
    intrinsics_verdict,
};
use vergence_rig::CameraMask;
use vergence_targets::{TargetView, corners_can_be_held};
use vergence_vision::{Angle, ImageSize};

use super::options::ResultOptions;
use super::print_views;
use crate::cmd::target_options::TargetOptions;
use crate::console::Console;
use crate::failure::Failure;
use crate::stopwatch::Stopwatch;
use vergence_plausibility::views::{axis_is_near_the_middle, corners_lie_in_image, views_differ};

/// Calibrates one camera from views of a target at different tilts, out to the rim of the image.
#[derive(Debug, clap::Args)]
pub struct Args {
    #[command(flatten)]
    target: TargetOptions,
    /// Images of the target: files, patterns such as 'left*.jpg', or folders.
    #[arg(long, num_args = 1.., required_unless_present = "csv", conflicts_with = "csv")]
    images: Vec<String>,
    /// What is left out of the images, as the robot's body, a hood, or all outside the image circle: a PNG image of the same size,
    /// black there, or a TOML file of polygons and circles. No corner is taken there.
    #[arg(long, value_name = "FILE", conflicts_with = "csv")]
    mask: Option<PathBuf>,
    /// Corners instead of images: a CSV file with the columns camera,file,frame,idx,x,y,bx_mm,by_mm.
    #[arg(long, value_name = "FILE", requires = "size")]
    csv: Option<PathBuf>,
    /// The camera whose corners are taken from the CSV file.
    #[arg(long, requires = "csv")]
    camera: Option<String>,
    /// Size of the images of the CSV file, such as 960x600.
    #[arg(long, requires = "csv")]
    size: Option<ImageSize>,
    /// Estimate how the target bows out of its plane, whatever the views say. Without this it counts as flat where they tell that it is.
    #[arg(long)]
    warp: bool,
    /// The lens: central, moving-pupil, full (with a pupil of two coefficients, decentring and thin prism), or by-evidence of the views.
    #[arg(long, value_name = "MODEL", default_value = "by-evidence")]
    lens_model: LensModel,
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

pub fn run(args: &Args, console: Console) -> Result<(), Failure> {
    args.result.check()?;
    let mut hash = InputHash::default();
    let Views { views, size, images } = views(args, &mut hash, console)?;
    let force = args.result.force;
    force.unless_forced(corners_can_be_held(&views).map_err(Failure::from), console)?;
    force.unless_forced(corners_lie_in_image(&views, size, "the camera"), console)?;
    force.unless_forced(views_differ(&views, "the camera"), console)?;
    let solving = Stopwatch::start();
    let options = IntrinsicsOptions { warp: args.warp, model: args.lens_model, ..IntrinsicsOptions::default() };
    let calibration = calibrate_intrinsics(&views, size, &options)
        .map_err(|error| Failure::usage(format!("no calibration: {error}")))?;
    let seconds = solving.seconds();
    check_fit(calibration.rms_inlier_px, calibration.corners_inlier, calibration.corners_total)?;
    force.unless_forced(axis_is_near_the_middle(&calibration.camera), console)?;
    let held_out = args
        .holdout
        .map(|parts| validate_intrinsics(&views, size, &options, &calibration, parts.into()))
        .transpose()
        .map_err(|error| Failure::check(format!("without the views held out there is no calibration: {error}")))?;
    held_out.as_ref().map_or(Ok(()), |held_out| held_out.check(calibration.rms_inlier_px))?;
    let verdict = intrinsics_verdict(&calibration, &views);
    let provenance = args.result.provenance(hash);
    args.result.write(&camera_toml(&document_of(&calibration, provenance.clone()))?, || {
        let title = args.result.name(args.camera.as_deref().unwrap_or("Camera"));
        let half_field = args.fov.map(|field| Angle::from_rad(0.5 * field.rad()));
        let about = ReportAbout::new(title, args.target.spec().ok().as_ref(), &provenance, half_field);
        intrinsics_report(
            &calibration,
            &views,
            &ReportAbout { held_out: held_out.clone(), images: [images, Vec::new()], ..about },
        )
    })?;
    console.say_lines(intrinsics_lines(&calibration, &views))?;
    console.say_lines(held_out_line(held_out.as_ref()))?;
    console.say(&verdict.sentence)?;
    let mut result = intrinsics_json(&calibration, seconds);
    result["held_out"] = held_out_json(held_out.as_ref());
    result["verdict"] = verdict.json();
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
            let views = views_in_corners(csv, args.camera.as_deref(), hash)?;
            Ok(Views { views, size, images: Vec::new() })
        }
        _ => {
            let files = named_images(&args.images)?;
            let target = args.target.checked_spec(args.result.force, console)?;
            let mask = args.mask.clone().map(CameraMask::File);
            let sought = Sought { target: &target, hint: None, placed: args.warp, mask: mask.as_ref() };
            let targets = views_in_images(&files, sought, hash, &mut print_views(console))?;
            Ok(Views { views: targets.found(), size: targets.size, images: targets.images })
        }
    }
}
