//! Firmware images on the host: keys, files, and what becomes of an ELF file.

mod built;
mod flat;
mod hardware;
mod image;
mod keys;

pub use built::{APPLICATION, BOOT_LOADER};
pub use flat::{build_of, elf_start, flatten, is_elf};
pub use hardware::Hardware;
pub use image::{header_json, parse_version, read_image};
pub use keys::{DEVELOPMENT, PublicKey, SecretKey, fresh_secret, hex};
