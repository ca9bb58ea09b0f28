//! `vergence devices`: the serial ports with the boards behind them, and the cameras.

use serde_json::json;
use vergence_board::{ListedPort, list_ports};
use vergence_doctor::{CameraEntry, UDEV_RULES, list_cameras};

use crate::cli::CommonOptions;
use crate::console::Console;
use crate::failure::Failure;

/// Lists the serial ports, each with the board that answers there, and the cameras with their formats, sizes and rates, and whether a control of theirs
/// speaks of a trigger. Nothing is moved, armed or set, and a port that another vergence holds is left alone.
#[derive(Debug, clap::Args)]
pub struct Args {
    /// Opens neither ports nor cameras.
    #[arg(long)]
    quick: bool,
    /// Prints the udev rule that lets you use boards and cameras without sudo, and nothing else.
    #[arg(long)]
    rule: bool,
}

pub async fn run(args: &Args, common: &CommonOptions, console: Console) -> Result<(), Failure> {
    if args.rule {
        console.say(UDEV_RULES.trim_end())?;
        return console.result(&json!({ "rule": UDEV_RULES }));
    }
    let ports = list_ports(common.port.as_deref(), common.baud, !args.quick).await?;
    let cameras = list_cameras(!args.quick);
    if ports.is_empty() {
        console.say("no serial ports; 'vergence sim --pty' gives a simulated board")?;
    }
    console.say_lines(ports.iter().map(ListedPort::in_words))?;
    if cameras.is_empty() {
        console.say("no cameras; '--cameras sim' takes simulated ones")?;
    }
    console.say_lines(cameras.iter().flat_map(CameraEntry::in_words))?;
    console.result(&json!({
        "devices": ports.iter().map(ListedPort::json).collect::<Vec<_>>(),
        "cameras": cameras.iter().map(CameraEntry::json).collect::<Vec<_>>(),
    }))
}
