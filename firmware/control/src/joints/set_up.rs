//! What a servo is set to before it is used.
//!
//! Each register is read, and written only where it differs: the EEPROM of a servo wears out. Torque goes off first, since it
//! locks the EEPROM, and the bus watchdog is cleared, since a servo that it has stopped refuses goals.

use vergence_dynamixel::table::{self, Register};
use vergence_dynamixel::units::OperatingMode;

use super::settings::{BusSettings, JointSettings};

/// Errors by which a servo ends its torque: overload, electrical shock, overheating as from the factory, and that of its encoder,
/// without which its loop would turn it on and on.
const ENDS_TORQUE: i32 = 0x3C;

/// A register and what it is set to.
pub(super) type Entry = (&'static Register, i32);

/// Entry number `step` of the set-up of a joint; `None` behind the last one.
pub(super) fn entry(step: u8, joint: &JointSettings, bus: &BusSettings) -> Option<Entry> {
    Some(match step {
        0 => (&table::TORQUE_ENABLE, 0),
        1 => (&table::BUS_WATCHDOG, 0),
        2 => (&table::RETURN_DELAY_TIME, 0),
        // Not reversed; profiles by velocity.
        3 => (&table::DRIVE_MODE, 0),
        4 => (&table::OPERATING_MODE, OperatingMode::Position.register().into()),
        5 => (&table::CURRENT_LIMIT, joint.current_limit.into()),
        // Profiles are the board's, so that the servo shall follow at once.
        6 => (&table::PROFILE_VELOCITY, 0),
        7 => (&table::PROFILE_ACCELERATION, 0),
        // The board corrects what the proportional gain leaves, at rest: an integral would be wound up by the lag of each move.
        8 => (&table::POSITION_I_GAIN, 0),
        9 => (&table::SHUTDOWN, ENDS_TORQUE),
        10 => (&table::BUS_WATCHDOG, bus.watchdog.0.into()),
        _ => return None,
    })
}

/// Whether the data read of an entry's register are what it is set to.
pub(super) fn has((register, value): Entry, data: &[u8]) -> bool {
    value.to_le_bytes().get(..usize::from(register.width)) == Some(data)
}
