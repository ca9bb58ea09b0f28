//! `vergence log`: what happens on the board, and what its firmware logs.

use std::io::{Write, stdout};
use std::path::{Path, PathBuf};
use std::time::Duration;

use serde_json::json;
use tokio::time::timeout;
use vergence_board::{Board, Followed, Follower, Source, describe_fault, event_in_words};
use vergence_rig::Rig;
use vergence_sim::{FirmwareLog, PlacedEntry};

use super::reconnect::Listening;
use crate::cli::CommonOptions;
use crate::console::Console;
use crate::failure::Failure;

/// Prints what happens on the board until Ctrl-C, beginning with what its flight recorder kept: starts, states, moves, stops,
/// refusals, switches, faults, each with its time since the board's start.
///
/// With --elf, the firmware's own log comes too: level, text, and the functions in which addresses lie. The board sends
/// each text once, to the first host that listens: texts that were sent while another verb ran are gone. When the link ends,
/// it waits until the board is back.
#[derive(Debug, clap::Args)]
pub struct Args {
    /// The ELF file of the firmware that runs on the board: it holds the texts of the firmware's log.
    #[arg(long, value_name = "FIRMWARE")]
    elf: Option<PathBuf>,
    /// Write the bytes of the firmware's log as they come and nothing else, for defmt-print.
    #[arg(long, conflicts_with = "elf")]
    raw: bool,
    /// Stop after so many entries, or with --raw after so many pieces.
    #[arg(long)]
    count: Option<u64>,
    #[command(flatten)]
    listening: Listening,
}

pub async fn run(args: &Args, common: &CommonOptions, console: Console) -> Result<(), Failure> {
    let mut program = args.elf.as_deref().map(Program::read).transpose()?;
    let left = args.count.unwrap_or(u64::MAX);
    let mut printer = Printer { raw: args.raw, left, next_event: 0, console };
    let listen = async |source: Source<'_>| match source {
        Source::Board(board) => printer.pass_on(board, program.as_mut()).await,
        Source::Driver(driver, rig) => printer.follow(driver, rig, program.as_mut()).await,
    };
    args.listening.to(common, console, listen).await
}

/// The firmware's log, and the ELF file that holds its texts.
struct Program<'a> {
    path: &'a Path,
    log: FirmwareLog,
}

impl<'a> Program<'a> {
    fn read(path: &'a Path) -> Result<Self, Failure> {
        let log = FirmwareLog::new(&vergence_files::read(path)?).map_err(|error| Failure::input(path, error))?;
        Ok(Self { path, log })
    }

    /// With the texts of another build the log would say anything.
    fn check(&self, board: &Board) -> Result<(), Failure> {
        let (given, runs) = (self.log.build(), board.info().build);
        if given == runs {
            return Ok(());
        }
        let problem = format!(
            "this is build {given:016x} and the board runs build {runs:016x}: give the ELF file of what was flashed"
        );
        Err(Failure::input(self.path, problem))
    }

    fn print(&mut self, bytes: &[u8], left: &mut u64, console: Console) -> Result<(), Failure> {
        for placed in self.log.push(bytes) {
            match placed {
                Ok(placed) if *left > 0 => {
                    *left -= 1;
                    console.say(placed.line())?;
                    let PlacedEntry { entry, places } = placed;
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

/// How long the firmware's log must be silent before the recorder is read: what waits in the log comes first.
const QUIET: Duration = Duration::from_millis(300);

/// What is still to be printed, over all links to the board.
struct Printer {
    raw: bool,
    /// Entries until the end.
    left: u64,
    /// Number of the recorder's event to be printed next.
    next_event: u32,
    console: Console,
}

impl Printer {
    async fn pass_on(&mut self, board: &mut Board, mut program: Option<&mut Program<'_>>) -> Result<(), Failure> {
        if let Some(program) = &program {
            program.check(board)?;
        }
        while self.left > 0 {
            match (timeout(QUIET, board.next_log()).await, &mut program) {
                (Ok(bytes), _) if self.raw => self.write_raw(&bytes?)?,
                (Ok(bytes), Some(program)) => program.print(&bytes?, &mut self.left, self.console)?,
                (Ok(bytes), None) => drop(bytes?),
                (Err(_), _) if self.raw => {}
                (Err(_), _) => self.print_events(board).await?,
            }
        }
        Ok(())
    }

    /// Prints what the driver of the board passes on: the firmware's log, and states and faults as the poses show them. The
    /// recorder is read again once the driver has ended.
    async fn follow(
        &mut self,
        driver: &mut Follower,
        rig: &Rig,
        mut program: Option<&mut Program<'_>>,
    ) -> Result<(), Failure> {
        let mut before = None;
        while self.left > 0 {
            match (driver.next().await?, &mut program) {
                (Followed::Pose(pose), _) if !self.raw => {
                    let now = Some((pose.state, pose.fault));
                    if before != now {
                        before = now;
                        let fault = pose.fault.map(|fault| format!("; {}", describe_fault(rig, &fault)));
                        let text = format!("state: {}{}", pose.state, fault.unwrap_or_default());
                        self.print(pose.at.0, &text)?;
                    }
                }
                (Followed::Log(bytes), _) if self.raw => self.write_raw(&bytes)?,
                (Followed::Log(bytes), Some(program)) => program.print(&bytes, &mut self.left, self.console)?,
                _ => {}
            }
        }
        Ok(())
    }

    /// Writes a piece of the firmware's log as it came.
    fn write_raw(&mut self, bytes: &[u8]) -> Result<(), Failure> {
        self.left -= 1;
        let mut out = stdout().lock();
        out.write_all(bytes).and_then(|()| out.flush()).map_err(|error| Failure::stdout(&error))
    }

    /// Prints one entry at a time of the board's clock, in microseconds.
    fn print(&mut self, board_us: u64, text: &str) -> Result<(), Failure> {
        self.left -= 1;
        self.console.say(format!("{:12.6} s board  {text}", board_us as f64 * 1e-6))?;
        self.console.result(&json!({ "board_us": board_us, "text": text }))
    }

    /// Prints what the flight recorder has kept since it was last read.
    async fn print_events(&mut self, board: &Board) -> Result<(), Failure> {
        let recorded = board.events_from(self.next_event).await?;
        self.next_event = recorded.next;
        for event in recorded.events.iter().take(usize::try_from(self.left).unwrap_or(usize::MAX)) {
            self.print(event.at.0, &event_in_words(board.rig(), &event.what))?;
        }
        Ok(())
    }
}
