//! The USB bus that a camera is plugged into, as the kernel tells it (Documentation/ABI/testing/sysfs-bus-usb).

use std::fs::read_to_string;
use std::path::Path;

/// Largest part of a USB bus that isochronous and bulk transfers get in practice, in megabytes per second for each megabit per second of its
/// signalling: 40 MB/s of 480 Mbit/s (USB 2.0, section 5.6.4: 24 576 000 of 60 000 000 bytes for high-bandwidth isochronous transfers, bulk some
/// more), 400 MB/s of 5 Gbit/s after 8b/10b coding and protocol.
const MB_PER_MBIT: f64 = 40.0 / 480.0;

/// A USB bus and the speed at which a camera is connected to it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct UsbLink {
    /// Number of the bus; cameras on one bus share its speed.
    pub bus: u32,
    /// Speed in megabits per second: 480 is USB 2, 5000 and more is USB 3.
    pub mbit_per_s: f64,
}

impl UsbLink {
    /// The bus of the camera at `device`, such as `/dev/video0`; `None` for a camera that is not on USB.
    #[must_use]
    pub fn of(device: &Path) -> Option<Self> {
        let device = device.canonicalize().unwrap_or_else(|_| device.to_owned());
        let interface = Path::new("/sys/class/video4linux").join(device.file_name()?).join("device");
        // The interface lies in the folder of its USB device.
        let usb = interface.canonicalize().ok()?.parent()?.to_owned();
        let number = |name: &str| read_to_string(usb.join(name)).ok()?.trim().parse::<f64>().ok();
        Some(Self { bus: number("busnum")? as u32, mbit_per_s: number("speed")? })
    }

    /// Megabytes per second that images can take of it in practice.
    #[must_use]
    pub fn usable_mb_per_s(self) -> f64 {
        self.mbit_per_s * MB_PER_MBIT
    }
}

impl std::fmt::Display for UsbLink {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let kind = if self.mbit_per_s > 480.0 { "USB 3" } else { "USB 2" };
        write!(f, "{kind} bus {} at {} Mbit/s", self.bus, self.mbit_per_s)
    }
}
