//! `vergence flash --swd`: writing flash through a debug probe.

use std::path::Path;
use std::time::Duration;

use serde_json::{Value, json};
use vergence_board::{FlashContents, ProbeError, ProbeRs, hardware_name, identity_json, identity_words};
use vergence_image::layout::HARDWARE;
use vergence_protocol::management::Identity;
use vergence_sim::{check_boot_loader, is_elf};

use super::connect;
use crate::cli::CommonOptions;
use crate::console::Console;
use crate::failure::Failure;
use crate::firmware::{header_json, read_image};

/// How long the board may take to start.
const START_PATIENCE: Duration = Duration::from_secs(10);

pub async fn run(file: &Path, probe: Option<&str>, common: &CommonOptions, console: Console) -> Result<(), Failure> {
    let content = vergence_files::read(file)?;
    if is_elf(&content) {
        check_boot_loader(&content).map_err(|error| Failure::input(file, error))?;
        write(probe, console, |probe_rs| probe_rs.download_elf(file))?;
        let board = ask(common).await?;
        console.say(identity_words(&board))?;
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
    let flash = FlashContents::of(&image).ok_or_else(|| Failure::input(file, "the image is too long"))?;
    write(probe, console, |probe_rs| probe_rs.download_image(&flash))?;
    let board = ask(common).await?;
    console.say(identity_words(&board))?;
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

fn write(
    probe: Option<&str>,
    console: Console,
    download: impl FnOnce(&ProbeRs<'_>) -> Result<(), ProbeError>,
) -> Result<(), Failure> {
    let progress = console.progress("writing flash");
    let probe_rs = ProbeRs::find(probe)?;
    download(&probe_rs)?;
    probe_rs.reset()?;
    progress.finish_and_clear();
    console.say(format!("written and verified with probe-rs {}", probe_rs.version()))
}

/// Who started.
async fn ask(common: &CommonOptions) -> Result<Identity, Failure> {
    let unasked = |failure: &dyn std::fmt::Display| {
        Failure::device(format!("the flash is written, but the board could not be asked what it runs: {failure}"))
    };
    let mut link = connect(common).await.map_err(|failure| unasked(&failure))?;
    link.identify_within(START_PATIENCE).await.map_err(|error| unasked(&error))
}
