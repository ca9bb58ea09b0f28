//! `vergence bench networks`: the time that networks take for a pair.

use serde_json::json;
use vergence_bench::networks::{NetworkBench, SIDE};
use vergence_models::threads;

use crate::cmd::model_options::{RuntimeOptions, StoreOptions};
use crate::console::Console;
use crate::failure::Failure;
use crate::stopwatch::clock;

/// Extracts the keypoints of two images of 512 x 512 pixels and matches them, by every runtime of this machine and by
/// Python's onnxruntime on the same files, all with as many threads as the machine has. They take turns; milliseconds for
/// a pair, median and least. Without onnxruntime in Python (python3 -m pip install onnxruntime) its figures are null.
#[derive(Debug, clap::Args)]
pub struct Args {
    /// The model; without it the only one that is kept.
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

const KEYPOINTS: [usize; 2] = [1024, 2048];

pub fn run(args: &Args, console: Console) -> Result<(), Failure> {
    let store = args.store.store()?;
    let name = match (&args.model, store.names()?.as_slice()) {
        (Some(name), _) => name.clone(),
        (None, [only]) => only.clone(),
        (None, []) => return Err(Failure::usage("no model is kept: see 'vergence models'")),
        (None, names) => return Err(Failure::usage(format!("say which model with --model: {}", names.join(", ")))),
    };
    let folder = store.path(&name);
    let bench = NetworkBench::new(&folder, &args.runtime.all()?, &args.python, clock)?;
    console.say(format!("{name}, {SIDE} x {SIDE} pixels, {} threads, milliseconds for a pair (least)", threads()))?;
    let mut rows = Vec::new();
    for keypoints in KEYPOINTS {
        let times = bench.times(keypoints, args.rounds, args.runs)?;
        console.say(times.in_words())?;
        if let Err(why) = &times.python {
            console.say(format!("        Python's onnxruntime was not measured: {why}"))?;
        }
        rows.push(times.json());
    }
    console.result(&json!({ "model": name, "side": SIDE, "threads": threads(), "rows": rows }))
}
