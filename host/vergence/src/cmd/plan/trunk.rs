//! `vergence plan` of a rig with a folding trunk: a path on which the loop closes and nothing touches.

use std::path::PathBuf;

use serde_json::json;
use vergence_board::check_range;
use vergence_files::write_whole;
use vergence_output::{check_ending, trunk_leg_json, trunk_leg_table, trunk_path_lines, trunk_strip_svg};
use vergence_pipeline::{ZONE_RADIUS, rig_zones};
use vergence_rig::linkage::WantedClearance;
use vergence_rig::{Rig, RigTrunk, axes_json, closure_in_words, closure_json, rounded, zones_json};
use vergence_vision::{Angle, Length};

use super::super::stage_pose::named_mode;
use super::Args;
use crate::console::Console;
use crate::failure::Failure;

/// The room that a path of a trunk must have, and its picture.
#[derive(Debug, clap::Args)]
pub struct TrunkOptions {
    /// Angle by which every driven joint of a trunk may be off along the path before its loop no longer closes.
    #[arg(long, value_name = "ANGLE", default_value_t = Angle::from_deg(1.0))]
    reserve: Angle,
    /// Least distance of the bodies of a trunk along the path.
    #[arg(long, value_name = "LENGTH", default_value_t = Length::from_mm(3.0))]
    gap: Length,
    /// Draws the trunk along the path, with the zones, to this file, as SVG.
    #[arg(long, value_name = "FILE")]
    strip: Option<PathBuf>,
}

pub fn run(args: &Args, rig: &Rig, trunk: &RigTrunk, console: Console) -> Result<(), Failure> {
    let Some(goal) = &args.mode else {
        return Err(Failure::usage(format!("rig '{}' has a trunk: name a mode to go to", rig.name)));
    };
    let Some(start) = &args.from else {
        return Err(Failure::usage(format!(
            "rig '{}' has a trunk: say with --from in which mode the path begins",
            rig.name
        )));
    };
    if let Some(path) = &args.trunk.strip {
        check_ending(path, &["svg"])?;
    }
    let [from, to] = [start, goal].map(|name| named_mode(rig, name).map(|mode| &mode.targets));
    let (from, to) = (from?, to?);
    check_range(rig, to)?;
    let values = |positions: &[vergence_rig::AxisPosition]| -> Vec<f64> {
        positions.iter().map(|position| position.value()).collect()
    };
    let wanted = WantedClearance { loop_reserve: args.trunk.reserve.rad(), gap_mm: args.trunk.gap.mm() };
    let path = trunk
        .path(&values(from), &values(to), &wanted)
        .map_err(|error| Failure::check(format!("no path from {start} to {goal}: {error}")))?;
    console.say_lines(trunk_path_lines(&path))?;
    if path.kept != wanted {
        console.warn("no way has the clearance asked for: this one keeps less");
    }
    if args.dump {
        console.say_lines(path.legs.iter().enumerate().map(|(number, leg)| trunk_leg_table(number, leg)))?;
    }
    let pose = rig.pose_at_values(&values(to));
    pose.check_closure().map_err(|error| Failure::check(error.to_string()))?;
    let zones = rig_zones(rig, &pose).map_err(|error| Failure::check(format!("the zones of this pose: {error}")))?;
    // The base is the left half of the front link.
    let plane = if trunk.is_flat(&values(to)) { "" } else { " in the plane of the trunk's left half" };
    console.say(format!(
        "then sees stereo {:.1}, mono {:.1}, blind {:.1} on a circle of {ZONE_RADIUS:.0}{plane}",
        zones.stereo, zones.mono, zones.blind
    ))?;
    closure_in_words(&pose).iter().try_for_each(|line| console.say(line))?;
    if let (Some(file), Some(svg)) = (&args.trunk.strip, trunk_strip_svg(rig, &path)) {
        write_whole(file, svg.as_bytes())?;
        console.say(format!("pictures in {}", file.display()))?;
    }
    console.result(&json!({
        "duration_s": rounded(path.seconds()),
        "from": axes_json(rig, from),
        "to": axes_json(rig, to),
        "kept": { "reserve_deg": rounded(path.kept.loop_reserve.to_degrees()), "gap_mm": rounded(path.kept.gap_mm) },
        "zones_deg": zones_json(&zones),
        "trunk": closure_json(&pose),
        "legs": path.legs.iter().map(|leg| trunk_leg_json(rig, trunk, leg)).collect::<Vec<_>>(),
    }))
}
