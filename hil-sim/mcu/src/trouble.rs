//! Why a chip stops by itself, in words.

use vergence_cpu::{Access, Cycle};

/// Something that firmware did and the model cannot honour, or the silicon would not.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum Trouble {
    /// No peripheral of the model is there.
    #[error("nothing is modelled at {address:#010x}")]
    Unmapped {
        /// Where.
        address: u32,
    },
    /// The peripheral has no such register.
    #[error("{unit} has no register at offset {offset:#x} in the model")]
    NoRegister {
        /// The peripheral.
        unit: String,
        /// Bytes from its base.
        offset: u32,
    },
    /// The peripheral's clock is off: it neither hears nor answers.
    #[error("{unit} is used while its clock is off in RCC ({register})")]
    ClockOff {
        /// The peripheral.
        unit: String,
        /// The register.
        register: &'static str,
    },
    /// The register does not do that.
    #[error("{unit}.{register} (offset {offset:#x}), value {value:#010x}: {what}")]
    Refused {
        /// The peripheral.
        unit: String,
        /// The register.
        register: &'static str,
        /// Bytes from the peripheral's base.
        offset: u32,
        /// What was written; zero for a read.
        value: u32,
        /// What is wrong with it.
        what: String,
    },
    /// An access that is too narrow for the register.
    #[error("{unit}.{register} is accessed as {access:?}")]
    Narrow {
        /// The peripheral.
        unit: String,
        /// The register.
        register: &'static str,
        /// How wide.
        access: Access,
    },
    /// Clocks that the silicon does not allow.
    #[error("{what}")]
    Clocks {
        /// What is wrong.
        what: String,
    },
    /// Peripherals keep each other busy without end.
    #[error("peripherals keep each other busy at cycle {at} ({unit})")]
    Endless {
        /// When.
        at: Cycle,
        /// One of them.
        unit: String,
    },
}

/// What the chip asks of whoever runs it.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) enum Demand {
    Trouble(Trouble),
    Watchdog,
    OptionBytes,
    PowerLost,
    /// An operation of the flash begins.
    FlashBegins,
}
