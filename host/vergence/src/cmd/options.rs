//! Options that several verbs share: the port, the rig file, and what a session with a board needs.

use std::path::PathBuf;

use vergence_calibration_input::Slots;
use vergence_output::TableFormat;

use crate::failure::Failure;

/// Speed of a serial port unless --baud says otherwise, in bits per second.
const BAUD: u32 = 921_600;
/// How long a board may go without a heartbeat unless --lease says otherwise, in milliseconds.
const LEASE_MS: u16 = 100;

/// Names the folder that calibrations are kept in.
const STORE_VARIABLE: &str = "VERGENCE_STORE";

/// Where calibrations are kept.
#[derive(Clone, Debug, Default, clap::Args)]
pub struct StoreOptions {
    /// The folder that calibrations are kept in. Without it, vergence/calibrations in the user's data folder.
    #[arg(long, env = STORE_VARIABLE, value_name = "DIR")]
    store: Option<PathBuf>,
}

impl StoreOptions {
    /// The store; nothing is written.
    ///
    /// # Errors
    /// Where no folder is named and the user has no data folder.
    pub fn open(&self) -> Result<Slots, Failure> {
        Ok(Slots::open(self.store.clone())?)
    }
}

/// The rig file that is active in the store of the environment; `None` where there is no store, or none is active.
///
/// # Errors
/// Where the store is there and cannot be read.
pub fn active_rig() -> Result<Option<PathBuf>, Failure> {
    let store = std::env::var_os(STORE_VARIABLE).map(PathBuf::from);
    let Ok(slots) = Slots::open(store) else { return Ok(None) };
    Ok(slots.active_rig()?)
}

/// The options of a verb beside shared `options`, of which it takes only those that act on it.
#[derive(Debug, clap::Args)]
pub struct With<O: clap::Args, A: clap::Args> {
    // First, so that the description of the verb is that of its own arguments.
    #[command(flatten)]
    pub options: O,
    #[command(flatten)]
    pub args: A,
}

#[derive(Clone, Debug, clap::Args)]
pub struct PortOptions {
    /// The board: a serial device, tcp:HOST:PORT, or sim for a simulated one in this process; sim:FIRMWARE runs this ELF file
    /// or signed image on a simulated chip. Without it, the only serial device there is.
    #[arg(long, global = true, env = "VERGENCE_PORT", value_name = "PORT", help_heading = "Board")]
    port: Option<String>,
    /// Speed of a serial port.
    #[arg(long, global = true, default_value_t = BAUD, help_heading = "Board")]
    baud: u32,
}

#[derive(Clone, Debug, clap::Args)]
pub struct RigFileOptions {
    /// The rig file. Without it, the active calibration (see `calibrate use`), or else the built-in bench.
    #[arg(long, global = true, env = "VERGENCE_RIG", value_name = "FILE")]
    rig: Option<PathBuf>,
}

#[derive(Clone, Debug, clap::Args)]
pub struct BoardOptions {
    #[command(flatten)]
    port: PortOptions,
    #[command(flatten)]
    rig: RigFileOptions,
    /// How long the board may go without hearing from this program before it brakes, 20ms to 1s.
    #[arg(long, global = true, default_value = "100ms", value_parser = parse_lease, value_name = "TIME", help_heading = "Board")]
    lease: u16,
}

/// The board and the rig that a verb works with.
#[derive(Clone, Debug)]
pub struct CommonOptions {
    /// The port that was named.
    pub port: Option<String>,
    /// Speed of a serial port, in bits per second.
    pub baud: u32,
    /// The rig file; `None` for the built-in bench.
    pub rig: Option<PathBuf>,
    /// How long the board may go without a heartbeat, in milliseconds.
    pub lease: u16,
}

/// Options that say which board or rig a verb works with.
pub trait Choice {
    /// The choice as it was given.
    fn given(&self) -> CommonOptions;

    /// The choice with the rig of the active calibration where no rig file was named.
    ///
    /// # Errors
    /// Where the store of calibrations cannot be read.
    fn chosen(&self) -> Result<CommonOptions, Failure> {
        let given = self.given();
        let rig = match given.rig {
            Some(rig) => Some(rig),
            None => active_rig()?,
        };
        Ok(CommonOptions { rig, ..given })
    }
}

impl Choice for PortOptions {
    fn given(&self) -> CommonOptions {
        CommonOptions { port: self.port.clone(), baud: self.baud, rig: None, lease: LEASE_MS }
    }
}

impl Choice for RigFileOptions {
    fn given(&self) -> CommonOptions {
        CommonOptions { port: None, baud: BAUD, rig: self.rig.clone(), lease: LEASE_MS }
    }
}

impl Choice for BoardOptions {
    fn given(&self) -> CommonOptions {
        CommonOptions { rig: self.rig.rig.clone(), lease: self.lease, ..self.port.given() }
    }
}

/// The format of a table that is written beside a cloud.
#[derive(Clone, Copy, Debug, PartialEq, Eq, clap::ValueEnum)]
pub enum TableOption {
    /// Comma-separated, with the names of the columns in the first line.
    Csv,
    /// `{"about", "columns", "rows"}`.
    Json,
}

impl From<TableOption> for TableFormat {
    fn from(option: TableOption) -> Self {
        match option {
            TableOption::Csv => Self::Csv,
            TableOption::Json => Self::Json,
        }
    }
}

/// A duration that the board accepts as a lease, in milliseconds.
fn parse_lease(text: &str) -> Result<u16, String> {
    let duration: std::time::Duration = humantime::parse_duration(text).map_err(|error| error.to_string())?;
    match u16::try_from(duration.as_millis()) {
        Ok(ms @ 20..=1000) => Ok(ms),
        _ => Err("a lease is 20ms to 1s".into()),
    }
}
