//! Why a chip stops by itself, with messages.

use vergence_cpu::{Access, Cycle};

/// An action of the firmware that the model does not implement, or that the silicon does not allow.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum Trouble {
    /// The model has no peripheral at the address.
    #[error("nothing is modelled at {address:#010x}")]
    Unmapped {
        /// The address.
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
    /// The clock of the peripheral is off: it does not respond.
    #[error("{unit} is used while its clock is off in RCC ({register})")]
    ClockOff {
        /// The peripheral.
        unit: String,
        /// The register.
        register: &'static str,
    },
    /// The model of the register does not implement this access.
    #[error("{unit}.{register} (offset {offset:#x}), value {value:#010x}: {what}")]
    Refused {
        /// The peripheral.
        unit: String,
        /// The register.
        register: &'static str,
        /// Bytes from the peripheral's base.
        offset: u32,
        /// The value written; zero for a read.
        value: u32,
        /// The reason for the refusal.
        what: String,
    },
    /// An access that is too narrow for the register.
    #[error("{unit}.{register} is accessed as {access:?}")]
    Narrow {
        /// The peripheral.
        unit: String,
        /// The register.
        register: &'static str,
        /// The width of the access.
        access: Access,
    },
    /// Clocks that the silicon does not allow.
    #[error("{what}")]
    Clocks {
        /// The rule that is violated.
        what: String,
    },
    /// Peripherals cause events of each other without end.
    #[error("peripherals keep each other busy at cycle {at} ({unit})")]
    Endless {
        /// The instant.
        at: Cycle,
        /// One of them.
        unit: String,
    },
}

/// Why the chip asks its machine to stop.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) enum Demand {
    Trouble(Trouble),
    Watchdog,
    OptionBytes,
    PowerLost,
    /// An operation of the flash begins.
    FlashBegins,
}
