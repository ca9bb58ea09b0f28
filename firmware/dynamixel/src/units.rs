//! What the numbers of the registers mean (ROBOTIS e-manual, XM430-W350, "Control Table Description").
//!
//! Integers throughout: a register holds whole units, and the board computes in micro-units.

use core::f64::consts::TAU;

use thiserror::Error;

/// Counts of the position for one turn of the output.
pub const COUNTS_PER_TURN: i32 = 4096;

/// A position of the output, in counts of 1/4096 turn.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord)]
pub struct Position(pub i32);

impl Position {
    /// Microradians, rounded to the nearest.
    #[must_use]
    pub const fn microradians(self) -> i64 {
        MICRORADIANS.times(self.0)
    }

    /// The nearest position; `None` beyond what the register holds.
    #[must_use]
    pub fn of_microradians(angle: i64) -> Option<Self> {
        let counts = angle.checked_mul(i64::from(COUNTS_PER_TURN) * 1_000)?;
        let half = if angle < 0 { -TURN_NANORADIANS / 2 } else { TURN_NANORADIANS / 2 };
        i32::try_from(counts.checked_add(half)? / TURN_NANORADIANS).ok().map(Self)
    }
}

/// A velocity in units of 0.229 revolutions per minute.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord)]
pub struct Velocity(pub i32);

impl Velocity {
    /// Microradians per second, rounded to the nearest.
    #[must_use]
    pub const fn microradians_per_second(self) -> i64 {
        MICRORADIANS_PER_SECOND.times(self.0)
    }
}

/// An acceleration in units of 214.577 revolutions per minute².
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord)]
pub struct Acceleration(pub i32);

impl Acceleration {
    /// Microradians per second², rounded to the nearest.
    #[must_use]
    pub const fn microradians_per_second_squared(self) -> i64 {
        MICRORADIANS_PER_SECOND_SQUARED.times(self.0)
    }
}

/// A motor current in units of 2.69 mA.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord)]
pub struct Current(pub i16);

impl Current {
    /// The largest current of no more than so many milliamperes, up to the greatest that a register holds.
    #[must_use]
    pub const fn of_milliamperes(milliamperes: u32) -> Self {
        let units = milliamperes as u64 * 1_000 / 2_690;
        Self(if units > i16::MAX as u64 { i16::MAX } else { units as i16 })
    }

    /// Microamperes.
    #[must_use]
    pub const fn microamperes(self) -> i32 {
        self.0 as i32 * 2_690
    }
}

/// A supply voltage in units of 0.1 V.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord)]
pub struct Voltage(pub u16);

impl Voltage {
    /// Millivolts.
    #[must_use]
    pub const fn millivolts(self) -> u32 {
        self.0 as u32 * 100
    }
}

/// How long a servo waits before it answers, in units of 2 µs, 0 to 254.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord)]
pub struct ReturnDelay(pub u8);

impl ReturnDelay {
    /// Microseconds.
    #[must_use]
    pub const fn microseconds(self) -> u32 {
        self.0 as u32 * 2
    }
}

/// The bus watchdog of a servo: it stops when it hears nothing for so many times 20 ms. 0 is off; the servo sets -1 when
/// the watchdog has bitten, and then refuses goals until 0 is written.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord)]
pub struct BusWatchdog(pub i8);

impl BusWatchdog {
    /// The value that a servo shows after its watchdog has bitten.
    pub const BITTEN: Self = Self(-1);

    /// Milliseconds of silence until it bites; `None` where it is off or has bitten.
    #[must_use]
    pub const fn milliseconds(self) -> Option<u32> {
        if self.0 > 0 { Some(self.0.unsigned_abs() as u32 * 20) } else { None }
    }
}

/// Speed of the line, as the register `BAUD_RATE` numbers it.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
#[repr(u8)]
pub enum Baud {
    /// 9600 bit/s.
    B9600 = 0,
    /// 57 600 bit/s, as from the factory.
    B57600 = 1,
    /// 115 200 bit/s.
    B115200 = 2,
    /// 1 Mbit/s.
    M1 = 3,
    /// 2 Mbit/s.
    M2 = 4,
    /// 3 Mbit/s.
    M3 = 5,
    /// 4 Mbit/s.
    M4 = 6,
    /// 4.5 Mbit/s.
    M4_5 = 7,
}

/// A number that stands for no speed.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Error)]
#[error("{0} is no speed of the servo's line: use 0 (9600 bit/s) to 7 (4.5 Mbit/s)")]
pub struct NotABaud(pub u8);

impl Baud {
    /// All speeds, slowest first.
    pub const ALL: [Self; 8] =
        [Self::B9600, Self::B57600, Self::B115200, Self::M1, Self::M2, Self::M3, Self::M4, Self::M4_5];

    /// Bits per second.
    #[must_use]
    pub const fn bits_per_second(self) -> u32 {
        match self {
            Self::B9600 => 9_600,
            Self::B57600 => 57_600,
            Self::B115200 => 115_200,
            Self::M1 => 1_000_000,
            Self::M2 => 2_000_000,
            Self::M3 => 3_000_000,
            Self::M4 => 4_000_000,
            Self::M4_5 => 4_500_000,
        }
    }

    /// The speed of a register's value.
    ///
    /// # Errors
    /// [`NotABaud`] above 7.
    pub fn of_register(value: u8) -> Result<Self, NotABaud> {
        Self::ALL.get(usize::from(value)).copied().ok_or(NotABaud(value))
    }

    /// The register's value.
    #[must_use]
    pub const fn register(self) -> u8 {
        self as u8
    }
}

/// What the servo controls.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u8)]
pub enum OperatingMode {
    /// The current, and so the torque.
    Current = 0,
    /// The velocity.
    Velocity = 1,
    /// The position within one turn; as from the factory.
    Position = 3,
    /// The position over 512 turns.
    ExtendedPosition = 4,
    /// The position over 512 turns with a limited current.
    CurrentBasedPosition = 5,
    /// The voltage of the motor.
    Pwm = 16,
}

impl OperatingMode {
    /// The mode of a register's value; `None` for a value that the X430 does not have.
    #[must_use]
    pub const fn of_register(value: u8) -> Option<Self> {
        Some(match value {
            0 => Self::Current,
            1 => Self::Velocity,
            3 => Self::Position,
            4 => Self::ExtendedPosition,
            5 => Self::CurrentBasedPosition,
            16 => Self::Pwm,
            _ => return None,
        })
    }

    /// The register's value.
    #[must_use]
    pub const fn register(self) -> u8 {
        self as u8
    }
}

/// Bits of `HARDWARE_ERROR_STATUS`, and of `SHUTDOWN`, which says at which of them torque goes off.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct HardwareErrors(pub u8);

impl HardwareErrors {
    /// The supply is outside of the limits.
    pub const INPUT_VOLTAGE: Self = Self(1 << 0);
    /// Hotter than the limit.
    pub const OVERHEATING: Self = Self(1 << 2);
    /// The encoder of the motor does not work.
    pub const ENCODER: Self = Self(1 << 3);
    /// Electrical shock, or too little power for the motor.
    pub const ELECTRICAL_SHOCK: Self = Self(1 << 4);
    /// A load above the largest for long.
    pub const OVERLOAD: Self = Self(1 << 5);

    /// Whether any bit of `other` is set.
    #[must_use]
    pub const fn intersects(self, other: Self) -> bool {
        self.0 & other.0 != 0
    }

    /// Both together.
    #[must_use]
    pub const fn with(self, other: Self) -> Self {
        Self(self.0 | other.0)
    }

    /// Whether none is set.
    #[must_use]
    pub const fn is_empty(self) -> bool {
        self.0 == 0
    }
}

/// One turn in nanoradians.
const TURN_NANORADIANS: i64 = (TAU * 1e9) as i64;

/// A factor in fixed point, made by the compiler: the board has no fast double. It has 31 significant bits, so a product with
/// a register fits into 64 bits and is right to 5e-10 of itself.
struct Factor {
    scaled: i64,
    bits: u32,
}

impl Factor {
    /// `factor` above zero and below 2^29.
    const fn of(factor: f64) -> Self {
        let mut bits = 0;
        let mut scaled = factor;
        while scaled < (1_u64 << 30) as f64 {
            scaled *= 2.0;
            bits += 1;
        }
        Self { scaled: (scaled + 0.5) as i64, bits }
    }

    /// The product, rounded to the nearest.
    const fn times(&self, value: i32) -> i64 {
        (value as i64 * self.scaled + (1 << (self.bits - 1))) >> self.bits
    }
}

const MICRORADIANS: Factor = Factor::of(1e6 * TAU / COUNTS_PER_TURN as f64);
const MICRORADIANS_PER_SECOND: Factor = Factor::of(1e6 * TAU * 0.229 / 60.0);
const MICRORADIANS_PER_SECOND_SQUARED: Factor = Factor::of(1e6 * TAU * 214.577 / 3_600.0);
