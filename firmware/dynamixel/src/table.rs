//! The control table of the X series, as the XM430 has it (ROBOTIS e-manual, XM430-W350, "Control Table").
//!
//! Registers in the EEPROM keep their values without power and can be written only while torque is off.

/// Where a register lies.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Area {
    /// Keeps its value without power; written only while torque is off.
    Eeprom,
    /// Starts anew with the power.
    Ram,
}

/// What a master may do with a register.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Access {
    /// Only read.
    Read,
    /// Read and write.
    ReadWrite,
}

/// One register.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Register {
    /// As the manual calls it.
    pub name: &'static str,
    /// First byte.
    pub address: u16,
    /// Bytes: 1, 2 or 4.
    pub width: u16,
    /// Where it lies.
    pub area: Area,
    /// What a master may do with it.
    pub access: Access,
    /// Whether its value has a sign (two's complement).
    pub signed: bool,
}

impl Register {
    /// Address of the byte behind it.
    #[must_use]
    pub const fn end(&self) -> u16 {
        self.address + self.width
    }
}

macro_rules! registers {
    ($($(#[$doc:meta])* $name:ident = $text:literal, $address:literal, $width:literal, $area:ident, $access:ident $(, $signed:ident)?;)*) => {
        $($(#[$doc])* pub const $name: Register = Register {
            name: $text, address: $address, width: $width, area: Area::$area, access: Access::$access,
            signed: registers!(@ $($signed)?),
        };)*

        /// All registers in the order of their addresses, without the indirect ones: see [`indirect_address`].
        pub const ALL: &[Register] = &[$($name),*];
    };
    (@ signed) => { true };
    (@) => { false };
}

registers! {
    /// Kind of servo.
    MODEL_NUMBER = "Model Number", 0, 2, Eeprom, Read;
    /// Further information about the kind.
    MODEL_INFORMATION = "Model Information", 2, 4, Eeprom, Read;
    /// Version of its firmware.
    FIRMWARE_VERSION = "Firmware Version", 6, 1, Eeprom, Read;
    /// Number on the bus.
    ID = "ID", 7, 1, Eeprom, ReadWrite;
    /// Speed of the line: [`crate::units::Baud`].
    BAUD_RATE = "Baud Rate", 8, 1, Eeprom, ReadWrite;
    /// Delay before an answer: [`crate::units::ReturnDelay`].
    RETURN_DELAY_TIME = "Return Delay Time", 9, 1, Eeprom, ReadWrite;
    /// Bit 0: the direction is reversed. Bit 2: the profile is given by times.
    DRIVE_MODE = "Drive Mode", 10, 1, Eeprom, ReadWrite;
    /// What is controlled: [`crate::units::OperatingMode`].
    OPERATING_MODE = "Operating Mode", 11, 1, Eeprom, ReadWrite;
    /// A second number, to which the servo listens without answering; above 252 none.
    SECONDARY_ID = "Secondary ID", 12, 1, Eeprom, ReadWrite;
    /// 2 for this protocol.
    PROTOCOL_TYPE = "Protocol Type", 13, 1, Eeprom, ReadWrite;
    /// Added to the encoder's position, in counts.
    HOMING_OFFSET = "Homing Offset", 20, 4, Eeprom, ReadWrite, signed;
    /// Velocity above which the servo says that it moves.
    MOVING_THRESHOLD = "Moving Threshold", 24, 4, Eeprom, ReadWrite;
    /// Temperature above which it is overheated, in degrees Celsius.
    TEMPERATURE_LIMIT = "Temperature Limit", 31, 1, Eeprom, ReadWrite;
    /// Largest supply: [`crate::units::Voltage`].
    MAX_VOLTAGE_LIMIT = "Max Voltage Limit", 32, 2, Eeprom, ReadWrite;
    /// Least supply: [`crate::units::Voltage`].
    MIN_VOLTAGE_LIMIT = "Min Voltage Limit", 34, 2, Eeprom, ReadWrite;
    /// Largest duty of the motor's bridge, of 885.
    PWM_LIMIT = "PWM Limit", 36, 2, Eeprom, ReadWrite;
    /// Largest current: [`crate::units::Current`].
    CURRENT_LIMIT = "Current Limit", 38, 2, Eeprom, ReadWrite;
    /// Largest velocity: [`crate::units::Velocity`].
    VELOCITY_LIMIT = "Velocity Limit", 44, 4, Eeprom, ReadWrite;
    /// Largest goal in position mode, in counts.
    MAX_POSITION_LIMIT = "Max Position Limit", 48, 4, Eeprom, ReadWrite;
    /// Least goal in position mode, in counts.
    MIN_POSITION_LIMIT = "Min Position Limit", 52, 4, Eeprom, ReadWrite;
    /// Bit 0: torque goes on with the power. Bit 1: the values of a backup are taken.
    STARTUP_CONFIGURATION = "Startup Configuration", 60, 1, Eeprom, ReadWrite;
    /// Errors at which torque goes off: [`crate::units::HardwareErrors`].
    SHUTDOWN = "Shutdown", 63, 1, Eeprom, ReadWrite;
    /// 1: torque is on, and the EEPROM locked.
    TORQUE_ENABLE = "Torque Enable", 64, 1, Ram, ReadWrite;
    /// 1: the lamp is on.
    LED = "LED", 65, 1, Ram, ReadWrite;
    /// 0: answers only pings. 1: reads too. 2: all.
    STATUS_RETURN_LEVEL = "Status Return Level", 68, 1, Ram, ReadWrite;
    /// 1: a write waits for its action.
    REGISTERED_INSTRUCTION = "Registered Instruction", 69, 1, Ram, Read;
    /// [`crate::units::HardwareErrors`]; cleared by a reboot.
    HARDWARE_ERROR_STATUS = "Hardware Error Status", 70, 1, Ram, Read;
    /// Gain of the velocity loop.
    VELOCITY_I_GAIN = "Velocity I Gain", 76, 2, Ram, ReadWrite;
    /// Gain of the velocity loop.
    VELOCITY_P_GAIN = "Velocity P Gain", 78, 2, Ram, ReadWrite;
    /// Gain of the position loop.
    POSITION_D_GAIN = "Position D Gain", 80, 2, Ram, ReadWrite;
    /// Gain of the position loop.
    POSITION_I_GAIN = "Position I Gain", 82, 2, Ram, ReadWrite;
    /// Gain of the position loop.
    POSITION_P_GAIN = "Position P Gain", 84, 2, Ram, ReadWrite;
    /// Feed-forward of the acceleration.
    FEEDFORWARD_2ND_GAIN = "Feedforward 2nd Gain", 88, 2, Ram, ReadWrite;
    /// Feed-forward of the velocity.
    FEEDFORWARD_1ST_GAIN = "Feedforward 1st Gain", 90, 2, Ram, ReadWrite;
    /// Silence after which the servo stops: [`crate::units::BusWatchdog`].
    BUS_WATCHDOG = "Bus Watchdog", 98, 1, Ram, ReadWrite, signed;
    /// Goal of the PWM mode, and limit in the others.
    GOAL_PWM = "Goal PWM", 100, 2, Ram, ReadWrite, signed;
    /// Goal of the current mode, and limit in current-based position mode: [`crate::units::Current`].
    GOAL_CURRENT = "Goal Current", 102, 2, Ram, ReadWrite, signed;
    /// Goal of the velocity mode: [`crate::units::Velocity`].
    GOAL_VELOCITY = "Goal Velocity", 104, 4, Ram, ReadWrite, signed;
    /// Acceleration of the profile, 0 for none: [`crate::units::Acceleration`].
    PROFILE_ACCELERATION = "Profile Acceleration", 108, 4, Ram, ReadWrite;
    /// Velocity of the profile, 0 for none: [`crate::units::Velocity`].
    PROFILE_VELOCITY = "Profile Velocity", 112, 4, Ram, ReadWrite;
    /// Goal of the position modes: [`crate::units::Position`].
    GOAL_POSITION = "Goal Position", 116, 4, Ram, ReadWrite, signed;
    /// Milliseconds since the start, modulo 32768.
    REALTIME_TICK = "Realtime Tick", 120, 2, Ram, Read;
    /// 1: the servo moves.
    MOVING = "Moving", 122, 1, Ram, Read;
    /// Bit 0: in position. Bit 1: a profile runs. Bit 3: the position does not follow the goal.
    MOVING_STATUS = "Moving Status", 123, 1, Ram, Read;
    /// Duty of the motor's bridge.
    PRESENT_PWM = "Present PWM", 124, 2, Ram, Read, signed;
    /// [`crate::units::Current`].
    PRESENT_CURRENT = "Present Current", 126, 2, Ram, Read, signed;
    /// [`crate::units::Velocity`].
    PRESENT_VELOCITY = "Present Velocity", 128, 4, Ram, Read, signed;
    /// [`crate::units::Position`].
    PRESENT_POSITION = "Present Position", 132, 4, Ram, Read, signed;
    /// Velocity that the profile wants now.
    VELOCITY_TRAJECTORY = "Velocity Trajectory", 136, 4, Ram, Read, signed;
    /// Position that the profile wants now.
    POSITION_TRAJECTORY = "Position Trajectory", 140, 4, Ram, Read, signed;
    /// [`crate::units::Voltage`].
    PRESENT_INPUT_VOLTAGE = "Present Input Voltage", 144, 2, Ram, Read;
    /// Degrees Celsius.
    PRESENT_TEMPERATURE = "Present Temperature", 146, 1, Ram, Read;
    /// 1: there is a backup of the control table.
    BACKUP_READY = "Backup Ready", 147, 1, Ram, Read;
}

/// How many indirect registers there are.
pub const INDIRECT: u16 = 56;

/// The register that says which byte of the table indirect register `number` (1 to 56) stands for.
#[must_use]
pub const fn indirect_address(number: u16) -> Option<Register> {
    let address = match number {
        1..=28 => 168 + 2 * (number - 1),
        29..=INDIRECT => 578 + 2 * (number - 29),
        _ => return None,
    };
    Some(indirect("Indirect Address", address, 2))
}

/// Indirect register `number` (1 to 56): one byte, that of the address it stands for.
#[must_use]
pub const fn indirect_data(number: u16) -> Option<Register> {
    let address = match number {
        1..=28 => 224 + (number - 1),
        29..=INDIRECT => 634 + (number - 29),
        _ => return None,
    };
    Some(indirect("Indirect Data", address, 1))
}

const fn indirect(name: &'static str, address: u16, width: u16) -> Register {
    Register { name, address, width, area: Area::Ram, access: Access::ReadWrite, signed: false }
}

/// Bytes of the whole control table.
pub const TABLE_BYTES: u16 = 662;
