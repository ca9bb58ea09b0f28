//! What drives a simulated rig: the controller core without a chip, or the unmodified firmware on a simulated one.

use std::fmt;

use vergence_board::Served;
use vergence_plant::Plant;
use vergence_protocol::Microseconds;

use crate::SimulatedChip;
use crate::native::Native;

/// The board of a simulated rig.
pub(crate) enum Controller {
    /// The controller core, compiled for this computer.
    Native(Box<Native>),
    /// The firmware on a simulated chip, and the time since power-on to which it was run.
    Chip(Box<SimulatedChip>, Microseconds),
}

impl Controller {
    /// Time on the clock of the mechanics and of the pulses: that of the native board, or the time since power-on.
    pub(crate) fn now(&self) -> Microseconds {
        match self {
            Self::Native(native) => native.board.now(),
            Self::Chip(_, now) => *now,
        }
    }

    /// The same at this time after the simulation began, in microseconds.
    pub(crate) fn time_at(&mut self, elapsed_us: u64) -> Microseconds {
        match self {
            Self::Native(native) => native.clock_at(elapsed_us),
            Self::Chip(..) => Microseconds(elapsed_us),
        }
    }

    /// Runs board and mechanics to this time.
    pub(crate) fn advance(&mut self, to: Microseconds) {
        match self {
            Self::Native(native) => native.board.advance(to),
            Self::Chip(chip, now) => {
                chip.run_until(to.0);
                *now = to;
                // The chip moves them only when something happens at its pins.
                self.with_plant(|plant| plant.advance(to));
            }
        }
    }

    /// Bytes that the board has sent since the last call.
    pub(crate) fn transmit(&mut self) -> Vec<u8> {
        match self {
            Self::Native(native) => native.board.transmit(),
            Self::Chip(chip, _) => chip.take_output(),
        }
    }

    /// The mechanics.
    pub(crate) fn plant(&self) -> &Plant {
        match self {
            Self::Native(native) => native.board.plant(),
            Self::Chip(chip, _) => chip.plant(),
        }
    }

    /// Does something to the mechanics.
    pub(crate) fn with_plant<R>(&mut self, act: impl FnOnce(&mut Plant) -> R) -> R {
        match self {
            Self::Native(native) => act(native.board.plant_mut()),
            Self::Chip(chip, _) => chip.machine().chip_mut().with_world(|bench, _| act(bench.plant_mut())),
        }
    }

    /// The native board; `None` where a chip is simulated.
    pub(crate) fn native(&mut self) -> Option<&mut Native> {
        match self {
            Self::Native(native) => Some(native),
            Self::Chip(..) => None,
        }
    }
}

impl fmt::Debug for Controller {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Native(native) => native.fmt(f),
            Self::Chip(_, now) => f.debug_tuple("Chip").field(now).finish_non_exhaustive(),
        }
    }
}
