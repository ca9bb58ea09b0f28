//! `vergence log`: what the firmware says of itself.

use std::io::{Write, stdout};
use std::path::{Path, PathBuf};

use serde_json::json;
use vergence_mcu::{Firmware, LogDecoder, LogEntry};

use super::connect::connect_any;
use super::reconnect::Listening;
use crate::board::Board;
use crate::cli::Globals;
use crate::console::Console;
use crate::failure::Failure;
use crate::firmware::{Hardware, build_of, flatten};

/// Prints the firmware's log until Ctrl-C: time since the board's start, level, text; addresses of code are followed by the
/// names of their functions. The board sends it when it has nothing better to send, and keeps what fits until somebody
/// listens. When the link ends, it waits until the board is back.
#[derive(Debug, clap::Args)]
pub struct Args {
    /// The ELF file of the firmware that runs on the board: it holds the texts.
    #[arg(long, value_name = "FIRMWARE", required_unless_present = "raw")]
    elf: Option<PathBuf>,
    /// Write the bytes as they come, for defmt-print.
    #[arg(long)]
    raw: bool,
    /// Stop after so many entries, or with --raw after so many pieces.
    #[arg(long)]
    count: Option<u64>,
    #[command(flatten)]
    listening: Listening,
}

pub async fn run(args: &Args, globals: &Globals, console: Console) -> Result<(), Failure> {
    let mut program = args.elf.as_deref().map(Program::read).transpose()?;
    let mut left = args.count.unwrap_or(u64::MAX);
    let board = connect_any(globals, console, "log").await?;
    let listen = async |board: &mut Board| pass_on(args.raw, board, program.as_mut(), &mut left, console).await;
    args.listening.to(board, globals, console, listen).await
}

/// The firmware that its ELF file describes.
struct Program<'a> {
    path: &'a Path,
    firmware: Firmware,
    decoder: LogDecoder,
    build: u64,
}

impl<'a> Program<'a> {
    fn read(path: &'a Path) -> Result<Self, Failure> {
        let bytes = std::fs::read(path).map_err(|error| Failure::input(path, error))?;
        let firmware = Firmware::from_elf(&bytes).map_err(|error| Failure::input(path, error))?;
        let decoder = LogDecoder::new(&firmware).map_err(|error| Failure::input(path, error))?;
        let image = flatten(&bytes, Hardware::NucleoG474).map_err(|problem| Failure::input(path, problem))?;
        Ok(Self { path, firmware, decoder, build: build_of(&image) })
    }

    /// With the texts of another build the log would say anything.
    fn check(&self, board: &Board) -> Result<(), Failure> {
        let runs = board.info().build;
        if self.build == runs {
            return Ok(());
        }
        let problem = format!(
            "this is build {:016x} and the board runs build {runs:016x}: give the ELF file of what was flashed",
            self.build
        );
        Err(Failure::input(self.path, problem))
    }

    fn tell(&mut self, bytes: &[u8], left: &mut u64, console: Console) -> Result<(), Failure> {
        for entry in self.decoder.push(bytes) {
            match entry {
                Ok(entry) if *left > 0 => {
                    *left -= 1;
                    let places = places(&entry.text, &self.firmware);
                    console.say(line(&entry, &places))?;
                    console.result(&json!({
                        "time": entry.time, "level": entry.level, "text": entry.text, "places": places,
                    }))?;
                }
                Ok(_) => {}
                Err(damaged) => console.warn(damaged),
            }
        }
        Ok(())
    }
}

async fn pass_on(
    raw: bool,
    board: &mut Board,
    mut program: Option<&mut Program<'_>>,
    left: &mut u64,
    console: Console,
) -> Result<(), Failure> {
    if let Some(program) = &program {
        program.check(board)?;
    }
    while *left > 0 {
        let bytes = board.next_log().await?;
        if raw {
            *left -= 1;
            let mut out = stdout().lock();
            out.write_all(&bytes).and_then(|()| out.flush()).map_err(|error| Failure::stdout(&error))?;
        } else if let Some(program) = &mut program {
            program.tell(&bytes, left, console)?;
        }
    }
    Ok(())
}

fn line(entry: &LogEntry, places: &[String]) -> String {
    let (time, level) = (entry.time.as_deref().unwrap_or_default(), entry.level.as_deref().unwrap_or_default());
    let places: String = places.iter().map(|place| format!("\n{:21}{place}", "")).collect();
    format!("{time:>12} s {level:5}  {}{places}", entry.text)
}

/// The functions that addresses in `text` lie in. Odd ones are return addresses: the call ends right before them, and may
/// be the last that its function does.
fn places(text: &str, firmware: &Firmware) -> Vec<String> {
    let words = text.split(|character: char| !character.is_ascii_alphanumeric());
    let addresses = words.filter_map(|word| u32::from_str_radix(word.strip_prefix("0x")?, 16).ok());
    let at = |address: u32| if address & 1 == 1 { (address & !1).saturating_sub(2) } else { address };
    addresses.filter_map(|address| Some(format!("{address:#010x} {}", firmware.symbol_at(at(address))?))).collect()
}
