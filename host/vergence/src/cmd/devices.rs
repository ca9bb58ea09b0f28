//! `vergence devices`: the serial ports, and which of them look like a board.

use serde_json::json;
use serialport::{SerialPortInfo, SerialPortType, available_ports};

use crate::console::Console;
use crate::failure::Failure;

/// Lists the serial ports; those of an ST-LINK (the debugger on a NUCLEO board) are marked.
#[derive(Debug, clap::Args)]
pub struct Args {}

/// STMicroelectronics' USB vendor id.
const ST_VENDOR: u16 = 0x0483;

pub fn run(_: &Args, console: Console) -> Result<(), Failure> {
    let ports = ports()?;
    if ports.is_empty() {
        console.say("no serial ports; 'vergence sim --pty' gives a simulated board")?;
    }
    for port in &ports {
        console.say(format!("{}  {}", port.port_name, describe(port)))?;
    }
    let list: Vec<_> = ports
        .iter()
        .map(|port| json!({"port": port.port_name, "description": describe(port), "st_link": is_st_link(port)}))
        .collect();
    console.result(&json!({ "devices": list }))
}

/// The ports that may be a board: the ST-LINKs where there are any, else every USB port.
///
/// # Errors
/// The operating system's.
pub fn boards() -> Result<Vec<String>, Failure> {
    let ports = ports()?;
    let names = |wanted: fn(&SerialPortInfo) -> bool| -> Vec<String> {
        ports.iter().filter(|port| wanted(port)).map(|port| port.port_name.clone()).collect()
    };
    let st_links = names(is_st_link);
    Ok(if st_links.is_empty() { names(|port| matches!(port.port_type, SerialPortType::UsbPort(_))) } else { st_links })
}

fn ports() -> Result<Vec<SerialPortInfo>, Failure> {
    let mut ports =
        available_ports().map_err(|error| Failure::device(format!("cannot list the serial ports: {error}")))?;
    ports.sort_by(|a, b| a.port_name.cmp(&b.port_name));
    Ok(ports)
}

fn is_st_link(port: &SerialPortInfo) -> bool {
    matches!(&port.port_type, SerialPortType::UsbPort(usb) if usb.vid == ST_VENDOR)
}

fn describe(port: &SerialPortInfo) -> String {
    match &port.port_type {
        SerialPortType::UsbPort(usb) => {
            let product = usb.product.as_deref().unwrap_or("USB serial");
            let note = if is_st_link(port) { ", ST-LINK: probably a NUCLEO board" } else { "" };
            format!("{product} ({:04x}:{:04x}){note}", usb.vid, usb.pid)
        }
        SerialPortType::PciPort => "built-in serial port".into(),
        SerialPortType::BluetoothPort => "Bluetooth".into(),
        SerialPortType::Unknown => "serial port".into(),
    }
}
