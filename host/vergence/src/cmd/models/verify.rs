//! `vergence models verify`: are they what they were, do they run, and how fast?

use serde_json::json;
use vergence_matching::learned::Model;

use crate::console::Console;
use crate::failure::Failure;
use crate::models::{ModelStore, Pattern, RuntimeOptions, SMALL_KEYPOINTS, Speed, StoreOptions, load, threads};

/// Reads every model, checks digests and tensors, and runs it on a drawn pattern on every runtime there is. Which was
/// faster is kept beside the model: it serves from then on.
#[derive(Debug, clap::Args)]
pub struct Args {
    #[command(flatten)]
    runtime: RuntimeOptions,
    #[command(flatten)]
    store: StoreOptions,
}

/// Keypoints this near are the same, in pixels.
const SAME_PLACE: f32 = 0.5;

pub fn run(args: &Args, console: Console) -> Result<(), Failure> {
    let store = ModelStore::open(&args.store)?;
    let runtimes = args.runtime.all()?;
    let mut results = Vec::new();
    let mut failed = false;
    for name in store.names()? {
        let folder = store.path(&name);
        let outcomes: Vec<_> = runtimes
            .iter()
            .map(|runtime| (runtime, load(&folder, runtime).and_then(|model| match_with_itself(&model))))
            .collect();
        let sound = outcomes.iter().all(|(_, outcome)| outcome.is_ok());
        let speed = if sound { Speed::measure(&folder, &runtimes, threads())? } else { Speed::default() };
        for (runtime, outcome) in outcomes {
            let seconds = speed.of(runtime);
            let told = match (&outcome, seconds) {
                (Ok(matches), Some(seconds)) => {
                    format!("ok: {matches} matches of a pattern with itself, {seconds:.2} s")
                }
                (Ok(matches), None) => format!("ok: {matches} matches of a pattern with itself"),
                (Err(failure), _) => failure.to_string(),
            };
            console.say(format!("{name} on {}: {told}", runtime.name()))?;
            results.push(json!({
                "name": name, "runtime": runtime.name(), "ok": outcome.is_ok(), "message": told, "seconds": seconds,
            }));
        }
        failed |= !sound;
    }
    console.result(&json!({ "models": results }))?;
    if failed { Err(Failure::check("a model is not what it should be")) } else { Ok(()) }
}

/// How many keypoints of the pattern find themselves.
fn match_with_itself(model: &Model) -> Result<usize, Failure> {
    let found = Pattern::small().with_itself(model, SMALL_KEYPOINTS)?;
    let same = |&&(i, j, _): &&(usize, usize, f32)| {
        let [[x, y], [to_x, to_y]] = [found.keypoints[0][i], found.keypoints[1][j]];
        (to_x - x).hypot(to_y - y) < SAME_PLACE
    };
    let alike = found.matches.iter().filter(same).count();
    if alike * 2 < found.keypoints[0].len() || alike == 0 {
        let keypoints = found.keypoints[0].len();
        return Err(Failure::check(format!("only {alike} of {keypoints} keypoints of a pattern match themselves")));
    }
    Ok(alike)
}
