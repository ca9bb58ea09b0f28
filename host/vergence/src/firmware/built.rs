//! Where the documented commands leave what they build, from the top of the repository (docs/firmware.md).

/// The application's ELF file.
pub const APPLICATION: &str = "firmware/nucleo-g474/target/thumbv7em-none-eabihf/release/vergence-nucleo-g474";
/// The boot loader's ELF file.
pub const BOOT_LOADER: &str = "firmware/nucleo-g474/target/thumbv7em-none-eabihf/release/vergence-bootloader";
