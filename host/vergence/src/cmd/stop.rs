//! `vergence stop`: brakes now.

use serde_json::json;
use vergence_board::{Port, open, send_stop, stop_beside};

use super::connect::{connect_any, port};
use super::options::active_rig;
use crate::cli::CommonOptions;
use crate::console::Console;
use crate::failure::Failure;
use crate::rig_file;

/// Decelerates every axis within its limits and keeps the reference. Needs no arming. It is software: the emergency stop
/// is the switch that cuts the drivers.
#[derive(Debug, clap::Args)]
pub struct Args {}

pub async fn run(_: &Args, common: &CommonOptions, console: Console) -> Result<(), Failure> {
    if let port @ Port::Serial(_) = port(common)? {
        let mut wire = open(&port, common.baud, true).await?;
        if wire.lock.is_none() {
            let Some(state) = stop_beside(&port, wire).await? else {
                console.say("stop sent; the vergence that holds the port shows what became of it")?;
                return console.result(&json!({"stop": "sent", "confirmed": false}));
            };
            console.say(format!("stopped: {state}"))?;
            return console.result(&json!({"stop": "sent", "confirmed": true, "state": state.to_string()}));
        }
        // Before the session, which takes some round trips to open; the answer comes to the one after it.
        send_stop(&port, &mut wire).await?;
    }
    let mut board = connect_any(&with_readable_rig(common), console, "stopping").await?;
    board.stop().await?;
    // Only now does it matter whether positions are known.
    if board.check_axes().await.is_ok() {
        return console.say_pose(board.rig(), board.pose());
    }
    console.say(format!("{}; the rig file does not describe this board", board.pose().state))?;
    console.result(&json!({ "state": board.pose().state.to_string() }))
}

/// A rig file that cannot be read is no reason not to stop.
fn with_readable_rig(common: &CommonOptions) -> CommonOptions {
    let rig = common.rig.clone().or_else(|| active_rig().ok().flatten());
    let rig = rig.filter(|path| rig_file::load(Some(path)).is_ok());
    CommonOptions { rig, ..common.clone() }
}
