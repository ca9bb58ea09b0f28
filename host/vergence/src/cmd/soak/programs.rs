//! The programs of the board for `vergence soak`: the application and the boot loader.

use std::path::{Path, PathBuf};

use vergence_image::sha256;
use vergence_mcu::Firmware;
use vergence_soak::ChipFlash;
use vergence_soak::differential::Delivered;
use vergence_soak::power_cuts::SignedImage;

use crate::failure::Failure;
use crate::firmware::{APPLICATION, BOOT_LOADER, DEVELOPMENT, SecretKey, hex};

/// Options that name the programs.
#[derive(Debug, clap::Args)]
#[group(skip)]
pub struct Options {
    /// Play on the board's own firmware on the simulated chip: this application, or without a value the one that cargo
    /// built in this repository. With --power-cuts: the image before the update and, in other words, the one after it.
    #[arg(long, value_name = "ELF", num_args = 0..=1, default_missing_value = APPLICATION)]
    elf: Option<PathBuf>,
    /// The boot loader that starts it.
    #[arg(long, value_name = "ELF", default_value = BOOT_LOADER)]
    boot_loader: PathBuf,
}

/// The programs, and what they are.
pub struct Programs {
    /// The boot loader.
    pub boot_loader: Firmware,
    /// The application, sealed with the development key, and its twin of other bytes.
    pub images: [SignedImage; 2],
    /// SHA-256 of both files in hexadecimal digits.
    pub digest: String,
}

impl Options {
    /// Whether scenarios are to be played on the chip.
    pub const fn on_chip(&self) -> bool {
        self.elf.is_some()
    }

    /// The flash of a board with both programs.
    pub fn flash(&self) -> Result<ChipFlash, Failure> {
        let programs = self.read()?;
        let [application, _] = &programs.images;
        ChipFlash::new(&programs.boot_loader, application)
            .ok_or_else(|| Failure::usage("boot loader and application do not fit into flash"))
    }

    /// Both boards with the same programs, and the image of an update.
    pub fn delivered(&self) -> Result<Delivered, Failure> {
        let [(application, _), (boot_loader, _)] = self.files()?;
        let key = SecretKey::named(Path::new(DEVELOPMENT))?;
        Delivered::new(&boot_loader, &application, |header| key.seal(header))
            .ok_or_else(|| Failure::usage("boot loader and application do not fit into flash"))
    }

    /// The files of application and boot loader.
    fn files(&self) -> Result<[(Firmware, Vec<u8>); 2], Failure> {
        let application = self.elf.as_deref().unwrap_or(Path::new(APPLICATION));
        Ok([read(application)?, read(&self.boot_loader)?])
    }

    /// Reads both programs.
    pub fn read(&self) -> Result<Programs, Failure> {
        let [(application, elf), (boot_loader, boot_elf)] = self.files()?;
        let key = SecretKey::named(Path::new(DEVELOPMENT))?;
        let images = SignedImage::before_and_after(&application, |header| key.seal(header));
        Ok(Programs { boot_loader, images, digest: hex(&sha256(&[elf, boot_elf].concat())) })
    }
}

fn read(path: &Path) -> Result<(Firmware, Vec<u8>), Failure> {
    let bytes = std::fs::read(path)
        .map_err(|error| Failure::input(path, format!("{error}; docs/firmware.md says how the firmware is built")))?;
    let firmware = Firmware::from_elf(&bytes).map_err(|error| Failure::input(path, error))?;
    Ok((firmware, bytes))
}
