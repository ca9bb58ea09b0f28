//! `vergence reproduce`: the paper's tables in one command.

mod drive;
mod in_json;
mod opencv;
mod tell;

use std::path::PathBuf;
use std::sync::{Arc, Mutex};

use rayon::prelude::*;
use serde_json::json;
use vergence_matching::learned::LearnedMatcher;
use vergence_reproduce::{
    Bench, CornerSource, Corners, Drive, Findings, Matching, MatchingTools, ModeZones, Table, matchings, mode_zones,
    one_seed, reproduction_page, target_images,
};
use vergence_vision::PAPER_FIELD;

use self::drive::drive;
use self::opencv::semi_global_matching;
use super::model_options::MatcherOptions;
use super::report::rounded;
use crate::console::Console;
use crate::failure::Failure;
use crate::interrupt::{interrupted, on_own_thread};
use crate::output::{ZonesOf, make_folder, match_svg, write_whole, zones_plot};
use crate::stopwatch::Stopwatch;

/// Repeats the paper's experiments on the simulated rig and writes them to one page.
///
/// The precision bench: for every seed another rig is driven, calibrated from photographs of a 20 mm checkerboard, and
/// measures targets 350 mm away in human and herbivore mode by every method. Rendering the photographs takes most of the
/// time. Beside it stand the zones of all modes, the methods of triangulation, and matches in the simulated room by this
/// program's matchers and by OpenCV's semi-global matching (python3 -m pip install opencv-python-headless numpy). The same
/// seeds give the same bytes.
#[derive(Clone, Debug, clap::Args)]
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
    /// Render photographs and find the corners, or only project the corners and add noise: quick, but not the whole
    /// chain.
    #[arg(long, value_enum, default_value = "rendered")]
    corners: CornersOption,
    /// Samples for each point of the study of triangulation.
    #[arg(long, default_value_t = 20_000, value_parser = clap::value_parser!(u32).range(100..=10_000_000))]
    samples: u32,
    /// The Python that has OpenCV.
    #[arg(long, default_value = "python3", value_name = "PROGRAM")]
    python: String,
    /// Leave out the matches in the simulated room.
    #[arg(long)]
    no_matching: bool,
    /// Options of the learned matcher: without a name, the only model that is kept (see `vergence models`).
    #[command(flatten)]
    matching: MatcherOptions,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, clap::ValueEnum)]
enum CornersOption {
    /// Photographs are rendered, and the detector finds the corners.
    Rendered,
    /// The corners are projected, and Gaussian noise is added.
    Projected,
}

/// Noise of the corners in pixels: of the class that the goals are for, and twice that.
const NOISE_PX: [f64; 2] = [0.1, 0.2];
/// Seed of the simulated room and of the pictures.
const PICTURE_SEED: u64 = 1;

/// A rig and the stops of its stage.
type Driven = (u64, Bench, Drive);

/// What the command is at, for people and for the last words of an interrupted one.
#[derive(Clone)]
struct Stage(Arc<Mutex<String>>);

/// Results of the computation.
struct Results {
    tables: [Table; 2],
    zones: Vec<ModeZones>,
    matchings: Vec<Matching>,
    html: String,
}

pub async fn run(args: &Args, console: Console) -> Result<(), Failure> {
    let whole = Stopwatch::start();
    make_folder(&args.out)?;
    let learned = if args.no_matching { None } else { args.matching.learned(console)? };
    let stage = Stage::new("driving the rigs");
    let work = async {
        let rigs = driven(args.seeds, console).await?;
        let (args, stage) = (args.clone(), stage.clone());
        on_own_thread(move || compute(&args, &rigs, learned.as_ref(), console, &stage)).await
    };
    let results = tokio::select! {
        results = work => results?,
        () = interrupted() => return Err(stage.stopped()),
    };
    let page = args.out.join("reproduce.html");
    write_whole(&page, results.html.as_bytes())?;
    let [table, noisier] = &results.tables;
    tell::bench([table, noisier], console)?;
    tell::matchings(&results.matchings, console)?;
    console.say(format!("{} shows all results; {:.0} s", page.display(), whole.seconds()))?;
    console.result(&json!({
        "bench": in_json::rows(table),
        "zones": in_json::zones(&results.zones),
        "corners": in_json::corners(table),
        "noisier": { "bench": in_json::rows(noisier), "corners": in_json::corners(noisier) },
        "matching": in_json::matchings(&results.matchings),
        "page": page,
        "seconds": rounded(whole.seconds()),
    }))
}

impl Stage {
    fn new(what: &str) -> Self {
        Self(Arc::new(Mutex::new(what.to_owned())))
    }

    fn is(&self, what: String) {
        if let Ok(mut now) = self.0.lock() {
            *now = what;
        }
    }

    fn stopped(&self) -> Failure {
        let now = self.0.lock().map(|now| now.clone()).unwrap_or_default();
        Failure::interrupted(format!(
            "interrupted while {now}: no page was written. Run the same command again to start anew; fewer --seeds or \
             --corners projected take less time"
        ))
    }
}

/// Drives every seed's rig through its calibration and its modes.
async fn driven(seeds: u32, console: Console) -> Result<Vec<Driven>, Failure> {
    let progress = console.progress("driving the rigs");
    let mut rigs = Vec::new();
    for seed in 0..u64::from(seeds) {
        let bench = Bench::new(seed)?;
        let drive = drive(&bench, seed, &progress).await?;
        rigs.push((seed, bench, drive));
    }
    progress.finish_and_clear();
    Ok(rigs)
}

/// Everything after driving: matchings, calibrations, measurements and the page.
fn compute(
    args: &Args,
    rigs: &[Driven],
    learned: Option<&LearnedMatcher>,
    console: Console,
    stage: &Stage,
) -> Result<Results, Failure> {
    let matchings = if args.no_matching { Vec::new() } else { matched(args, learned, console, stage)? };
    let noisy = args.noisy_seeds.unwrap_or(args.seeds.div_ceil(5)).min(args.seeds) as usize;
    let [table, noisier] = [(NOISE_PX[0], rigs.len()), (NOISE_PX[1], noisy)].map(|(noise_px, seeds)| {
        let source = CornerSource { corners: args.corners.into(), noise_px };
        all_seeds(rigs.get(..seeds).unwrap_or_default(), &source, console, stage)
    });
    let tables = [table?, noisier?];
    stage.is("drawing the page".into());
    let zones = mode_zones();
    let html = reproduction_page(&Findings {
        tables: tables.each_ref(),
        rendered: args.corners == CornersOption::Rendered,
        zones: &zones,
        zones_svg: &zones_of_herbivore(&zones),
        matchings: &matchings,
        targets: &target_images(PICTURE_SEED)?,
        samples: args.samples,
        command: command(args, noisy),
    })?;
    Ok(Results { tables, zones, matchings, html })
}

/// The command as the page names it: what decides its bytes.
fn command(args: &Args, noisy: usize) -> String {
    let corners = if args.corners == CornersOption::Rendered { "" } else { " --corners projected" };
    let matching = if args.no_matching { " --no-matching" } else { "" };
    format!(
        "vergence reproduce --seeds {} --noisy-seeds {noisy} --samples {}{corners}{matching}",
        args.seeds, args.samples
    )
}

/// Computes all seeds in parallel; their order decides the order of the results.
fn all_seeds(rigs: &[Driven], source: &CornerSource, console: Console, stage: &Stage) -> Result<Table, Failure> {
    let what = format!("rigs, corners of {} px", source.noise_px);
    let progress = console.count_bar(&what, rigs.len() as u64);
    let report = || {
        stage.is(format!(
            "measuring with corners of {} px, {} of {} rigs done",
            source.noise_px,
            progress.position(),
            rigs.len()
        ));
    };
    report();
    let results: Result<Vec<_>, _> = rigs
        .par_iter()
        .map(|(seed, bench, drive)| {
            let result = one_seed(bench, drive, source, *seed);
            progress.inc(1);
            report();
            result
        })
        .collect();
    progress.finish_and_clear();
    Ok(Table::of(&results?))
}

fn matched(
    args: &Args,
    learned: Option<&LearnedMatcher>,
    console: Console,
    stage: &Stage,
) -> Result<Vec<Matching>, Failure> {
    stage.is("matching in the simulated room".into());
    let progress = console.progress("matching in the simulated room");
    let tools = MatchingTools {
        learned: learned.ok_or_else(|| "no model is kept: see 'vergence models'".to_owned()),
        draw: &|images, cloud| match_svg(images, cloud).map_err(|error| error.to_string()),
        opencv: &|task| semi_global_matching(&args.python, &args.out, task),
    };
    let matchings = matchings(&tools, PICTURE_SEED)?;
    progress.finish_and_clear();
    Ok(matchings)
}

/// Curves of the zones of the herbivore mode, as SVG.
fn zones_of_herbivore(zones: &[ModeZones]) -> String {
    let herbivore = zones.iter().find(|mode| mode.published.name == "herbivore");
    herbivore.map_or_else(String::new, |mode| {
        zones_plot(&ZonesOf {
            baseline: mode.published.baseline,
            separation: mode.published.separation,
            field: PAPER_FIELD,
            radius: mode.published.radius,
        })
    })
}

impl From<CornersOption> for Corners {
    fn from(option: CornersOption) -> Self {
        match option {
            CornersOption::Rendered => Self::Rendered,
            CornersOption::Projected => Self::Projected,
        }
    }
}
