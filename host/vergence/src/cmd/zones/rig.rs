//! The zones of a rig file's own cameras: real lenses, any pose, and what the robot's body hides.

use std::path::{Path, PathBuf};

use serde_json::json;
use vergence_rig::{Rig, RigPose};
use vergence_vision::{
    Angle, Base, BodyMask, Camera, ImageSize, KannalaBrandt, Length, PlacedCamera, PlanarCamera, Point, Transform,
    Zones, circle_zones, solid_zones,
};

use super::{Args, in_words};
use crate::cli::Globals;
use crate::cmd::report::{rounded, zones_json};
use crate::console::Console;
use crate::failure::Failure;
use crate::output::{ZonesOf, write_whole, zones_plot, zones_svg};
use crate::rig_file;

/// Which rig, and what hides its view.
#[derive(Debug, clap::Args)]
pub struct RigOptions {
    /// A mode of the rig file.
    #[arg(long, value_name = "MODE")]
    mode: Option<String>,
    /// Where the left image shows the robot itself: an image of the camera's size, black where the body is.
    #[arg(long, value_name = "IMAGE", requires = "mode")]
    left_mask: Option<PathBuf>,
    /// The same of the right image.
    #[arg(long, value_name = "IMAGE", requires = "mode")]
    right_mask: Option<PathBuf>,
}

/// Right to 0.001 sr.
const DIRECTIONS: u32 = 200_000;

pub fn run(args: &Args, globals: &Globals, console: Console) -> Result<(), Failure> {
    let (options, radius) = (&args.rig, args.radius);
    let rig = rig_file::load(globals.rig.as_deref())?;
    let name = options.mode.as_deref().unwrap_or_default();
    let mode = rig.mode(name).ok_or_else(|| Failure::usage(format!("rig '{}' has no mode '{name}'", rig.name)))?;
    let values: Vec<f64> = mode.targets.iter().map(|position| position.value()).collect();
    let pose = rig.pose_at_values(&values);
    let masks = [(&options.left_mask, &rig.left_camera), (&options.right_mask, &rig.right_camera)]
        .map(|(path, lens)| path.as_deref().map(|path| body_mask(path, lens.size())).transpose());
    let [left_mask, right_mask] = masks;
    let (left_mask, right_mask) = (left_mask?, right_mask?);
    let cameras = cameras(&rig, &pose, [left_mask.as_ref(), right_mask.as_ref()]);
    let middle = middle(&pose);

    let fail = |error| Failure::usage(format!("no zones: {error}"));
    let map = circle_zones(&cameras, &middle, radius).map_err(fail)?;
    let solid = solid_zones(&cameras, &middle, radius, DIRECTIONS).map_err(fail)?;
    draw(args, &cameras, &middle, &map.zones)?;
    console.say(format!("circle of {radius:.0}: {}", in_words(&map.zones)))?;
    let share = |steradians: f64| 100.0 * steradians / (4.0 * std::f64::consts::PI);
    console.say(format!(
        "sphere of {radius:.0}: stereo {:.3} sr ({:.1} %), mono {:.3} sr ({:.1} %), blind {:.3} sr ({:.1} %)",
        solid.stereo_sr,
        share(solid.stereo_sr),
        solid.mono_sr,
        share(solid.mono_sr),
        solid.blind_sr,
        share(solid.blind_sr)
    ))?;
    if solid.rear_sr > 0.0 {
        console.say(format!("of the stereo zone, {:.3} sr lie behind the rig", solid.rear_sr))?;
    }
    console.result(&json!({
        "exact": zones_json(&map.zones),
        "rear_overlap": rounded(map.rear_overlap().deg()),
        "solid_sr": {
            "stereo": rounded(solid.stereo_sr),
            "mono": rounded(solid.mono_sr),
            "blind": rounded(solid.blind_sr),
            "rear": rounded(solid.rear_sr),
        },
    }))
}

fn cameras<'a>(rig: &'a Rig, pose: &RigPose, masks: [Option<&'a BodyMask>; 2]) -> [PlacedCamera<'a>; 2] {
    let camera = |lens: &'a KannalaBrandt, base_from_camera: Transform<Base, Camera>, body| PlacedCamera {
        lens,
        base_from_camera,
        body,
    };
    let [left_mask, right_mask] = masks;
    [
        camera(&rig.left_camera, pose.base_from_left.renamed(), left_mask),
        camera(&rig.right_camera, (pose.base_from_left * pose.left_from_right).renamed(), right_mask),
    ]
}

fn middle(pose: &RigPose) -> Point<Base> {
    let right = (pose.base_from_left * pose.left_from_right).origin().mm();
    Point::from_mm((pose.base_from_left.origin().mm() + right) / 2.0)
}

/// Writes the drawings that were asked for.
fn draw(args: &Args, placed: &[PlacedCamera<'_>; 2], middle: &Point<Base>, zones: &Zones) -> Result<(), Failure> {
    let (cameras, radius) = (from_above(placed, middle), args.radius);
    if let Some(path) = &args.svg {
        let sees = |[x, forward]: [f64; 2]| {
            let place = Point::from_mm(middle.mm() + nalgebra::Vector3::new(x, 0.0, forward));
            placed.each_ref().map(|camera| camera.sees(&place))
        };
        let drawn = zones_svg(zones, &cameras, radius, &sees).map_err(|error| Failure::output(path, error))?;
        write_whole(path, drawn.as_bytes())?;
    }
    let Some(path) = &args.plot else { return Ok(()) };
    let [left, right] = &cameras;
    let [dx, dy] = [0, 1].map(|place| right.centre_mm[place] - left.centre_mm[place]);
    let plotted = ZonesOf {
        baseline: Length::from_mm(dx.hypot(dy)),
        separation: right.axis - left.axis,
        field: left.half_field + right.half_field,
        radius,
    };
    write_whole(path, zones_plot(&plotted).as_bytes())
}

/// Both cameras from above: where the axes point, and the lenses' cones.
fn from_above(cameras: &[PlacedCamera<'_>; 2], middle: &Point<Base>) -> [PlanarCamera; 2] {
    cameras.each_ref().map(|camera| {
        let centre = camera.base_from_camera.origin().mm() - middle.mm();
        let axis = camera.base_from_camera.rotation() * nalgebra::Vector3::z();
        PlanarCamera {
            centre_mm: [centre.x, centre.z],
            axis: Angle::from_rad(axis.x.atan2(axis.z)),
            half_field: camera.lens.theta_max(),
        }
    })
}

fn body_mask(path: &Path, size: ImageSize) -> Result<BodyMask, Failure> {
    let picture = image::open(path).map_err(|error| Failure::input(path, error))?.into_luma8();
    let given = ImageSize { width: picture.width(), height: picture.height() };
    if given != size {
        return Err(Failure::input(
            path,
            format!("the mask is {} x {}, its camera {} x {}", given.width, given.height, size.width, size.height),
        ));
    }
    let hidden = picture.pixels().map(|pixel| pixel.0[0] < 128).collect();
    BodyMask::new(size, hidden).ok_or_else(|| Failure::input(path, "the mask has no pixels"))
}
