//! The zones of a rig file's own cameras: real lenses, any pose, and what the robot's body hides.

use serde_json::json;
use vergence_files::write_whole;
use vergence_output::{ZonesOf, published_zones, write_drawing, zones_plot, zones_svg};
use vergence_pipeline::RigView;
use vergence_rig::{closure_in_words, closure_json, rounded, zones_json};
use vergence_vision::{circle_zones, solid_zones};

use super::{Args, in_words};
use crate::cli::CommonOptions;
use crate::cmd::mask_options::MaskOptions;
use crate::cmd::search_options::FieldOption;
use crate::console::Console;
use crate::failure::Failure;
use crate::rig_file;

/// Which rig, and what hides its view.
#[derive(Debug, clap::Args)]
pub struct RigOptions {
    /// A mode of the rig file.
    #[arg(long, value_name = "MODE")]
    mode: Option<String>,
    #[command(flatten)]
    masks: MaskOptions,
    #[command(flatten)]
    field: FieldOption,
}

/// Right to 0.001 sr.
const DIRECTIONS: u32 = 200_000;

pub fn run(args: &Args, common: &CommonOptions, console: Console) -> Result<(), Failure> {
    let (options, radius) = (&args.rig, args.radius);
    let rig = options.field.seeing(rig_file::load(common.rig.as_deref())?);
    let name = options.mode.as_deref().unwrap_or_default();
    let mode = rig.mode(name).ok_or_else(|| Failure::usage(format!("rig '{}' has no mode '{name}'", rig.name)))?;
    let values: Vec<f64> = mode.targets.iter().map(|position| position.value()).collect();
    let pose = rig.pose_at_values(&values);
    pose.check_closure().map_err(|error| Failure::check(error.to_string()))?;
    let [left_mask, right_mask] = options.masks.read(&rig)?;
    let view = RigView::new(&rig, &pose, [left_mask.as_ref(), right_mask.as_ref()]);

    let fail = |error| Failure::usage(format!("no zones: {error}"));
    let map = circle_zones(&view.cameras, &view.middle, radius).map_err(fail)?;
    let solid = solid_zones(&view.cameras, &view.middle, radius, DIRECTIONS).map_err(fail)?;
    if let Some(path) = &args.svg {
        let sees = |place: [f64; 2]| view.sees(place);
        write_drawing(path, zones_svg(&map.zones, &view.from_above(), radius, &sees))?;
    }
    if let Some(path) = &args.plot {
        write_whole(path, zones_plot(&ZonesOf::like(&view.from_above(), radius)).as_bytes())?;
    }
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
    closure_in_words(&pose).iter().try_for_each(|line| console.say(line))?;
    let printed = published_zones(name, &view).map_err(fail)?;
    if let Some((sentence, _)) = &printed {
        console.say(sentence)?;
    }
    console.result(&json!({
        "published": printed.map(|(_, json)| json),
        "exact": zones_json(&map.zones),
        "rear_overlap": rounded(map.rear_overlap().deg()),
        "solid_sr": {
            "stereo": rounded(solid.stereo_sr),
            "mono": rounded(solid.mono_sr),
            "blind": rounded(solid.blind_sr),
            "rear": rounded(solid.rear_sr),
        },
        "trunk": closure_json(&pose),
    }))
}
