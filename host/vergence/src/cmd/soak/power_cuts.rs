//! `vergence soak --power-cuts`: power cuts in the middle of a firmware update.

use std::path::{Path, PathBuf};

use vergence_files::write_whole;
use vergence_image::sha256;
use vergence_mcu::Firmware;
use vergence_rig::rounded;
use vergence_soak::power_cuts::{CutState, Journey, SignedImage, Sweep};

use crate::console::Console;
use crate::failure::Failure;
use crate::firmware::{APPLICATION, BOOT_LOADER, DEVELOPMENT, SecretKey, hex};
use crate::stopwatch::Stopwatch;

/// Cuts after which the state is saved and the clock is read.
const CHUNK: usize = 64;

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

pub fn run(options: &Options, cuts: usize, console: Console) -> Result<(), Failure> {
    let (sweep, programs) = prepare(options)?;
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
    let images = SignedImage::before_and_after(&application, |header| key.seal(header));
    let sweep = Sweep::new(&boot_loader, images, Journey::Update)
        .map_err(|problem| Failure::check(format!("an update without power cuts does not work: {problem}")))?;
    Ok((sweep, hex(&sha256(&[elf, boot_elf].concat()))))
}
