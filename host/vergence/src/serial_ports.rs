//! Serial ports of this machine, and which of them may be a board.

use serialport::{SerialPortInfo, SerialPortType, available_ports};

use crate::failure::Failure;

/// STMicroelectronics' USB vendor id.
const ST_VENDOR: u16 = 0x0483;

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
    Ok(if st_links.is_empty() { names(is_candidate) } else { st_links })
}

/// Every serial port, by name.
///
/// # Errors
/// The operating system's.
pub fn ports() -> Result<Vec<SerialPortInfo>, Failure> {
    let mut ports =
        available_ports().map_err(|error| Failure::device(format!("cannot list the serial ports: {error}")))?;
    ports.sort_by(|a, b| a.port_name.cmp(&b.port_name));
    Ok(ports)
}

/// Whether the port is tried where none is named. Built-in ports are not: most lead nowhere.
pub fn is_candidate(port: &SerialPortInfo) -> bool {
    matches!(port.port_type, SerialPortType::UsbPort(_))
}

/// Whether the port belongs to an ST-LINK, the debugger on a NUCLEO board.
pub fn is_st_link(port: &SerialPortInfo) -> bool {
    matches!(&port.port_type, SerialPortType::UsbPort(usb) if usb.vid == ST_VENDOR)
}

/// A few words on the port.
pub fn describe(port: &SerialPortInfo) -> String {
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
