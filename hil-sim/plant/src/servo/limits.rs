//! What each register starts with and takes (e-manual of the XM430-W350).

use vergence_dynamixel::table::{self, Register};

/// Least and largest value that a register takes, and what it starts with.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Limits {
    pub register: Register,
    pub initial: i64,
    pub least: i64,
    pub largest: i64,
}

const fn limits(register: Register, initial: i64, least: i64, largest: i64) -> Limits {
    Limits { register, initial, least, largest }
}

/// The registers that can be written. The others start with zero and show the servo's state.
pub(super) const WRITABLE: [Limits; 36] = [
    limits(table::ID, 1, 0, 252),
    limits(table::BAUD_RATE, 1, 0, 7),
    limits(table::RETURN_DELAY_TIME, 250, 0, 254),
    // Bit 2, profiles given by times, is not simulated and refused.
    limits(table::DRIVE_MODE, 0, 0, 1),
    limits(table::OPERATING_MODE, 3, 0, 16),
    limits(table::SECONDARY_ID, 255, 0, 255),
    // Protocol 1.0 is not simulated and refused.
    limits(table::PROTOCOL_TYPE, 2, 2, 2),
    limits(table::HOMING_OFFSET, 0, -1_044_479, 1_044_479),
    limits(table::MOVING_THRESHOLD, 10, 0, 1_023),
    limits(table::TEMPERATURE_LIMIT, 80, 0, 100),
    limits(table::MAX_VOLTAGE_LIMIT, 160, 95, 160),
    limits(table::MIN_VOLTAGE_LIMIT, 95, 95, 160),
    limits(table::PWM_LIMIT, 885, 0, 885),
    limits(table::CURRENT_LIMIT, 1_193, 0, 1_193),
    limits(table::VELOCITY_LIMIT, 350, 0, 1_023),
    limits(table::MAX_POSITION_LIMIT, 4_095, 0, 4_095),
    limits(table::MIN_POSITION_LIMIT, 0, 0, 4_095),
    // Torque on with the power, and restoring, are not simulated and refused.
    limits(table::STARTUP_CONFIGURATION, 0, 0, 0),
    limits(table::SHUTDOWN, 52, 0, 61),
    limits(table::TORQUE_ENABLE, 0, 0, 1),
    limits(table::LED, 0, 0, 1),
    limits(table::STATUS_RETURN_LEVEL, 2, 0, 2),
    limits(table::VELOCITY_I_GAIN, 1_920, 0, 16_383),
    limits(table::VELOCITY_P_GAIN, 100, 0, 16_383),
    limits(table::POSITION_D_GAIN, 0, 0, 16_383),
    limits(table::POSITION_I_GAIN, 0, 0, 16_383),
    limits(table::POSITION_P_GAIN, 800, 0, 16_383),
    limits(table::FEEDFORWARD_2ND_GAIN, 0, 0, 16_383),
    limits(table::FEEDFORWARD_1ST_GAIN, 0, 0, 16_383),
    limits(table::BUS_WATCHDOG, 0, 0, 127),
    limits(table::GOAL_PWM, 885, -885, 885),
    limits(table::GOAL_CURRENT, 1_193, -1_193, 1_193),
    limits(table::GOAL_VELOCITY, 0, -1_023, 1_023),
    limits(table::PROFILE_ACCELERATION, 0, 0, 32_767),
    limits(table::PROFILE_VELOCITY, 0, 0, 32_767),
    limits(table::GOAL_POSITION, 0, -1_048_575, 1_048_575),
];
