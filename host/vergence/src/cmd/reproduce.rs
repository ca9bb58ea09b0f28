//! `vergence reproduce`: the paper's tables in one command.

mod in_json;
mod tell;

use std::path::PathBuf;

use rayon::prelude::*;
use serde_json::json;

use super::report::rounded;
use crate::cli::Globals;
use crate::console::Console;
use crate::failure::Failure;
use crate::models::MatcherOptions;
use crate::output::{make_folder, write_whole};
use crate::reproduce::{
    Bench, Corners, Drive, Eyesight, Findings, Matching, SeedResult, Table, board_pictures, drive, matchings,
    mode_zones, one_seed, reproduction_page,
};
use crate::stopwatch::Stopwatch;

/// Repeats the paper's experiments on the simulated rig and writes them to one page.
///
/// The precision bench: for every seed another rig is driven, calibrated from photographs of a 20 mm checkerboard, and
/// measures boards 350 mm away in human and herbivore mode by every method. Photographs are rendered, which takes most of
/// the time. Beside it the zones of all modes, the methods of triangulation, and matches in the simulated room by our
/// matchers and by OpenCV's semi-global matching (python3 -m pip install opencv-python-headless numpy). The same seeds
/// give the same bytes.
#[derive(Debug, clap::Args)]
pub struct Args {
    /// Where the page goes, and images for OpenCV.
    #[arg(long, default_value = "vergence-reproduce", value_name = "DIR")]
    out: PathBuf,
    /// How many rigs.
    #[arg(long, default_value_t = 5, value_parser = clap::value_parser!(u32).range(1..=10_000))]
    seeds: u32,
    /// How many of them are also measured with twice the noise; without it, a fifth.
    #[arg(long, value_name = "SEEDS", value_parser = clap::value_parser!(u32).range(1..=10_000))]
    noisy_seeds: Option<u32>,
    /// Render photographs and find the corners, or only project the corners and add noise: quick, but not the whole chain.
    #[arg(long, value_enum, default_value = "rendered")]
    corners: Corners,
    /// Samples for each point of the study of triangulation.
    #[arg(long, default_value_t = 20_000, value_parser = clap::value_parser!(u32).range(100..=10_000_000))]
    samples: u32,
    /// The Python that has OpenCV.
    #[arg(long, default_value = "python3", value_name = "PROGRAM")]
    python: String,
    /// Leave out the matches in the simulated room.
    #[arg(long)]
    no_matching: bool,
    /// Of the learned matcher, which is the first model installed (see `vergence models`) where none is named.
    #[command(flatten)]
    matching: MatcherOptions,
}

/// Corners of the class that the goals are for, and with twice its noise.
const NOISE_PX: [f64; 2] = [0.1, 0.2];
/// Of the room and of the pictures.
const PICTURE_SEED: u64 = 1;

pub async fn run(args: &Args, globals: &Globals, console: Console) -> Result<(), Failure> {
    let whole = Stopwatch::start();
    make_folder(&args.out)?;
    let matchings = if args.no_matching { Vec::new() } else { matched(args, console)? };
    let rigs = driven(args.seeds, globals.lease, console).await?;
    let noisy = args.noisy_seeds.unwrap_or(args.seeds.div_ceil(5)).min(args.seeds) as usize;
    let [table, noisier] = [(NOISE_PX[0], rigs.len()), (NOISE_PX[1], noisy)].map(|(noise_px, seeds)| {
        all_seeds(rigs.get(..seeds).unwrap_or_default(), &Eyesight { corners: args.corners, noise_px }, console)
    });
    let (table, noisier) = (table?, noisier?);
    let zones = mode_zones();
    let page = args.out.join("reproduce.html");
    let html = reproduction_page(&Findings {
        tables: [&table, &noisier],
        rendered: args.corners == Corners::Rendered,
        zones: &zones,
        matchings: &matchings,
        boards: &board_pictures(PICTURE_SEED)?,
        samples: args.samples,
        command: command(args, noisy),
    })?;
    write_whole(&page, html.as_bytes())?;
    tell::bench([&table, &noisier], console)?;
    tell::matchings(&matchings, console)?;
    console.say(format!("{} has it all; {:.0} s", page.display(), whole.seconds()))?;
    console.result(&json!({
        "bench": in_json::rows(&table),
        "zones": in_json::zones(&zones),
        "corners": in_json::corners(&table),
        "noisier": { "bench": in_json::rows(&noisier), "corners": in_json::corners(&noisier) },
        "matching": in_json::matchings(&matchings),
        "page": page,
        "seconds": rounded(whole.seconds()),
    }))
}

/// As the page names it: what decides its bytes.
fn command(args: &Args, noisy: usize) -> String {
    let corners = if args.corners == Corners::Rendered { "" } else { " --corners projected" };
    let matching = if args.no_matching { " --no-matching" } else { "" };
    format!(
        "vergence reproduce --seeds {} --noisy-seeds {noisy} --samples {}{corners}{matching}",
        args.seeds, args.samples
    )
}

/// Every seed's rig, driven through its calibration and its modes.
async fn driven(seeds: u32, lease_ms: u16, console: Console) -> Result<Vec<(u64, Bench, Drive)>, Failure> {
    let progress = console.progress("driving the rigs");
    let mut rigs = Vec::new();
    for seed in 0..u64::from(seeds) {
        let bench = Bench::new(seed)?;
        let drive = drive(&bench, seed, lease_ms, &progress).await?;
        rigs.push((seed, bench, drive));
    }
    progress.finish_and_clear();
    Ok(rigs)
}

/// Seeds side by side; what they came to is taken in their order.
fn all_seeds(rigs: &[(u64, Bench, Drive)], eyesight: &Eyesight, console: Console) -> Result<Table, Failure> {
    let progress = console.count_bar(&format!("rigs, corners of {} px", eyesight.noise_px), rigs.len() as u64);
    let results: Vec<SeedResult> = rigs
        .par_iter()
        .map(|(seed, bench, drive)| {
            let result = one_seed(bench, drive, eyesight, *seed);
            progress.inc(1);
            result
        })
        .collect::<Result<_, Failure>>()?;
    progress.finish_and_clear();
    Ok(Table::of(&results))
}

fn matched(args: &Args, console: Console) -> Result<Vec<Matching>, Failure> {
    let progress = console.progress("matching in the simulated room");
    let learned =
        args.matching.learned(console)?.ok_or_else(|| "no models are installed: see 'vergence models'".into());
    let matchings = matchings(&learned, &args.python, &args.out, PICTURE_SEED)?;
    progress.finish_and_clear();
    Ok(matchings)
}
