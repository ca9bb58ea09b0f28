//! The installed probe-rs: a debug probe's program, driven as a child process.

use std::ffi::OsStr;
use std::io::ErrorKind;
use std::path::Path;
use std::process::{Command, Output, Stdio};

use crate::failure::Failure;

const PROGRAM: &str = "probe-rs";
/// The chip of the NUCLEO-G474RE, as probe-rs calls it.
const CHIP: &str = "STM32G474RETx";
/// The oldest that this was written for.
const OLDEST: [u32; 2] = [0, 32];

/// probe-rs, found and new enough.
pub struct ProbeRs<'a> {
    version: String,
    probe: Option<&'a str>,
}

impl<'a> ProbeRs<'a> {
    /// Looks for it. `probe` names one of several debug probes.
    pub fn find(probe: Option<&'a str>) -> Result<Self, Failure> {
        let output = run(&[OsStr::new("--version")])?;
        let said = String::from_utf8_lossy(&output.stdout);
        // "probe-rs 0.32.0 (git commit: ...)"
        let version = said.split_whitespace().nth(1).unwrap_or("of unknown version").to_owned();
        let numbers: Vec<u32> = version.split('.').map_while(|part| part.parse().ok()).collect();
        if numbers.len() < OLDEST.len() || numbers.as_slice() < OLDEST.as_slice() {
            let [major, minor] = OLDEST;
            return Err(Failure::device(format!(
                "the installed probe-rs is {version}, needed is {major}.{minor} or newer: cargo install probe-rs-tools --locked"
            )));
        }
        Ok(Self { version, probe })
    }

    /// Its version.
    pub fn version(&self) -> &str {
        &self.version
    }

    /// Writes an ELF file to where it is linked, and reads it back.
    pub fn download_elf(&self, file: &Path) -> Result<(), Failure> {
        self.carry_out("download", &[OsStr::new("--verify"), "--binary-format".as_ref(), "elf".as_ref(), file.as_ref()])
    }

    /// Writes raw bytes to `address`, and reads them back.
    pub fn download_bytes(&self, file: &Path, address: u32) -> Result<(), Failure> {
        let address = format!("{address:#010x}");
        let options = ["--verify", "--binary-format", "bin", "--base-address", &address].map(OsStr::new);
        self.carry_out("download", &[&options[..], &[file.as_os_str()]].concat())
    }

    /// Starts the chip.
    pub fn reset(&self) -> Result<(), Failure> {
        self.carry_out("reset", &[])
    }

    fn carry_out(&self, what: &str, arguments: &[&OsStr]) -> Result<(), Failure> {
        let mut all = [what, "--chip", CHIP, "--non-interactive"].map(OsStr::new).to_vec();
        if let Some(probe) = self.probe {
            all.extend(["--probe", probe].map(OsStr::new));
        }
        all.extend(arguments);
        let output = run(&all)?;
        if output.status.success() {
            return Ok(());
        }
        Err(Failure::device(explain(&[output.stdout, output.stderr].concat())))
    }
}

fn run(arguments: &[&OsStr]) -> Result<Output, Failure> {
    let mut command = Command::new(PROGRAM);
    command.args(arguments).stdin(Stdio::null()).output().map_err(|error| match error.kind() {
        ErrorKind::NotFound => Failure::device(
            "probe-rs is not installed, which writes flash through a debug probe: cargo install probe-rs-tools --locked, or \
             see https://probe.rs; with a boot loader on the board, 'vergence flash --serial' needs no probe",
        ),
        _ => Failure::device(format!("probe-rs cannot be run: {error}")),
    })
}

/// What went wrong, as far as its words are known, and the remedy.
fn explain(said: &[u8]) -> String {
    let said = String::from_utf8_lossy(said);
    let knows = |words: &[&str]| words.iter().any(|word| said.to_lowercase().contains(word));
    let remedy = if knows(&["permission", "access denied", "udev"]) {
        "the debug probe may not be used by you: install the udev rules of https://probe.rs/docs/getting-started/probe-setup, \
         then unplug and plug the board"
    } else if knows(&["multiple probes", "several probes"]) {
        "several debug probes are connected: name one with --probe, 'probe-rs list' shows them"
    } else if knows(&["no connected probes", "no probe", "probe was not found", "no debug probe"]) {
        "no debug probe is connected: plug the board's ST-LINK into USB, 'probe-rs list' should show it"
    } else if knows(&["resource busy", "in use", "already open"]) {
        "the debug probe is in use by another program, such as a debugger: end it first"
    } else if knows(&["verif"]) {
        "flash does not hold what was written: try again; if it stays so, the chip is worn or its option bytes protect it"
    } else if knows(&["chip", "core", "target"]) {
        "the chip does not answer as STM32G474RETx does: check that it is that board and that it is powered"
    } else {
        "probe-rs failed"
    };
    let last = said.lines().map(str::trim).filter(|line| !line.is_empty()).collect::<Vec<_>>();
    let told = last.get(last.len().saturating_sub(3)..).unwrap_or_default().join("; ");
    format!("{remedy} (probe-rs said: {told})")
}
