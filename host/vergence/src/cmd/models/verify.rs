//! `vergence models verify`: are they what they were, and do they run?

use std::path::PathBuf;

use serde_json::json;
use vergence_matching::learned::{Model, Picture};

use crate::console::Console;
use crate::failure::Failure;
use crate::models::{ModelStore, Runtime, StoreOptions, load};
use crate::stopwatch::Stopwatch;

/// Reads every model, checks digests and tensors, and runs it on a drawn pattern on every runtime there is.
#[derive(Debug, clap::Args)]
pub struct Args {
    /// The ONNX Runtime library, such as libonnxruntime.so.
    #[arg(long, env = "ORT_DYLIB_PATH", value_name = "FILE")]
    onnxruntime: Option<PathBuf>,
    #[command(flatten)]
    store: StoreOptions,
}

/// Side of the drawn pattern in pixels.
const SIDE: usize = 256;
const KEYPOINTS: usize = 512;
/// Keypoints this near are the same, in pixels.
const SAME_PLACE: f32 = 0.5;

pub fn run(args: &Args, console: Console) -> Result<(), Failure> {
    let store = ModelStore::open(&args.store)?;
    let found = Runtime::find(args.onnxruntime.clone(), 1).map_err(|error| Failure::usage(error.to_string()))?;
    let mut runtimes = vec![Runtime::Rten];
    if matches!(found, Runtime::OnnxRuntime(..)) {
        runtimes.push(found);
    }
    let mut results = Vec::new();
    let mut failed = false;
    for name in store.names()? {
        for runtime in &runtimes {
            let outcome = load(&store.path(&name), runtime).and_then(|model| match_with_itself(&model));
            let told = match &outcome {
                Ok((matches, seconds)) => format!("ok: {matches} matches of a pattern with itself in {seconds:.2} s"),
                Err(failure) => failure.to_string(),
            };
            failed |= outcome.is_err();
            console.say(format!("{name} on {}: {told}", runtime.name()))?;
            results.push(json!({ "name": name, "runtime": runtime.name(), "ok": outcome.is_ok(), "message": told }));
        }
    }
    console.result(&json!({ "models": results }))?;
    if failed { Err(Failure::check("a model is not what it should be")) } else { Ok(()) }
}

/// A picture matched with itself: as many matches as keypoints, if all is well.
fn match_with_itself(model: &Model) -> Result<(usize, f64), Failure> {
    let watch = Stopwatch::start();
    let values = pattern();
    let picture = Picture { values: &values, width: SIDE, height: SIDE };
    let found = model
        .compare([picture, picture], KEYPOINTS, [&|_| true, &|_| true])
        .map_err(|error| Failure::check(error.to_string()))?;
    let same = |&&(i, j, _): &&(usize, usize, f32)| {
        let [[x, y], [to_x, to_y]] = [found.keypoints[0][i], found.keypoints[1][j]];
        (to_x - x).hypot(to_y - y) < SAME_PLACE
    };
    let alike = found.matches.iter().filter(same).count();
    if alike * 2 < found.keypoints[0].len() || alike == 0 {
        let keypoints = found.keypoints[0].len();
        return Err(Failure::check(format!("only {alike} of {keypoints} keypoints of a pattern match themselves")));
    }
    Ok((alike, watch.seconds()))
}

/// Squares of all sizes and greys, the same every time.
fn pattern() -> Vec<f32> {
    let mut values = vec![0.5; SIDE * SIDE];
    let mut state: u32 = 1;
    // A linear congruential generator (Numerical Recipes, 2nd ed., §7.1): a pattern needs no better one.
    let mut next = |below: usize| {
        state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
        (state >> 8) as usize % below
    };
    for _ in 0..400 {
        let (x, y, size, grey) = (next(SIDE), next(SIDE), 6 + next(24), next(256) as f32 / 255.0);
        for row in y..(y + size).min(SIDE) {
            values[row * SIDE + x..row * SIDE + (x + size).min(SIDE)].fill(grey);
        }
    }
    values
}
