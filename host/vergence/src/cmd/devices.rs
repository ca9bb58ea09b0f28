//! `vergence devices`: the serial ports, and which of them look like a board.

use serde_json::json;

use crate::console::Console;
use crate::failure::Failure;
use crate::serial_ports::{describe, is_candidate, is_st_link, ports};

/// Lists the serial ports; those of an ST-LINK (the debugger on a NUCLEO board) are marked.
#[derive(Debug, clap::Args)]
pub struct Args {}

pub fn run(_: &Args, console: Console) -> Result<(), Failure> {
    let ports = ports()?;
    if ports.is_empty() {
        console.say("no serial ports; 'vergence sim --pty' gives a simulated board")?;
    }
    for port in &ports {
        let note = if is_candidate(port) { "" } else { "; not tried unless named with --port" };
        console.say(format!("{}  {}{note}", port.port_name, describe(port)))?;
    }
    let list: Vec<_> = ports
        .iter()
        .map(|port| {
            json!({
                "port": port.port_name,
                "description": describe(port),
                "st_link": is_st_link(port),
                "candidate": is_candidate(port),
            })
        })
        .collect();
    console.result(&json!({ "devices": list }))
}
