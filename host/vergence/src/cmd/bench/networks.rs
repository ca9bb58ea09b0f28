//! `vergence bench networks`: how long networks take for a pair, beside Python's onnxruntime.

use serde_json::{Value, json};
use vergence_calibration::median;
use vergence_matching::learned::Model;

use crate::cmd::report::rounded;
use crate::console::Console;
use crate::failure::Failure;
use crate::models::{ModelStore, Pattern, Runtime, RuntimeOptions, StoreOptions, load, read_manifest, threads};
use crate::output::write_whole;
use crate::python::ask_python;
use crate::stopwatch::Stopwatch;

/// Extracts the keypoints of two pictures of 512 x 512 pixels and matches them, by every runtime there is and by Python's
/// onnxruntime on the same files, all with as many threads as the machine has. They take turns; milliseconds for a pair,
/// median and least. Without onnxruntime in Python (python3 -m pip install onnxruntime) its figures are null.
#[derive(Debug, clap::Args)]
pub struct Args {
    /// The model; without it the only one there is.
    #[arg(long, value_name = "NAME")]
    model: Option<String>,
    /// How often each is measured in each of its turns.
    #[arg(long, default_value_t = 5, value_parser = clap::value_parser!(u16).range(1..=100))]
    runs: u16,
    /// How often they take turns.
    #[arg(long, default_value_t = 3, value_parser = clap::value_parser!(u16).range(1..=100))]
    rounds: u16,
    /// The Python that has onnxruntime.
    #[arg(long, default_value = "python3", value_name = "PROGRAM")]
    python: String,
    #[command(flatten)]
    runtime: RuntimeOptions,
    #[command(flatten)]
    store: StoreOptions,
}

/// Side of both pictures in pixels: they have some 3800 keypoints.
const SIDE: usize = 512;
const KEYPOINTS: [usize; 2] = [1024, 2048];

/// Python's answer.
#[derive(Clone, Debug, serde::Deserialize)]
struct PeerTimes {
    median_ms: f64,
    least_ms: f64,
    keypoints: usize,
    version: String,
}

pub fn run(args: &Args, console: Console) -> Result<(), Failure> {
    let store = ModelStore::open(&args.store)?;
    let name = match (&args.model, store.names()?.as_slice()) {
        (Some(name), _) => name.clone(),
        (None, [only]) => only.clone(),
        (None, names) => return Err(Failure::usage(format!("say which model with --model: {}", names.join(", ")))),
    };
    let folder = store.path(&name);
    let manifest = read_manifest(&folder)?;
    let runtimes = args.runtime.all()?;
    let models: Vec<(&Runtime, Model)> =
        runtimes.iter().map(|runtime| Ok((runtime, load(&folder, runtime)?))).collect::<Result<_, Failure>>()?;
    let scratch = tempfile::tempdir().map_err(|error| Failure::usage(format!("no temporary folder: {error}")))?;
    let (pattern, picture) = (Pattern::new(SIDE), scratch.path().join("picture.f32"));
    write_whole(&picture, &pattern.values().iter().flat_map(|value| value.to_le_bytes()).collect::<Vec<u8>>())?;
    let manifest = serde_json::to_string(&manifest).map_err(|error| Failure::check(error.to_string()))?;
    let ask = |keypoints: usize| -> Result<PeerTimes, String> {
        let paths = [&folder, &picture].map(|path| path.display().to_string());
        let numbers = [SIDE, SIDE, keypoints, threads(), usize::from(args.runs)].map(|number| number.to_string());
        let arguments = std::iter::once(manifest.clone()).chain(paths).chain(numbers);
        ask_python(&args.python, include_str!("onnxruntime_pair.py"), arguments)
    };
    console.say(format!("{name}, {SIDE} x {SIDE} pixels, {} threads, milliseconds for a pair (least)", threads()))?;
    let mut rows = Vec::new();
    for keypoints in KEYPOINTS {
        let mut ours = vec![Vec::new(); models.len()];
        let mut theirs = Err("it was not asked".to_owned());
        let mut medians = Vec::new();
        let mut found = 0;
        for _ in 0..args.rounds {
            for ((_, model), times) in models.iter().zip(&mut ours) {
                let (count, taken) = milliseconds(model, &pattern, keypoints, args.runs)?;
                found = count;
                times.extend(taken);
            }
            let answer = ask(keypoints);
            medians.extend(answer.as_ref().map(|times| times.median_ms));
            theirs = match (theirs, answer) {
                (Ok(best), Ok(now)) => Ok(if now_is_less(&now, &best) { now } else { best }),
                (_, now) => now,
            };
        }
        let mut row = json!({ "keypoints": found });
        let mut line = format!("{found:>6} keypoints:");
        for ((runtime, _), times) in models.iter().zip(ours) {
            let least = times.iter().copied().fold(f64::INFINITY, f64::min);
            let middle = median(times).unwrap_or_default();
            line += &format!(" {} {middle:.0} ({least:.0}),", runtime.name());
            row[runtime.name()] = json!({ "median_ms": rounded(middle), "least_ms": rounded(least) });
        }
        let middle = median(medians).unwrap_or_default();
        match &theirs {
            Ok(peer) => {
                line += &format!(" Python's onnxruntime {} {middle:.0} ({:.0})", peer.version, peer.least_ms);
                row["python"] = json!({
                    "median_ms": rounded(middle), "least_ms": rounded(peer.least_ms),
                    "keypoints": peer.keypoints, "version": peer.version,
                });
            }
            Err(why) => {
                line += &format!(" no Python beside: {why}");
                row["python"] = Value::Null;
            }
        }
        console.say(line)?;
        rows.push(row);
    }
    console.result(&json!({ "model": name, "side": SIDE, "threads": threads(), "rows": rows }))
}

fn now_is_less(now: &PeerTimes, best: &PeerTimes) -> bool {
    now.least_ms < best.least_ms
}

/// How many keypoints were compared, and how long each of several runs took after one that warms up.
fn milliseconds(model: &Model, pattern: &Pattern, keypoints: usize, runs: u16) -> Result<(usize, Vec<f64>), Failure> {
    let pair = || {
        let watch = Stopwatch::start();
        let found = pattern.with_itself(model, keypoints)?;
        Ok::<_, Failure>((found.keypoints[0].len(), 1e3 * watch.seconds()))
    };
    let (found, _) = pair()?;
    let times: Result<Vec<f64>, Failure> = (0..runs).map(|_| Ok(pair()?.1)).collect();
    Ok((found, times?))
}
