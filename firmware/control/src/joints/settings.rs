//! Settings of the joints' bus.

use vergence_dynamixel::Id;
use vergence_dynamixel::units::BusWatchdog;
use vergence_protocol::AxisList;

/// Settings of one joint on the bus.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct JointSettings {
    /// Number of its servo.
    pub id: Id,
    /// Largest current of its motor in units of 2.69 mA, 0 to 1193 for an XM430.
    pub current_limit: u16,
}

/// Settings of the bus.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct BusSettings {
    /// The joints, in the order of the axes.
    pub joints: AxisList<JointSettings>,
    /// Speed of the line in bits per second.
    pub baud: u32,
    /// Silence after which the servos stop by themselves, as when the board dies.
    pub watchdog: BusWatchdog,
}

impl BusSettings {
    /// Time that so many bytes take on the line, in microseconds rounded up: ten bits each.
    pub(super) fn time_of(&self, bytes: usize) -> u64 {
        (bytes as u64 * 10_000_000).div_ceil(u64::from(self.baud.max(1)))
    }
}
