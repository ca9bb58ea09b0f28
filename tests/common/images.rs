//! Images to flash: keys, applications, ELF files.

use super::run_json;

/// Where applications start.
pub const START: u32 = 0x0801_0000;
pub const ARM: u16 = 40;

/// A vector table for the application's place in flash, code, and a build id as the linker notes it.
pub fn application() -> Vec<u8> {
    let mut bytes = vec![0; 64];
    bytes[..4].copy_from_slice(&0x2001_7C00_u32.to_le_bytes());
    bytes[4..8].copy_from_slice(&0x0801_0041_u32.to_le_bytes());
    bytes.extend([4, 0, 0, 0, 20, 0, 0, 0, 3, 0, 0, 0]);
    bytes.extend(b"GNU\0\x01\x23\x45\x67\x89\xab\xcd\xef and the rest");
    bytes
}

/// A 32-bit little-endian ELF file of `machine` with these segments (TIS ELF specification 1.2).
pub fn elf(machine: u16, segments: &[(u32, &[u8])]) -> Vec<u8> {
    let (head, entry) = (52, 32);
    let mut at = head + entry * segments.len() as u32;
    let mut file = b"\x7fELF\x01\x01\x01\0\0\0\0\0\0\0\0\0".to_vec();
    file.extend([2u16, machine].map(u16::to_le_bytes).concat());
    file.extend([1, START + 0x41, head, 0, 0].map(u32::to_le_bytes).concat());
    file.extend([head as u16, entry as u16, segments.len() as u16, 40, 0, 0].map(u16::to_le_bytes).concat());
    for (address, data) in segments {
        let length = data.len() as u32;
        // Loaded from `address`, but running in RAM, as initialised variables do.
        file.extend([1, at, 0x2000_0000, *address, length, length, 5, 4].map(u32::to_le_bytes).concat());
        at += length;
    }
    segments.iter().for_each(|(_, data)| file.extend(*data));
    file
}

/// A folder for keys, files and images.
pub struct Workshop(tempfile::TempDir);

impl Workshop {
    pub fn new() -> Self {
        Self(tempfile::tempdir().expect("a temporary folder"))
    }

    pub fn path(&self, name: &str) -> String {
        self.0.path().join(name).to_string_lossy().into_owned()
    }

    pub fn file(&self, name: &str, content: &[u8]) -> String {
        let path = self.path(name);
        std::fs::write(&path, content).expect("written");
        path
    }

    /// A new secret key, and its public half.
    pub fn key(&self, name: &str) -> [String; 2] {
        let secret = self.path(name);
        let made = run_json(&["image", "keygen", "--out", &secret, "--json"]);
        [secret, made["public"].as_str().expect("a name").to_owned()]
    }

    /// Signs `content`; returns the image's path and what was said of it.
    pub fn sign(
        &self,
        content: &[u8],
        key: &str,
        hardware: &str,
        version: &str,
        name: &str,
    ) -> (String, serde_json::Value) {
        let input = self.file(&format!("{name}.input"), content);
        let out = self.path(name);
        let options = ["--key", key, "--version", version, "--hardware", hardware, "--out", &out, "--json"];
        let said = run_json(&[&["image", "sign", &input], &options[..]].concat());
        (out, said)
    }
}
