//! `vergence devices`: the serial ports, and which of them look like a board.

use serde_json::json;
use vergence_board::{describe_port, is_candidate, is_st_link, serial_ports};

use crate::console::Console;
use crate::failure::Failure;

/// Lists the serial ports; those of an ST-LINK (the debugger on a NUCLEO board) are marked.
#[derive(Debug, clap::Args)]
pub struct Args {}

pub fn run(_: &Args, console: Console) -> Result<(), Failure> {
    let ports = serial_ports()?;
    if ports.is_empty() {
        console.say("no serial ports; 'vergence sim --pty' gives a simulated board")?;
    }
    for port in &ports {
        let note = if is_candidate(port) { "" } else { "; not tried unless named with --port" };
        console.say(format!("{}  {}{note}", port.port_name, describe_port(port)))?;
    }
    let list: Vec<_> = ports
        .iter()
        .map(|port| {
            json!({
                "port": port.port_name,
                "description": describe_port(port),
                "st_link": is_st_link(port),
                "candidate": is_candidate(port),
            })
        })
        .collect();
    console.result(&json!({ "devices": list }))
}
