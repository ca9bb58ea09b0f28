//! Serial ports of this machine, and which of them may be a board.

use serialport::{SerialPortInfo, SerialPortType, available_ports};

use super::error::OpenError;
use super::open::Port;

/// STMicroelectronics' USB vendor id.
const ST_VENDOR: u16 = 0x0483;

impl Port {
    /// The port called `name`, or else the only one that may be a board.
    ///
    /// # Errors
    /// [`OpenError`] where none is named, and there is none or there are several.
    pub fn named_or_only(name: Option<&str>) -> Result<Self, OpenError> {
        if let Some(Ok(port)) = name.map(str::parse) {
            return Ok(port);
        }
        let found = boards()?;
        match found.as_slice() {
            [] => Err(OpenError::NoDevice(serial_ports()?.into_iter().map(|port| port.port_name).collect())),
            [only] => Ok(Self::Serial(only.into())),
            _ => Err(OpenError::SeveralDevices(found)),
        }
    }

    /// Whether bytes take time on this port: pseudo-terminals and TCP carry them at once.
    #[must_use]
    pub fn is_wire(self) -> bool {
        match self {
            // A name that a rule or a person gave to the device is still that device.
            Self::Serial(path) => !path.canonicalize().unwrap_or(path).starts_with("/dev/pts"),
            _ => false,
        }
    }
}

/// The ports that may be a board: the ST-LINKs where there are any, else every USB port.
///
/// # Errors
/// The operating system's.
fn boards() -> Result<Vec<String>, OpenError> {
    let ports = serial_ports()?;
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
pub fn serial_ports() -> Result<Vec<SerialPortInfo>, OpenError> {
    let mut ports = available_ports().map_err(|error| OpenError::List(error.to_string()))?;
    ports.sort_by(|a, b| a.port_name.cmp(&b.port_name));
    Ok(ports)
}

/// Whether the port is tried where none is named. Built-in ports are not: most lead nowhere.
#[must_use]
pub fn is_candidate(port: &SerialPortInfo) -> bool {
    matches!(port.port_type, SerialPortType::UsbPort(_))
}

/// Whether the port belongs to an ST-LINK, the debugger on a NUCLEO board.
#[must_use]
pub fn is_st_link(port: &SerialPortInfo) -> bool {
    matches!(&port.port_type, SerialPortType::UsbPort(usb) if usb.vid == ST_VENDOR)
}

/// A few words on the port.
#[must_use]
pub fn describe_port(port: &SerialPortInfo) -> String {
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
