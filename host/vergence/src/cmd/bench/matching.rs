//! `vergence bench matching`: what each way of matching finds, over the angle between the optical axes.

mod judge;
mod simulated_pair;
mod ways;

use std::path::PathBuf;

use nalgebra::Vector3;
use serde_json::json;
use vergence_vision::Angle;

use self::judge::Tally;
use self::simulated_pair::SimulatedPair;
use self::ways::{Outcome, Way};
use crate::cmd::report::rounded;
use crate::console::Console;
use crate::failure::Failure;
use crate::models::MatcherOptions;

/// Photographs the simulated room with two eyes 145 mm apart, each a little pitched and rolled, matches the pair by every
/// way there is, and counts the matches that are right: those within 2.5 pixels of where the right eye sees what the left
/// one does. `raw` gives the whole fisheye images to the networks, `views` is `--matcher` with a model, `classical` the one
/// that needs none. Each before and after the gates of the known pose.
#[derive(Debug, clap::Args)]
pub struct Args {
    /// Angles between the optical axes, such as 60deg,120deg. Without them 0° to 130° in steps of 10°.
    #[arg(long, value_name = "ANGLES", value_delimiter = ',')]
    separations: Vec<Angle>,
    /// Side of the images in pixels.
    #[arg(long, default_value_t = 1280, value_parser = clap::value_parser!(u32).range(160..=2560))]
    side: u32,
    /// Tell the matchers a pose that is wrong by this angle.
    #[arg(long, value_name = "ANGLE", default_value = "0deg")]
    pose_error: Angle,
    /// Keep what is rendered in this folder, and take from there what is.
    #[arg(long, value_name = "DIR")]
    renders: Option<PathBuf>,
    #[command(flatten)]
    matching: MatcherOptions,
}

const STEPS: [f64; 14] = [0.0, 10.0, 20.0, 30.0, 40.0, 50.0, 60.0, 70.0, 80.0, 90.0, 100.0, 110.0, 120.0, 130.0];

pub fn run(args: &Args, console: Console) -> Result<(), Failure> {
    // Once: a process loads one ONNX Runtime.
    let learned = args.matching.learned(console)?;
    let ways = Way::all(learned.as_ref(), args.matching.guided());
    let separations =
        if args.separations.is_empty() { STEPS.map(Angle::from_deg).to_vec() } else { args.separations.clone() };
    console.say(format!(
        "{} x {} pixels; matches that are right (share of all), before and after the gates",
        args.side, args.side
    ))?;
    let mut rows = Vec::new();
    for separation in separations {
        let work = console.progress(&format!("{separation}"));
        let pair = SimulatedPair::new(args.side, separation, args.renders.as_deref())?;
        // About an axis between all of them.
        let error = Vector3::new(1.0, -1.0, 1.0).normalize() * args.pose_error.rad();
        let mut found = serde_json::Map::new();
        let mut lines = Vec::new();
        for way in &ways {
            let outcome = way.find(&pair, error)?;
            lines.push(format!("  {:>9}: {}", way.name(), in_words(&outcome)));
            found.insert(way.name().into(), in_json(&outcome));
        }
        work.finish_and_clear();
        console.say(format!("{separation:.0}"))?;
        lines.iter().try_for_each(|line| console.say(line))?;
        rows.push(json!({ "separation_deg": rounded(separation.deg()), "ways": found }));
    }
    console.result(&json!({ "side": args.side, "pose_error_deg": rounded(args.pose_error.deg()), "rows": rows }))
}

fn in_words(outcome: &Outcome) -> String {
    let count = |tally: &Tally| format!("{} ({:.2})", tally.correct, tally.precision());
    let after = &outcome.after;
    let mut line = format!(
        "{} -> {}, bearings {:.3}° off, {:.1} s",
        count(&outcome.before),
        count(after),
        after.median_bearing_error.deg(),
        outcome.seconds
    );
    for (name, class) in [("sharp", &after.sharp), ("coarse", &after.coarse)] {
        if class.count > 0 {
            line += &format!(
                "; {name} {} sigma {:.2} px, spread {:.2} px, NEES {:.2}, {:.0} % within 2 sigma",
                class.count,
                class.sigma_px,
                class.spread_px,
                class.nees,
                100.0 * class.within_two_sigma
            );
        }
    }
    if let Some(drift) = &outcome.drift {
        let word = if drift.is_significant() { "disagree" } else { "agree" };
        line += &format!("; pose and picture {word} ({:.2}°)", drift.angle.deg());
    }
    line
}

fn in_json(outcome: &Outcome) -> serde_json::Value {
    let counts = |tally: &Tally| json!({ "matches": tally.count, "correct": tally.correct, "precision": rounded(tally.precision()) });
    let class = |class: &judge::Class| {
        json!({
            "count": class.count,
            "sigma_px": rounded(class.sigma_px),
            "spread_px": rounded(class.spread_px),
            "range_nees": rounded(class.nees),
            "within_two_sigma": rounded(class.within_two_sigma),
        })
    };
    json!({
        "before": counts(&outcome.before),
        "after": counts(&outcome.after),
        "median_bearing_error_deg": rounded(outcome.after.median_bearing_error.deg()),
        "sharp": class(&outcome.after.sharp),
        "coarse": class(&outcome.after.coarse),
        "drift": outcome.drift.as_ref().map(|drift| json!({
            "deg": rounded(drift.angle.deg()), "significant": drift.is_significant()
        })),
        "dropped": outcome.dropped,
        "seconds": rounded(outcome.seconds),
    })
}
