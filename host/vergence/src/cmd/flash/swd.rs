//! `vergence flash --swd`: writing flash through a debug probe.

use std::io::Write;
use std::path::Path;
use std::time::Duration;

use serde_json::{Value, json};
use vergence_board::{FirmwareImage, hardware_name};
use vergence_image::layout::{ACTIVE, BOOTLOADER, CAPACITY, FLASH_BASE, HARDWARE, STATE};
use vergence_protocol::management::Identity;

use super::probe::ProbeRs;
use super::{connect, identity_json, tell};
use crate::cli::Globals;
use crate::console::Console;
use crate::failure::Failure;
use crate::firmware::{elf_start, header_json, is_elf, read_image};

/// How long the board may take to start.
const START_PATIENCE: Duration = Duration::from_secs(10);

pub async fn run(file: &Path, probe: Option<&str>, globals: &Globals, console: Console) -> Result<(), Failure> {
    let content = std::fs::read(file).map_err(|error| Failure::input(file, error))?;
    if is_elf(&content) {
        check_boot_loader(file, &content)?;
        write(probe, console, |probe_rs| probe_rs.download_elf(file))?;
        let board = ask(globals).await?;
        tell(&board, console)?;
        return console.result(&json!({ "image": Value::Null, "after": identity_json(&board) }));
    }
    let image = read_image(file)?;
    if image.header().hardware != HARDWARE {
        let hardware = hardware_name(image.header().hardware);
        return Err(Failure::input(
            file,
            format!("the image is for {hardware}, a debug probe reaches nucleo-g474 only"),
        ));
    }
    let flash = in_flash(&image).ok_or_else(|| Failure::input(file, "the image is too long"))?;
    write(probe, console, |probe_rs| {
        let fail = |error| Failure::device(format!("no temporary file can be written: {error}"));
        let mut raw = tempfile::NamedTempFile::new().map_err(fail)?;
        raw.write_all(&flash).map_err(fail)?;
        probe_rs.download_bytes(raw.path(), FLASH_BASE + STATE.start)
    })?;
    let board = ask(globals).await?;
    tell(&board, console)?;
    console.result(&json!({ "image": header_json(image.header()), "after": identity_json(&board) }))?;
    if board.build == image.header().build {
        return Ok(());
    }
    Err(Failure::check(format!(
        "the board runs build {:016x}, not {:016x} that was written: is another board on the serial port, or does its boot \
         loader trust another key? 'vergence image info' shows whose the image is",
        board.build,
        image.header().build
    )))
}

/// An ELF file has no seal, so the boot loader would not start it: it can only be the boot loader itself.
fn check_boot_loader(file: &Path, content: &[u8]) -> Result<(), Failure> {
    let start = elf_start(content).map_err(|problem| Failure::input(file, problem))?;
    if start == FLASH_BASE + BOOTLOADER.start {
        return Ok(());
    }
    Err(Failure::input(
        file,
        format!(
            "this ELF file starts at {start:#010x} and is not the boot loader, which starts signed images only: sign it with \
             'vergence image sign' and flash the image"
        ),
    ))
}

/// What flash shall hold from the state page on: no swap under way, the image, and its seal behind.
fn in_flash(image: &FirmwareImage) -> Option<Vec<u8>> {
    let mut flash = vec![0xFF; (STATE.length + ACTIVE.length) as usize];
    let (code, behind) = flash.get_mut(STATE.length as usize..)?.split_at_mut_checked(CAPACITY as usize)?;
    code.get_mut(..image.bytes.len())?.copy_from_slice(&image.bytes);
    let seal = image.seal.to_bytes();
    behind.get_mut(..seal.len())?.copy_from_slice(&seal);
    Some(flash)
}

fn write(
    probe: Option<&str>,
    console: Console,
    download: impl FnOnce(&ProbeRs<'_>) -> Result<(), Failure>,
) -> Result<(), Failure> {
    let progress = console.progress("writing flash");
    let probe_rs = ProbeRs::find(probe)?;
    download(&probe_rs)?;
    probe_rs.reset()?;
    progress.finish_and_clear();
    console.say(format!("written and verified with probe-rs {}", probe_rs.version()))
}

/// Who started.
async fn ask(globals: &Globals) -> Result<Identity, Failure> {
    let unasked = |failure: &dyn std::fmt::Display| {
        Failure::device(format!("the flash is written, but the board could not be asked what it runs: {failure}"))
    };
    let mut link = connect(globals).await.map_err(|failure| unasked(&failure))?;
    link.identify_within(START_PATIENCE).await.map_err(|error| unasked(&error))
}
