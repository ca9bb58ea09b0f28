//! Firmware on the command line: the boards that images are made for, and where the documented commands leave what they build.

use std::path::Path;

use clap::ValueEnum;
use vergence_board::FirmwareImage;
use vergence_image::layout::HARDWARE;
use vergence_plant::NATIVE_HARDWARE;
use vergence_sim::ApplicationError;

pub use vergence_board::{DEVELOPMENT, PublicKey, SecretKey, fresh_secret, header_json, hex, parse_version};
pub use vergence_sim::build_of;

use crate::failure::Failure;

/// The application's ELF file, from the top of the repository (docs/firmware.md).
pub const APPLICATION: &str = "firmware/nucleo-g474/target/thumbv7em-none-eabihf/release/vergence-nucleo-g474";
/// The boot loader's ELF file.
pub const BOOT_LOADER: &str = "firmware/nucleo-g474/target/thumbv7em-none-eabihf/release/vergence-bootloader";

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

/// The bytes of an application in flash, from an ELF file or such bytes.
///
/// # Errors
/// Says what is wrong with it.
pub fn flatten(file: &[u8], hardware: Hardware) -> Result<Vec<u8>, ApplicationError> {
    vergence_sim::flatten(file, hardware.id())
}

/// Reads a signed image file.
///
/// # Errors
/// A usage failure that names the file: it cannot be read, is no image, or is damaged.
pub fn read_image(path: &Path) -> Result<FirmwareImage, Failure> {
    FirmwareImage::read(path).map_err(|error| Failure::input(path, error))
}
