//! `vergence bench matching`: what each way of matching finds, over the angle between the optical axes.

use std::path::PathBuf;

use nalgebra::Vector3;
use serde_json::json;
use vergence_bench::matching::{Means, NetworkClock, SimulatedPair, Way};
use vergence_rig::rounded;
use vergence_vision::Angle;

use crate::cmd::model_options::MatcherOptions;
use crate::console::Console;
use crate::failure::Failure;
use crate::rig_file::bench_with_sensors;
use crate::stopwatch::clock;

/// Photographs the simulated room with two cameras 145 mm apart, each a little pitched and rolled, matches the pair in every
/// way, and counts the right matches: those within 2.5 pixels of where the right camera sees the same point. `raw` gives the
/// whole fisheye images to the networks, `views` is `--matcher` with a model, `classical` the matcher without networks. All
/// counts stand before and after the gates of the known pose, with the time from images to points. With several seeds the
/// mean follows.
#[derive(Debug, clap::Args)]
pub struct Args {
    /// Angles between the optical axes, such as 60deg,120deg. Without them 0° to 130° in steps of 10°.
    #[arg(long, value_name = "ANGLES", value_delimiter = ',')]
    separations: Vec<Angle>,
    /// Count of seeds; each has its own place in the room, heading and mounts.
    #[arg(long, default_value_t = 1, value_parser = clap::value_parser!(u64).range(1..=100))]
    seeds: u64,
    /// The first seed.
    #[arg(long, default_value_t = 1, value_parser = clap::value_parser!(u64).range(0..=1_000_000))]
    first_seed: u64,
    /// Side of the images in pixels.
    #[arg(long, default_value_t = 1280, value_parser = clap::value_parser!(u32).range(160..=2560))]
    side: u32,
    /// Gives the matchers a pose that is wrong by this angle.
    #[arg(long, value_name = "ANGLE", default_value = "0deg")]
    pose_error: Angle,
    /// The folder that keeps rendered images; images that it has are not rendered again.
    #[arg(long, value_name = "DIR")]
    renders: Option<PathBuf>,
    #[command(flatten)]
    matching: MatcherOptions,
}

const STEPS: [f64; 14] = [0.0, 10.0, 20.0, 30.0, 40.0, 50.0, 60.0, 70.0, 80.0, 90.0, 100.0, 110.0, 120.0, 130.0];

pub fn run(args: &Args, console: Console) -> Result<(), Failure> {
    // Once: a process loads one ONNX Runtime.
    let networks = NetworkClock::new(clock);
    let learned = args.matching.learned(console)?.map(|learned| learned.wrapped(|network| networks.watch(network)));
    let lens = bench_with_sensors(args.side)?.left_camera;
    let ways = Way::all(learned.as_ref(), args.matching.guided());
    let separations =
        if args.separations.is_empty() { STEPS.map(Angle::from_deg).to_vec() } else { args.separations.clone() };
    console.say(format!(
        "{} x {} pixels; matches that are right (share of all), before and after the gates",
        args.side, args.side
    ))?;
    let (mut rows, mut means, mut all) = (Vec::new(), Vec::new(), vec![Means::default(); ways.len()]);
    for separation in separations {
        let mut of_ways = vec![Means::default(); ways.len()];
        for seed in args.first_seed..args.first_seed + args.seeds {
            let work = console.progress(&format!("{separation:.0}, seed {seed}"));
            let pair = SimulatedPair::new(lens, separation, seed, args.renders.as_deref())?;
            // About an axis between all of them.
            let error = Vector3::new(1.0, -1.0, 1.0).normalize() * args.pose_error.rad();
            let (mut found, mut lines) = (serde_json::Map::new(), Vec::new());
            for ((way, means), all) in ways.iter().zip(&mut of_ways).zip(&mut all) {
                let outcome = way.find(&pair, error, &networks)?;
                lines.push(format!("  {:>9}: {}", way.name(), outcome.in_words()));
                found.insert(way.name().into(), outcome.json());
                means.add(&outcome);
                all.add(&outcome);
            }
            work.finish_and_clear();
            console.say(format!("{separation:.0}, seed {seed}"))?;
            lines.iter().try_for_each(|line| console.say(line))?;
            rows.push(json!({ "separation_deg": rounded(separation.deg()), "seed": seed, "ways": found }));
        }
        if args.seeds > 1 {
            console.say(format!("{separation:.0}, mean of {} (least to most)", args.seeds))?;
        }
        let mut mean = serde_json::Map::new();
        for (way, means) in ways.iter().zip(&of_ways) {
            if args.seeds > 1 {
                console.say(format!("  {:>9}: {means}", way.name()))?;
            }
            mean.insert(way.name().into(), means.json());
        }
        means.push(json!({ "separation_deg": rounded(separation.deg()), "ways": mean }));
    }
    console.say("all points together")?;
    let mut together = serde_json::Map::new();
    for (way, all) in ways.iter().zip(&all) {
        all.honesty().iter().try_for_each(|line| console.say(format!("  {:>9}: {line}", way.name())))?;
        together.insert(way.name().into(), all.json());
    }
    console.result(&json!({
        "side": args.side, "pose_error_deg": rounded(args.pose_error.deg()), "rows": rows, "means": means, "all": together
    }))
}
