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
    /// What images for it name as their hardware.
    #[must_use]
    pub const fn id(self) -> u32 {
        match self {
            Self::NucleoG474 => HARDWARE,
            Self::NativeSim => NATIVE_HARDWARE,
        }
    }

    const fn name(self) -> &'static str {
        match self {
            Self::NucleoG474 => "nucleo-g474",
            Self::NativeSim => "native-sim",
        }
    }
}

/// The name of a board, or its number where it is unknown.
#[must_use]
pub fn hardware_name(id: u32) -> String {
    let known = Hardware::value_variants().iter().find(|hardware| hardware.id() == id);
    known.map_or_else(|| format!("unknown hardware {id:#010x}"), |hardware| hardware.name().into())
}
