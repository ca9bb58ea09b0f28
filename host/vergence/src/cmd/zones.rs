//! `vergence zones`: how much of the surroundings both cameras, one, or none see.

use std::path::PathBuf;

use serde_json::{Value, json};
use vergence_vision::{Angle, Length, Zones, symmetric_pair, zones_exact, zones_paper_eq3};

use crate::console::Console;
use crate::failure::Failure;
use crate::output::{write_whole, zones_svg};

/// Angles, seen from the middle of the rig, of a horizontal circle around it: exact, and by equation 3 of the paper
/// "Bio-inspired reconfigurable stereo vision for robotics using omnidirectional cameras" as printed.
#[derive(Debug, clap::Args)]
pub struct Args {
    /// Distance of the cameras.
    #[arg(long, value_name = "LENGTH")]
    baseline: Length,
    /// Angle between the optical axes; positive is outward, negative crossed.
    #[arg(long, value_name = "ANGLE", allow_hyphen_values = true)]
    separation: Angle,
    /// Full horizontal field of each lens.
    #[arg(long, value_name = "ANGLE", default_value = "195.95deg")]
    fov: Angle,
    /// Radius of the circle.
    #[arg(long, value_name = "LENGTH", default_value = "350mm")]
    radius: Length,
    /// Draw the zones.
    #[arg(long, value_name = "FILE")]
    svg: Option<PathBuf>,
}

pub fn run(args: &Args, console: Console) -> Result<(), Failure> {
    let Args { baseline, separation, fov, radius, .. } = *args;
    if baseline.mm() <= 0.0 {
        return Err(Failure::usage(format!("a baseline of {baseline} is none: choose a positive one")));
    }
    let cameras = symmetric_pair(baseline, separation, fov);
    let map = zones_exact(cameras, radius).map_err(|error| Failure::usage(format!("no zones: {error}")))?;
    let published = zones_paper_eq3(fov, separation, baseline, radius);
    if let Some(path) = &args.svg {
        write_whole(path, zones_svg(&map, &cameras, radius).as_bytes())?;
    }
    console.say(format!("exact:      {}", in_words(&map.zones)))?;
    console.say(format!("paper Eq.3: {}{}", in_words(&published), if possible(&published) { "" } else { OUTSIDE }))?;
    console.result(&json!({"exact": in_degrees(&map.zones), "paper_eq3": in_degrees(&published)}))
}

const OUTSIDE: &str = "  (outside the equation's domain)";

/// Whether the published equation gives angles at all here.
fn possible(zones: &Zones) -> bool {
    [zones.stereo, zones.mono, zones.blind].iter().all(|angle| angle.rad() >= 0.0)
}

fn in_words(zones: &Zones) -> String {
    format!("stereo {:.2}, mono {:.2}, blind {:.2}", zones.stereo, zones.mono, zones.blind)
}

/// In degrees; a number that is none becomes null.
#[must_use]
pub fn in_degrees(zones: &Zones) -> Value {
    json!({
        "stereo": super::report::rounded(zones.stereo.deg()),
        "mono": super::report::rounded(zones.mono.deg()),
        "blind": super::report::rounded(zones.blind.deg()),
    })
}
