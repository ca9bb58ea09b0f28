//! `vergence zones`: how much of the surroundings both cameras, one, or none see.

mod rig;

use std::path::PathBuf;

use serde_json::json;
use vergence_files::write_whole;
use vergence_output::{ZonesOf, check_ending, seen_by_cones, write_drawing, zones_plot, zones_svg};
use vergence_rig::{rounded, zones_json};
use vergence_vision::{Angle, Length, Zones, paper_eq3, paper_eq3_applies, symmetric_pair, zones_exact};

use crate::cli::CommonOptions;
use crate::console::Console;
use crate::failure::Failure;

/// Prints the zones as angles of a horizontal circle around the middle of the rig: exact, and by equation 3 of the paper
/// "Bio-inspired reconfigurable stereo vision for robotics using omnidirectional cameras" as printed. With --mode, those of
/// the rig file's own cameras in that mode, and solid angles.
#[derive(Debug, clap::Args)]
pub struct Args {
    /// Distance of the cameras.
    #[arg(long, value_name = "LENGTH", required_unless_present = "mode", conflicts_with_all = ["mode", "left_mask", "right_mask", "field"])]
    baseline: Option<Length>,
    /// Angle between the optical axes; positive is outward, negative crossed.
    #[arg(
        long,
        value_name = "ANGLE",
        allow_hyphen_values = true,
        required_unless_present = "mode",
        conflicts_with = "mode"
    )]
    separation: Option<Angle>,
    /// Full horizontal field of each lens.
    #[arg(long, value_name = "ANGLE", default_value = "195.95deg")]
    fov: Angle,
    /// Radius of the circle.
    #[arg(long, value_name = "LENGTH", default_value = "350mm")]
    radius: Length,
    /// Draw a plan: the places that both cameras, one or none see.
    #[arg(long, value_name = "SVG")]
    svg: Option<PathBuf>,
    /// Draw curves of the zones over separation and over radius. With --mode, those of two equal cameras at the mode's
    /// baseline and separation.
    #[arg(long, value_name = "SVG")]
    plot: Option<PathBuf>,
    #[command(flatten)]
    rig: rig::RigOptions,
}

pub fn run(args: &Args, common: &CommonOptions, console: Console) -> Result<(), Failure> {
    let Args { fov, radius, .. } = *args;
    for path in args.svg.iter().chain(&args.plot) {
        check_ending(path, &["svg"])?;
    }
    let (Some(baseline), Some(separation)) = (args.baseline, args.separation) else {
        return rig::run(args, common, console);
    };
    if baseline.mm() <= 0.0 {
        return Err(Failure::usage(format!("a baseline of {baseline} is none: choose a positive one")));
    }
    let cameras = symmetric_pair(baseline, separation, fov);
    let map = zones_exact(cameras, radius).map_err(|error| Failure::usage(format!("no zones: {error}")))?;
    let published = paper_eq3(fov, separation, baseline, radius);
    let applies = paper_eq3_applies(fov, separation, baseline, radius);
    if let Some(path) = &args.svg {
        let drawn = zones_svg(&map.zones, &cameras, radius, &|place| seen_by_cones(&cameras, place));
        write_drawing(path, drawn)?;
    }
    if let Some(path) = &args.plot {
        write_whole(path, zones_plot(&ZonesOf { baseline, separation, field: fov, radius }).as_bytes())?;
    }
    console.say(format!("exact:      {}", in_words(&map.zones)))?;
    console.say(format!("paper Eq.3: {}{}", in_words(&published), if applies { "" } else { OUTSIDE }))?;
    console.result(&json!({
        "exact": zones_json(&map.zones),
        "rear_overlap": rounded(map.rear_overlap().deg()),
        "paper_eq3": zones_json(&published),
        "paper_eq3_applies": applies,
    }))
}

const OUTSIDE: &str = "  (outside the equation's domain)";

fn in_words(zones: &Zones) -> String {
    format!("stereo {:.2}, mono {:.2}, blind {:.2}", zones.stereo, zones.mono, zones.blind)
}
