//! `vergence reproduce`: the paper's tables in one command.

mod mismatch;

use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex};

use indicatif::ProgressBar;
use serde_json::json;
use vergence_bench::ask_python;
use vergence_files::{make_folder, write_png, write_whole};
use vergence_reproduce::{
    Bench, Corners, DrivenRig, MatchingTools, Plan, Progress, SgbmAnswer, SgbmTask, TRUE_LENS, drive, experiments,
};
use vergence_rig::rounded;
use vergence_scene::LensChoice;

use super::model_options::MatcherOptions;
use crate::console::{Console, shown_on};
use crate::failure::Failure;
use crate::interrupt::{interrupted, on_own_thread};
use crate::stopwatch::Stopwatch;

/// Repeats the paper's experiments on the simulated rig and writes them to one page.
///
/// The precision bench: for every seed another rig is driven, calibrated from photographs of a 20 mm checkerboard, and
/// measures targets 350 mm away in human and herbivore mode by every method of the paper and by ours; on some rigs with each
/// kind of error alone. Detecting the corners takes most of the time. Beside it stand the zones of all modes, the methods of triangulation, and matches in the simulated room by this
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
    /// How many of them are also measured with twice the noise and with each kind of error alone; without it, a fifth.
    #[arg(long, value_name = "SEEDS", value_parser = clap::value_parser!(u32).range(1..=10_000))]
    noisy_seeds: Option<u32>,
    /// `rendered` photographs, where the detector finds the corners, or only corners that are `projected`, with noise: quick.
    #[arg(long, default_value = "rendered")]
    corners: Corners,
    /// The true lenses of the bench: a published design that is traced, sigma8_f18 or nikkor6_f28, or ideal ones, which are of the
    /// calibration's own family.
    #[arg(long, default_value_t = TRUE_LENS)]
    lens: LensChoice,
    /// Instead tries worlds that are not as the calibration assumes: traced lenses, displaced elements, a bent target, uneven mechanics and
    /// others, each by itself, and writes what each costs, and whether the rig's own statement says so, to mismatch.html. Corners are projected.
    #[arg(long, conflicts_with_all = ["noisy_seeds", "corners", "samples", "no_matching"])]
    mismatch: bool,
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

/// What the command is at, for people and for the last words of an interrupted one.
#[derive(Clone)]
struct Stage(Arc<Mutex<String>>);

pub async fn run(args: &Args, console: Console) -> Result<(), Failure> {
    let whole = Stopwatch::start();
    make_folder(&args.out)?;
    if args.mismatch {
        return mismatch::run(args, console, &whole).await;
    }
    let learned = if args.no_matching { None } else { args.matching.learned(console)? };
    let stage = Stage::new("driving the rigs");
    let plan = Plan {
        seeds: args.seeds,
        noisy_seeds: args.noisy_seeds,
        corners: args.corners,
        lens: args.lens,
        samples: args.samples,
        matching: !args.no_matching,
    };
    let work = async {
        let rigs = driven(args.seeds, console).await?;
        let (python, out, stage) = (args.python.clone(), args.out.clone(), stage.clone());
        on_own_thread(move || {
            let tools = MatchingTools {
                learned: learned.as_ref().ok_or_else(|| "no model is kept: see 'vergence models'".to_owned()),
                opencv: &|task| semi_global_matching(&python, &out, task),
            };
            let shown = Shown::new(console);
            Ok(experiments(&plan, &rigs, &tools, &|progress| {
                stage.is(progress.to_string());
                shown.follow(progress);
            })?)
        })
        .await
    };
    let results = tokio::select! {
        results = work => results?,
        () = interrupted() => return Err(stage.stopped()),
    };
    let page = args.out.join("reproduce.html");
    write_whole(&page, results.html.as_bytes())?;
    results.lines().iter().try_for_each(|line| console.say(line))?;
    console.say(format!("{} shows all results; {:.0} s", page.display(), whole.seconds()))?;
    let mut figures = results.json();
    figures["page"] = json!(page);
    figures["seconds"] = rounded(whole.seconds()).into();
    console.result(&figures)
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

/// The progress of the experiments on the terminal: a spinner, or a bar that counts rigs.
struct Shown {
    console: Console,
    bar: Mutex<ProgressBar>,
}

impl Shown {
    fn new(console: Console) -> Self {
        Self { console, bar: Mutex::new(ProgressBar::hidden()) }
    }

    fn follow(&self, progress: Progress) {
        let Ok(mut bar) = self.bar.lock() else { return };
        let next = match progress {
            Progress::Measuring { done: 1.., .. } => return bar.inc(1),
            Progress::Measuring { errors, rigs, .. } => self.console.count_bar(&format!("rigs, {errors}"), rigs as u64),
            Progress::Matching => self.console.progress(&progress.to_string()),
            Progress::Drawing => ProgressBar::hidden(),
        };
        std::mem::replace(&mut *bar, next).finish_and_clear();
    }
}

/// Drives every seed's rig through its calibration and its modes.
async fn driven(seeds: u32, console: Console) -> Result<Vec<DrivenRig>, Failure> {
    let progress = console.progress("driving the rigs");
    let mut rigs = Vec::new();
    for seed in 0..u64::from(seeds) {
        let bench = Bench::new(seed)?;
        let drive = drive(&bench, seed, shown_on(progress.clone())).await?;
        rigs.push(DrivenRig { seed, bench, drive });
    }
    progress.finish_and_clear();
    Ok(rigs)
}

/// Writes the images of `task` to `folder`, and runs its script in `python`.
///
/// # Errors
/// A sentence that says why there is no answer.
fn semi_global_matching(python: &str, folder: &Path, task: &SgbmTask<'_>) -> Result<SgbmAnswer, String> {
    let file = |what: &str| folder.join(format!("{}-{what}.png", task.mode));
    let (left, right, picture) = (file("left"), file("right"), file("sgbm"));
    for (path, image) in [(&left, task.images[0]), (&right, task.images[1])] {
        write_png(path, image).map_err(|failure| failure.to_string())?;
    }
    let mut argument = task.argument.clone();
    for (name, path) in [("left", &left), ("right", &right), ("picture", &picture)] {
        argument[name] = json!(path);
    }
    let figures = ask_python(python, task.script, [argument.to_string()])?;
    let picture = image::open(&picture).map_err(|error| format!("{}: {error}", picture.display()))?.to_rgb8();
    Ok(SgbmAnswer { figures, picture })
}
