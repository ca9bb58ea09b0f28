//! `vergence flash`: firmware into the board, and back.

mod probe;
mod serial;
mod start;
mod swd;

use std::path::PathBuf;

use serde_json::{Value, json};
use vergence_protocol::management::{Identity, Management, Outcome, RebootTo};

pub use self::serial::update;
use super::connect::port;
use crate::cli::Globals;
use crate::console::Console;
use crate::failure::Failure;
use crate::firmware::{hardware_name, version_text};
use crate::link::{LinkError, ManagementLink, Port};

/// Updates the board's firmware. The board keeps the image before: a new one that nobody confirms goes back at the next
/// start. An update that was cut off goes on where it stopped when the same command is given again. docs/flashing.md
/// says what signatures protect from, and what not.
#[derive(Debug, clap::Args)]
#[command(group = clap::ArgGroup::new("task").required(true))]
pub struct Args {
    /// Send a signed image over the link, start it on trial, and confirm it when it answers.
    #[arg(long, value_name = "IMAGE", group = "task")]
    serial: Option<PathBuf>,
    /// Write a signed image, or the boot loader's ELF file, through a debug probe: needs probe-rs.
    #[arg(long, value_name = "FILE", group = "task")]
    swd: Option<PathBuf>,
    /// Go back to the image before this one.
    #[arg(long, group = "task")]
    rollback: bool,
    /// Keep the image that is on trial.
    #[arg(long, group = "task")]
    confirm: bool,
    /// Start the board again; an image on trial goes back.
    #[arg(long, group = "task")]
    restart: bool,
    /// Leave the new image on trial.
    #[arg(long, requires = "serial")]
    no_confirm: bool,
    /// Which debug probe, where several are connected: VID:PID or VID:PID:SERIAL.
    #[arg(long, requires = "swd", value_name = "PROBE")]
    probe: Option<String>,
}

pub async fn run(args: &Args, globals: &Globals, console: Console) -> Result<(), Failure> {
    if let Some(file) = &args.swd {
        return swd::run(file, args.probe.as_deref(), globals, console).await;
    }
    let image = args.serial.as_deref().map(crate::firmware::OwnedImage::read).transpose()?;
    let mut link = connect(globals).await?;
    if let Some(image) = image {
        return console.result(&update(&image, !args.no_confirm, &mut link, console).await?);
    }
    let before = link.identify().await.map_err(|error| link_failure(&error))?;
    let after = if args.rollback {
        roll_back(&mut link, &before).await?
    } else if args.confirm {
        carried_out(link.ask(&Management::Confirm).await.map_err(|error| link_failure(&error))?)?;
        link.identify().await.map_err(|error| link_failure(&error))?
    } else {
        start::restart(&mut link).await?
    };
    tell(&after, console)?;
    console.result(&json!({ "before": identity_json(&before), "after": identity_json(&after) }))
}

async fn connect(globals: &Globals) -> Result<ManagementLink, Failure> {
    let port = port(globals)?;
    if port == Port::Simulated {
        return Err(Failure::usage("a board in this process ends with it: flash one of 'vergence sim --pty'"));
    }
    ManagementLink::open(port, globals.baud).await
}

async fn roll_back(link: &mut ManagementLink, before: &Identity) -> Result<Identity, Failure> {
    carried_out(link.ask(&Management::Rollback).await.map_err(|error| link_failure(&error))?)?;
    start::restart_into(link, before, |now| start::went_back(before, now)).await
}

fn carried_out(outcome: Outcome) -> Result<(), Failure> {
    match outcome {
        Outcome::Done => Ok(()),
        Outcome::WrongHardware | Outcome::WrongLength | Outcome::TooOld | Outcome::WrongSignature => {
            Err(Failure::usage(format!("the board refuses: {outcome}")))
        }
        refused => Err(Failure::device(format!("the board refuses: {refused}"))),
    }
}

fn link_failure(error: &LinkError) -> Failure {
    Failure::link(error.to_string())
}

/// A reboot into the application: what `start` asks for.
const REBOOT: Management = Management::Reboot(RebootTo::Application);

fn tell(identity: &Identity, console: Console) -> Result<(), Failure> {
    console.say(format!(
        "{} runs {} (build {:016x}), {}",
        hardware_name(identity.hardware),
        version_text(identity.version),
        identity.build,
        identity.boot
    ))
}

fn identity_json(identity: &Identity) -> Value {
    json!({
        "hardware": hardware_name(identity.hardware),
        "version": version_text(identity.version),
        "oldest": version_text(identity.oldest),
        "build": format!("{:016x}", identity.build),
        "boot": format!("{:?}", identity.boot).to_lowercase(),
        "capacity": identity.capacity,
    })
}
