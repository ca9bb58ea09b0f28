//! `vergence bench live`: the live matcher on pairs that follow one another.

use serde_json::json;
use vergence_bench::live::{LiveFigures, LiveFrames, PeerMatches, Way};
use vergence_vision::Angle;

use crate::console::Console;
use crate::failure::Failure;
use crate::rig_file::bench_with_sensors;
use crate::stopwatch::clock;

/// Renders the simulated room from the bench while its axes are parallel (human), 120 degrees apart (herbivore), and while they turn, and
/// measures the pairs as `run` does, from memory: rate, delay after the exposure, right points and their share of all points. Beside it stand the
/// single-pair matcher, and OpenCV's ORB and pyramidal Lucas-Kanade on the same pairs. A match is right within 2.5 pixels.
#[derive(Debug, clap::Args)]
pub struct Args {
    /// Sides of the images in pixels.
    #[arg(long, value_delimiter = ',', default_value = "640,1280", value_name = "PIXELS", value_parser = clap::value_parser!(u32).range(160..=2560))]
    sides: Vec<u32>,
    /// Cases to measure. The most memory of a case is its own only where it is the first one.
    #[arg(long, value_delimiter = ',', default_value = "human,herbivore,turning", value_name = "NAMES", value_parser = ["human", "herbivore", "turning"])]
    cases: Vec<String>,
    /// Pairs in a second; without it 60 of 640 pixels and less, else 15.
    #[arg(long, value_name = "HZ", value_parser = crate::cmd::camera_options::parse_rate)]
    rate: Option<f64>,
    /// Number of pairs that come.
    #[arg(long, default_value_t = 150, value_name = "COUNT", value_parser = clap::value_parser!(u32).range(1..=100_000))]
    pairs: u32,
    /// Degrees per second by which the angle between the axes changes while they turn.
    #[arg(long, default_value = "20deg", value_name = "ANGLE")]
    speed: Angle,
    /// The Python that has OpenCV.
    #[arg(long, env = "VERGENCE_PYTHON", default_value = "python3", value_name = "PROGRAM")]
    python: String,
    /// Measure without OpenCV.
    #[arg(long)]
    no_peer: bool,
}

pub fn run(args: &Args, console: Console) -> Result<(), Failure> {
    let mut rows = Vec::new();
    for &side in &args.sides {
        let rig = bench_with_sensors(side)?;
        let rate = args.rate.unwrap_or(if side > 640 { 15.0 } else { 60.0 });
        let ways = [
            ("human", Way::Standing(Angle::from_deg(0.0))),
            ("herbivore", Way::Standing(Angle::from_deg(120.0))),
            ("turning", Way::Turning(args.speed * rate.recip())),
        ];
        for (name, way) in ways.into_iter().filter(|(name, _)| args.cases.iter().any(|case| case == name)) {
            let progress = console.progress(&format!("{side} pixels, {name}"));
            let frames = LiveFrames::rendered(&rig, way);
            let figures = LiveFigures::of(&frames, rate, args.pairs as usize, clock)?;
            let peer = if args.no_peer { None } else { Some(PeerMatches::of(&frames, &args.python)?) };
            progress.finish_and_clear();
            console.say(format!("{side} x {side} pixels, {name}, {rate:.0} pairs a second"))?;
            figures.in_words().iter().try_for_each(|line| console.say(format!("  {line}")))?;
            peer.iter().try_for_each(|peer| console.say(format!("  {}", peer.in_words())))?;
            rows.push(json!({
                "side": side, "way": name, "came_hz": rate, "live": figures.json(), "opencv": peer.map(|peer| peer.json())
            }));
        }
    }
    console.result(&json!({ "rows": rows }))
}
