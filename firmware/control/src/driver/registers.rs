//! Registers of the TMC2209 and the values for them (datasheet rev. 1.09, section 5).

use super::settings::DriverSettings;

/// A register, with its address.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u8)]
pub enum Register {
    /// General configuration.
    GConf = 0x00,
    /// What has happened since it was last cleared.
    GStat = 0x01,
    /// Counts the writes that the driver took, modulo 256.
    IfCnt = 0x02,
    /// Delay of replies.
    NodeConf = 0x03,
    /// Levels of the pins, and the version of the chip.
    IoIn = 0x06,
    /// Currents, and how fast the current falls at rest.
    IHoldIRun = 0x10,
    /// Time at rest until the current falls.
    TPowerDown = 0x11,
    /// Longest time of a step at which a stall is reported.
    TCoolThrs = 0x14,
    /// Threshold of a stall.
    SgThrs = 0x40,
    /// Chopper, range of the current, microsteps.
    ChopConf = 0x6C,
    /// Temperature, short circuits, present current.
    DrvStatus = 0x6F,
}

/// Bits of GSTAT.
pub mod gstat {
    /// The driver was reset: all registers have their reset values.
    pub const RESET: u32 = 1;
    /// The driver switched its outputs off: see DRV_STATUS.
    pub const DRIVER_ERROR: u32 = 1 << 1;
    /// The supply is too low for the outputs to work.
    pub const UNDERVOLTAGE: u32 = 1 << 2;
    /// All of them; written to clear them.
    pub const ALL: u32 = RESET | DRIVER_ERROR | UNDERVOLTAGE;
}

/// Bits of DRV_STATUS.
pub mod drv_status {
    /// The temperature is above the limit of the warning.
    pub const HOT: u32 = 1;
    /// The driver is too hot and has switched its outputs off.
    pub const OVERHEATED: u32 = 1 << 1;
    /// A short circuit of an output to ground or to the supply has switched the outputs off.
    pub const SHORT: u32 = 0b1111 << 2;
}

/// VERSION in IOIN, bits 24 to 31.
pub const VERSION: u32 = 0x21;

/// GCONF: current by the internal reference and not by VREF, no power-down by the serial line's pin, microsteps by
/// register and not by the pins that set the address, filtered steps.
const GCONF: u32 = 1 << 6 | 1 << 7 | 1 << 8;
const SPREAD_CYCLE: u32 = 1 << 2;
/// CHOPCONF: off-time 3, hysteresis 5 and -3 as after reset, blank time 2 (section 5.5.1: the best for most motors),
/// interpolation to 256 microsteps.
const CHOPCONF: u32 = 3 | 5 << 4 | 2 << 15 | 1 << 28;
const LOW_RANGE: u32 = 1 << 17;
/// NODECONF: replies after three times eight bits, which is needed where several drivers share the line (section 5.1).
const NODECONF: u32 = 2 << 8;
/// IHOLDDELAY: the current falls in some tenths of a second.
const FALL: u32 = 8 << 16;
/// Period of TPOWERDOWN in microseconds: 2^18 clocks of 12 MHz.
const POWER_DOWN_US: u32 = 21_845;

/// Writes that give a driver its settings, in their order. What happened is cleared first, so that a reset in the midst
/// of the others is noticed.
#[must_use]
pub fn configuration(settings: &DriverSettings) -> [(Register, u32); 8] {
    let (range, run, hold) = settings.current_scale();
    let chopper = if settings.stealth_chop { 0 } else { SPREAD_CYCLE };
    let low_range = if range.is_low { LOW_RANGE } else { 0 };
    // MRES: 0 for 256 microsteps, 8 for full steps.
    let resolution = 8 - settings.microsteps.max(1).ilog2().min(8);
    [
        (Register::GStat, gstat::ALL),
        (Register::NodeConf, NODECONF),
        (Register::GConf, GCONF | chopper),
        (Register::ChopConf, CHOPCONF | low_range | resolution << 24),
        (Register::IHoldIRun, hold | run << 8 | FALL),
        (Register::TPowerDown, (settings.hold_delay_us / POWER_DOWN_US).min(255)),
        (Register::TCoolThrs, settings.stall.map_or(0, |stall| stall.longest_tstep)),
        (Register::SgThrs, settings.stall.map_or(0, |stall| stall.threshold)),
    ]
}
