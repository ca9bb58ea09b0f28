//! `vergence soak --power-cuts`: power cuts in the middle of a firmware update, or of what else writes the flash.

use std::path::PathBuf;

use clap::builder::PossibleValuesParser;
use vergence_files::write_whole;
use vergence_rig::rounded;
use vergence_soak::power_cuts::{CutState, Journey, Sweep};

use super::programs::{self, Programs};
use crate::console::Console;
use crate::failure::Failure;
use crate::stopwatch::Stopwatch;

/// Cuts after which the state is saved and the clock is read.
const CHUNK: usize = 64;

/// Options of power cuts.
#[derive(Debug, clap::Args)]
pub struct Options {
    /// Cut the power so many times in the middle of a firmware update instead: at every erasure first, then at every word
    /// of the swap's state, then at all others, spread over the update; beyond that with other damage. The boot loader and
    /// the application are those of the board, on the simulated chip; the word or page under way is left torn.
    #[arg(long, value_name = "COUNT", conflicts_with_all = ["scenarios", "seed", "only", "differential"])]
    power_cuts: Option<usize>,
    /// What is done while the power is cut: an update; one that is not confirmed and taken back; a rollback; an update
    /// through the recovery; or settings that are saved.
    #[arg(long, value_name = "NAME", requires = "power_cuts", default_value = "update", value_parser = journey_names())]
    journey: String,
    /// Keeps the counts in this file, and continues with those that it holds.
    #[arg(long, value_name = "FILE", requires = "power_cuts")]
    state: Option<PathBuf>,
}

impl Options {
    /// Cuts that were asked for; `None` for the scenarios.
    pub const fn cuts(&self) -> Option<usize> {
        self.power_cuts
    }

    fn journey(&self) -> Journey {
        Journey::ALL.into_iter().find(|journey| journey.name() == self.journey).unwrap_or(Journey::Update)
    }
}

fn journey_names() -> PossibleValuesParser {
    PossibleValuesParser::new(Journey::ALL.map(Journey::name))
}

pub fn run(options: &Options, programs: &programs::Options, cuts: usize, console: Console) -> Result<(), Failure> {
    let (sweep, programs) = prepare(programs.read()?, options.journey())?;
    let mut state = match &options.state {
        Some(path) if path.exists() => {
            let bytes = std::fs::read(path).map_err(|error| Failure::input(path, error))?;
            CutState::read(&bytes, &programs).map_err(|error| Failure::input(path, error))?
        }
        _ => CutState::new(programs),
    };
    let (stopwatch, progress) = (Stopwatch::start(), console.progress("cutting"));
    while state.done < cuts {
        let end = cuts.min(state.done + CHUNK);
        state.cut(&sweep, end);
        if let Some(path) = &options.state {
            write_whole(path, format!("{:#}\n", state.json()).as_bytes())?;
        }
        progress.set_message(format!("{end} of {cuts} cuts"));
    }
    progress.finish_and_clear();
    let seconds = stopwatch.seconds();
    console.say(format!("{}; {seconds:.1} s", state.in_words(&sweep)))?;
    let mut result = state.figures(&sweep);
    result["seconds"] = rounded(seconds).into();
    console.result(&result)?;
    state.tally.accusation().map_or(Ok(()), |bricked| Err(Failure::check(bricked)))
}

fn prepare(programs: Programs, journey: Journey) -> Result<(Sweep, String), Failure> {
    let sweep = Sweep::new(&programs.boot_loader, programs.images, journey).map_err(|problem| {
        Failure::check(format!("{} without power cuts does not work: {problem}", journey.in_words()))
    })?;
    let digest = if journey == Journey::Update { programs.digest } else { programs.digest + " " + journey.name() };
    Ok((sweep, digest))
}
