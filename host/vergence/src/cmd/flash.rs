//! `vergence flash`: firmware into the board, and back.

mod serial;
mod swd;

use std::path::PathBuf;

use serde_json::json;
use vergence_board::{ManagementLink, Port, UpdateError, confirm, identity_json, identity_words, restart, roll_back};

use super::connect::port;
use crate::cli::CommonOptions;
use crate::console::Console;
use crate::failure::Failure;
use crate::firmware::read_image;
use crate::interrupt::interrupted;

/// Updates the board's firmware. The board keeps the previous image: it returns to it at the next start unless the new one
/// is confirmed. An interrupted update continues where it stopped when the same command is given again. docs/flashing.md
/// says what signatures protect against.
#[derive(Debug, clap::Args)]
#[command(group = clap::ArgGroup::new("task").required(true))]
pub struct Args {
    /// Sends a signed image over the link, starts it on trial, and confirms it when it answers.
    #[arg(long, value_name = "IMAGE", group = "task")]
    serial: Option<PathBuf>,
    /// Writes a signed image, or the boot loader's ELF file, through a debug probe: needs probe-rs.
    #[arg(long, value_name = "FILE", group = "task")]
    swd: Option<PathBuf>,
    /// Goes back to the image before this one.
    #[arg(long, group = "task")]
    rollback: bool,
    /// Keeps the image that is on trial.
    #[arg(long, group = "task")]
    confirm: bool,
    /// Restarts the board; an image on trial goes back.
    #[arg(long, group = "task")]
    restart: bool,
    /// Leaves the new image on trial.
    #[arg(long, requires = "serial")]
    no_confirm: bool,
    /// The debug probe, where several are connected: VID:PID or VID:PID:SERIAL.
    #[arg(long, requires = "swd", value_name = "PROBE")]
    probe: Option<String>,
}

pub async fn run(args: &Args, common: &CommonOptions, console: Console) -> Result<(), Failure> {
    if let Some(file) = &args.swd {
        return swd::run(file, args.probe.as_deref(), common, console).await;
    }
    let image = args.serial.as_deref().map(read_image).transpose()?;
    let mut link = connect(common).await?;
    if let Some(image) = image {
        return serial::run(&image, !args.no_confirm, &mut link, console).await;
    }
    tokio::select! {
        done = change(args, &mut link, console) => done,
        () = interrupted() => Err(Failure::interrupted(
            "interrupted: the board goes on with what it was told; 'vergence status' shows what it runs",
        )),
    }
}

/// Goes back, confirms or restarts, and says what the board ran before and after.
async fn change(args: &Args, link: &mut ManagementLink, console: Console) -> Result<(), Failure> {
    let before = link.identify().await.map_err(UpdateError::from)?;
    let after = if args.rollback {
        roll_back(link, &before).await?
    } else if args.confirm {
        confirm(link).await?
    } else {
        restart(link).await?
    };
    console.say(identity_words(&after))?;
    console.result(&json!({ "before": identity_json(&before), "after": identity_json(&after) }))
}

async fn connect(common: &CommonOptions) -> Result<ManagementLink, Failure> {
    let port = port(common)?;
    if matches!(port, Port::Simulated(_)) {
        return Err(Failure::usage("a board in this process ends with it: flash one of 'vergence sim --pty'"));
    }
    Ok(ManagementLink::open(port, common.baud).await?)
}
