//! The boards that images are made for.

use clap::ValueEnum;
use vergence_image::layout::HARDWARE;
use vergence_plant::NATIVE_HARDWARE;

/// A kind of board.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum Hardware {
    /// The controller board: NUCLEO-G474RE.
    #[value(name = "nucleo-g474")]
    NucleoG474,
    /// The board of 'vergence sim'.
    NativeSim,
}

impl Hardware {
    /// The number that image headers hold.
    #[must_use]
    pub const fn id(self) -> u32 {
        match self {
            Self::NucleoG474 => HARDWARE,
            Self::NativeSim => NATIVE_HARDWARE,
        }
    }
}
