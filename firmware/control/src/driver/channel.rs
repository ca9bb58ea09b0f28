//! One driver: is it there, give it its settings, read them back, watch it.
//!
//! ```text
//! Identify --> CountBefore --> Write 0..8 --> CountAfter --> Verify 0..3 --> Watch
//! Watch --other settings--> Doubt
//! any --three exchanges failed, wrong value, error flag--> Rest (100 ms) --> Identify
//! ```

use vergence_protocol::{DriverState, FaultCode, Microseconds};

use super::registers::{Register, VERSION, configuration, drv_status, gstat};
use super::settings::{DriverKind, DriverSettings};

/// Exchanges that may fail in a row before the driver counts as failed.
const TRIES: u8 = 3;
/// Time after a failure until the driver is asked again, in microseconds: long enough for the control tick to see it.
const REST_US: u64 = 100_000;
/// Registers read back after the settings were written: both that can be read, and whether a reset came in between.
const VERIFIED: [Register; 3] = [Register::GConf, Register::ChopConf, Register::GStat];
/// What is read in turn while all is well: every second time what a short circuit shows in.
const WATCHED: [Register; 8] = [
    Register::DrvStatus,
    Register::GStat,
    Register::DrvStatus,
    Register::GConf,
    Register::DrvStatus,
    Register::GStat,
    Register::DrvStatus,
    Register::ChopConf,
];

/// The next datagram for a driver.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Order {
    Read(Register),
    Write(Register, u32),
}

/// What came of an exchange.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Outcome {
    /// The value read; zero after a write.
    Value(u32),
    Silence,
    Garbage,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Phase {
    Identify,
    CountBefore,
    Write {
        index: usize,
        before: u32,
    },
    CountAfter {
        before: u32,
    },
    Verify {
        index: usize,
    },
    Watch {
        turn: usize,
    },
    /// The driver has other settings than it was given: was it reset?
    Doubt,
    Rest {
        until: Microseconds,
    },
}

/// The supervisor of one driver.
#[derive(Clone, Debug)]
pub(super) struct Channel {
    settings: DriverSettings,
    phase: Phase,
    state: DriverState,
    failed_tries: u8,
}

impl Channel {
    pub fn new(settings: DriverSettings) -> Self {
        let state = match settings.kind {
            DriverKind::Plain | DriverKind::Servo => DriverState::Plain,
            DriverKind::Tmc2209 => DriverState::Starting,
        };
        Self { settings, phase: Phase::Identify, state, failed_tries: 0 }
    }

    pub fn settings(&self) -> &DriverSettings {
        &self.settings
    }

    pub fn state(&self) -> DriverState {
        self.state
    }

    /// When the next exchange may begin; `None` for a driver without serial line.
    pub fn due(&self) -> Option<Microseconds> {
        let until = if let Phase::Rest { until } = self.phase { until } else { Microseconds(0) };
        (self.settings.kind == DriverKind::Tmc2209).then_some(until)
    }

    /// Whether nothing waits for the next exchange: the driver is only watched, or rests after a failure.
    pub fn is_calm(&self) -> bool {
        match self.phase {
            Phase::Watch { .. } => self.state.is_usable(),
            Phase::Rest { .. } => true,
            _ => self.settings.kind != DriverKind::Tmc2209,
        }
    }

    /// The next datagram.
    pub fn order(&self) -> Order {
        match self.phase {
            Phase::Identify | Phase::Rest { .. } => Order::Read(Register::IoIn),
            Phase::CountBefore | Phase::CountAfter { .. } => Order::Read(Register::IfCnt),
            Phase::Write { index, .. } => {
                let writes = configuration(&self.settings);
                let (register, value) = writes[index % writes.len()];
                Order::Write(register, value)
            }
            Phase::Verify { index } => Order::Read(VERIFIED[index % VERIFIED.len()]),
            Phase::Watch { turn } => Order::Read(WATCHED[turn % WATCHED.len()]),
            Phase::Doubt => Order::Read(Register::GStat),
        }
    }

    /// Takes the outcome of the exchange that [`Self::order`] began.
    pub fn take(&mut self, now: Microseconds, outcome: Outcome) {
        let value = match outcome {
            Outcome::Value(value) => value,
            Outcome::Silence => return self.try_again(now, FaultCode::DriverSilent),
            Outcome::Garbage => return self.try_again(now, FaultCode::DriverGarbled),
        };
        self.failed_tries = 0;
        let order = self.order();
        let writes = configuration(&self.settings);
        self.phase = match self.phase {
            Phase::Identify | Phase::Rest { .. } if value >> 24 != VERSION => {
                return self.fail(now, FaultCode::DriverUnset);
            }
            Phase::Identify | Phase::Rest { .. } => Phase::CountBefore,
            Phase::CountBefore => Phase::Write { index: 0, before: value },
            Phase::Write { index, before } if index + 1 < writes.len() => Phase::Write { index: index + 1, before },
            Phase::Write { before, .. } => Phase::CountAfter { before },
            // A driver takes no write with a wrong checksum, and does not count it.
            Phase::CountAfter { before } if value.wrapping_sub(before) & 0xFF != writes.len() as u32 => {
                return self.fail(now, FaultCode::DriverUnset);
            }
            Phase::CountAfter { .. } => Phase::Verify { index: 0 },
            Phase::Doubt => {
                let code = self.judge(order, value).unwrap_or(FaultCode::DriverUnset);
                return self.fail(now, code);
            }
            Phase::Verify { .. } | Phase::Watch { .. } => match self.judge(order, value) {
                Some(FaultCode::DriverUnset) => Phase::Doubt,
                Some(code) => return self.fail(now, code),
                None => self.after_a_good_value(),
            },
        };
    }

    /// The fault that a value read from a driver with its settings shows.
    fn judge(&mut self, order: Order, value: u32) -> Option<FaultCode> {
        let Order::Read(register) = order else { return None };
        match register {
            Register::GStat if value & (gstat::RESET | gstat::UNDERVOLTAGE) != 0 => Some(FaultCode::DriverReset),
            Register::DrvStatus if value & drv_status::OVERHEATED != 0 => Some(FaultCode::DriverOverheated),
            Register::DrvStatus if value & drv_status::SHORT != 0 => Some(FaultCode::DriverShort),
            Register::DrvStatus => {
                let is_hot = value & drv_status::HOT != 0;
                self.state = if is_hot { DriverState::Hot } else { DriverState::Ready };
                None
            }
            Register::GConf | Register::ChopConf => {
                let written = configuration(&self.settings).into_iter().find(|(written, _)| *written == register);
                written.is_some_and(|(_, written)| written != value).then_some(FaultCode::DriverUnset)
            }
            _ => None,
        }
    }

    fn after_a_good_value(&self) -> Phase {
        match self.phase {
            Phase::Verify { index } if index + 1 < VERIFIED.len() => Phase::Verify { index: index + 1 },
            Phase::Watch { turn } => Phase::Watch { turn: (turn + 1) % WATCHED.len() },
            // The first look at DRV_STATUS makes the driver ready, or not.
            _ => Phase::Watch { turn: 0 },
        }
    }

    fn try_again(&mut self, now: Microseconds, code: FaultCode) {
        self.failed_tries += 1;
        match self.phase {
            _ if self.failed_tries >= TRIES => self.fail(now, code),
            // Of a write nobody knows whether it counted: begin anew.
            Phase::Write { .. } => self.phase = Phase::CountBefore,
            _ => {}
        }
    }

    fn fail(&mut self, now: Microseconds, code: FaultCode) {
        self.failed_tries = 0;
        self.state = DriverState::Failed(code);
        self.phase = Phase::Rest { until: Microseconds(now.0 + REST_US) };
    }
}
