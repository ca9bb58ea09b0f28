//! `vergence soak --power-cuts`: power cuts in the middle of a firmware update.

use std::path::{Path, PathBuf};

use serde_json::{Value, json};
use vergence_files::write_whole;
use vergence_image::layout::{ACTIVE, FLASH_BASE};
use vergence_image::notes::version_of;
use vergence_image::sha256;
use vergence_mcu::Firmware;
use vergence_rig::rounded;
use vergence_soak::power_cuts::{CutTally, Journey, SignedImage, Sweep, twin};

use crate::console::Console;
use crate::failure::Failure;
use crate::firmware::{APPLICATION, BOOT_LOADER, DEVELOPMENT, SecretKey, hex};
use crate::stopwatch::Stopwatch;

/// Cuts after which the state is saved and the clock is read.
const CHUNK: usize = 64;
/// Most bricked boards that are printed; more are only counted.
const MOST_TOLD: usize = 20;

/// Options of power cuts.
#[derive(Debug, clap::Args)]
pub struct Options {
    /// Cut the power so many times in the middle of a firmware update instead: at every erasure first, then at every word
    /// of the swap's state, then at all others, spread over the update; beyond that with other damage. The boot loader and
    /// the application are those of the board, on the simulated chip; the word or page under way is left torn.
    #[arg(long, value_name = "COUNT", conflicts_with_all = ["scenarios", "seed", "only"])]
    power_cuts: Option<usize>,
    /// The application, for the image before the update and, in other words, the one after it.
    #[arg(long, value_name = "ELF", requires = "power_cuts", default_value = APPLICATION)]
    elf: PathBuf,
    /// The boot loader.
    #[arg(long, value_name = "ELF", requires = "power_cuts", default_value = BOOT_LOADER)]
    boot_loader: PathBuf,
    /// Keeps the counts in this file, and continues with those that it holds.
    #[arg(long, value_name = "FILE", requires = "power_cuts")]
    state: Option<PathBuf>,
}

impl Options {
    /// Cuts that were asked for; `None` for the scenarios.
    pub const fn cuts(&self) -> Option<usize> {
        self.power_cuts
    }
}

/// What was counted so far, and of which programs.
struct State {
    programs: String,
    done: usize,
    tally: CutTally,
}

pub fn run(options: &Options, cuts: usize, console: Console) -> Result<(), Failure> {
    let (sweep, programs) = prepare(options)?;
    let mut state = match &options.state {
        Some(path) if path.exists() => State::read(path, &programs)?,
        _ => State { programs, done: 0, tally: CutTally::default() },
    };
    let (stopwatch, progress) = (Stopwatch::start(), console.progress("cutting"));
    while state.done < cuts {
        let end = cuts.min(state.done + CHUNK);
        state.tally.merge(&sweep.tally(&sweep.cut(state.done..end)));
        state.done = end;
        if let Some(path) = &options.state {
            write_whole(path, format!("{:#}\n", state.in_json()).as_bytes())?;
        }
        progress.set_message(format!("{end} of {cuts} cuts"));
    }
    progress.finish_and_clear();
    tell(&sweep, &state, stopwatch.seconds(), console)
}

fn prepare(options: &Options) -> Result<(Sweep, String), Failure> {
    let read = |path: &Path| {
        let bytes = std::fs::read(path).map_err(|error| {
            Failure::input(path, format!("{error}; docs/firmware.md says how the firmware is built"))
        })?;
        let firmware = Firmware::from_elf(&bytes).map_err(|error| Failure::input(path, error))?;
        Ok::<_, Failure>((firmware, bytes))
    };
    let ((application, elf), (boot_loader, boot_elf)) = (read(&options.elf)?, read(&options.boot_loader)?);
    let key = SecretKey::named(Path::new(DEVELOPMENT))?;
    let images = [application.flat(FLASH_BASE + ACTIVE.start), twin(&application)].map(|bytes| {
        let version = version_of(&bytes).unwrap_or_default();
        SignedImage::new(bytes, version, |header| key.seal(header))
    });
    let sweep = Sweep::new(&boot_loader, images, Journey::Update)
        .map_err(|problem| Failure::check(format!("an update without power cuts does not work: {problem}")))?;
    Ok((sweep, hex(&sha256(&[elf, boot_elf].concat()))))
}

fn tell(sweep: &Sweep, state: &State, seconds: f64, console: Console) -> Result<(), Failure> {
    let tally = &state.tally;
    let [old, new, recovery, bricked] = tally.endings();
    console
        .say(format!("{:<18}{:>8}{:>10}{:>10}{:>10}{:>9}", "cut at", "cuts", "old", "new", "recovery", "bricked"))?;
    for (name, row) in ["an erasure", "a word of state", "another word"].iter().zip(tally.by_operation) {
        let [old, new, recovery, bricked] = row;
        let cuts: u64 = row.iter().sum();
        console.say(format!("{name:<18}{cuts:>8}{old:>10}{new:>10}{recovery:>10}{bricked:>9}"))?;
    }
    console.say(format!(
        "{} operations of the flash in an update; {} cuts, {} starts made, the others equal one of these; {} updated again; \
         {seconds:.1} s",
        sweep.operations().len(),
        tally.cuts(),
        tally.started,
        tally.updated,
    ))?;
    console.result(&json!({
        "flash_operations": sweep.operations().len(),
        "cuts": tally.cuts(),
        "bricked": bricked,
        "booted_old": old,
        "booted_new": new,
        "recovery": recovery,
        "starts_made": tally.started,
        "updated_again": tally.updated,
        "seconds": rounded(seconds),
    }))?;
    accuse(tally)
}

fn accuse(tally: &CutTally) -> Result<(), Failure> {
    if tally.bricked.is_empty() {
        return Ok(());
    }
    let lines: Vec<String> =
        tally.bricked.iter().take(MOST_TOLD).map(|(number, why)| format!("  cut {number}: {why}")).collect();
    Err(Failure::check(format!("{} boards bricked:\n{}", tally.bricked.len(), lines.join("\n"))))
}

impl State {
    fn in_json(&self) -> Value {
        json!({
            "programs": self.programs,
            "done": self.done,
            "by_operation": self.tally.by_operation,
            "started": self.tally.started,
            "updated": self.tally.updated,
            "bricked": self.tally.bricked,
        })
    }

    fn read(path: &Path, programs: &str) -> Result<Self, Failure> {
        let bytes = std::fs::read(path).map_err(|error| Failure::input(path, error))?;
        let damaged = |error: &dyn std::fmt::Display| Failure::input(path, format!("no state of power cuts: {error}"));
        let kept: Value = serde_json::from_slice(&bytes).map_err(|error| damaged(&error))?;
        if kept["programs"] != programs {
            return Err(Failure::input(path, "these cuts were made with other programs: take another file"));
        }
        let field = |name: &str| kept[name].clone();
        let number = |name: &str| field(name).as_u64().ok_or_else(|| damaged(&format!("'{name}' is missing")));
        let tally = CutTally {
            by_operation: serde_json::from_value(field("by_operation")).map_err(|error| damaged(&error))?,
            started: number("started")?,
            updated: number("updated")?,
            bricked: serde_json::from_value(field("bricked")).map_err(|error| damaged(&error))?,
        };
        Ok(Self { programs: programs.to_owned(), done: number("done")? as usize, tally })
    }
}
