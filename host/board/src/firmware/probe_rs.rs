//! The installed probe-rs: a debug probe's program, driven as a child process.

use std::ffi::OsStr;
use std::io::{ErrorKind, Write};
use std::path::Path;
use std::process::{Command, Output, Stdio};

use vergence_image::layout::{FLASH_BASE, IMAGE, STATE};

use super::ProbeError;
use crate::update::FirmwareImage;

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
    ///
    /// # Errors
    /// [`ProbeError`].
    pub fn find(probe: Option<&'a str>) -> Result<Self, ProbeError> {
        let output = run(&[OsStr::new("--version")])?;
        let said = String::from_utf8_lossy(&output.stdout);
        // "probe-rs 0.32.0 (git commit: ...)"
        let version = said.split_whitespace().nth(1).unwrap_or("of unknown version").to_owned();
        let numbers: Vec<u32> = version.split('.').map_while(|part| part.parse().ok()).collect();
        if numbers.len() < OLDEST.len() || numbers.as_slice() < OLDEST.as_slice() {
            return Err(ProbeError::TooOld { found: version, oldest: OLDEST });
        }
        Ok(Self { version, probe })
    }

    /// Its version.
    #[must_use]
    pub fn version(&self) -> &str {
        &self.version
    }

    /// Writes an ELF file to where it is linked, and reads it back.
    ///
    /// # Errors
    /// [`ProbeError`].
    pub fn download_elf(&self, file: &Path) -> Result<(), ProbeError> {
        self.carry_out("download", &[OsStr::new("--verify"), "--binary-format".as_ref(), "elf".as_ref(), file.as_ref()])
    }

    /// Writes `image` where the boot loader looks for it, and reads it back; its seal is written behind it.
    ///
    /// # Errors
    /// [`ProbeError`].
    pub fn download_image(&self, image: &FlashContents) -> Result<(), ProbeError> {
        let fail = |error: std::io::Error| ProbeError::Temporary(error.to_string());
        let mut raw = tempfile::NamedTempFile::new().map_err(fail)?;
        raw.write_all(&image.0).map_err(fail)?;
        let address = format!("{:#010x}", FLASH_BASE + STATE.start);
        let options = ["--verify", "--binary-format", "bin", "--base-address", &address].map(OsStr::new);
        self.carry_out("download", &[&options[..], &[raw.path().as_os_str()]].concat())
    }

    /// Starts the chip.
    ///
    /// # Errors
    /// [`ProbeError`].
    pub fn reset(&self) -> Result<(), ProbeError> {
        self.carry_out("reset", &[])
    }

    fn carry_out(&self, what: &str, arguments: &[&OsStr]) -> Result<(), ProbeError> {
        let mut all = [what, "--chip", CHIP, "--non-interactive"].map(OsStr::new).to_vec();
        if let Some(probe) = self.probe {
            all.extend(["--probe", probe].map(OsStr::new));
        }
        all.extend(arguments);
        let output = run(&all)?;
        if output.status.success() {
            return Ok(());
        }
        Err(ProbeError::Failed(explain(&[output.stdout, output.stderr].concat())))
    }
}

/// What flash shall hold from the state pages on: no swap under way, the seal, and the image.
pub struct FlashContents(Vec<u8>);

impl FlashContents {
    /// The contents for `image`; `None` where it is too long.
    #[must_use]
    pub fn of(image: &FirmwareImage) -> Option<Self> {
        if image.bytes.len() > IMAGE.length as usize {
            return None;
        }
        let seal = [vec![0xFF; STATE.length as usize], image.seal.to_bytes().to_vec()].concat();
        let mut flash = vec![0xFF; (IMAGE.start - STATE.start) as usize];
        flash.get_mut(..seal.len())?.copy_from_slice(&seal);
        flash.extend_from_slice(&image.bytes);
        Some(Self(flash))
    }
}

fn run(arguments: &[&OsStr]) -> Result<Output, ProbeError> {
    let mut command = Command::new(PROGRAM);
    command.args(arguments).stdin(Stdio::null()).output().map_err(|error| match error.kind() {
        ErrorKind::NotFound => ProbeError::Missing,
        _ => ProbeError::Unusable(error.to_string()),
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
    let last_words = last.get(last.len().saturating_sub(3)..).unwrap_or_default().join("; ");
    format!("{remedy} (probe-rs said: {last_words})")
}
