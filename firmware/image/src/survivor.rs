//! What the board remembers through a reset, in RAM that no start-up code touches. Power-off forgets it.

use crc::{CRC_32_ISCSI, Crc, NoTable};

/// How many words it takes.
pub const SURVIVOR_WORDS: usize = 14;
const MAGIC: u32 = 0x5355_5256;
const CASTAGNOLI: Crc<u32, NoTable> = Crc::<u32, NoTable>::new(&CRC_32_ISCSI);

/// Facts that outlive a reset.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Survivor {
    /// Starts of the application since it last proved healthy.
    pub failed_starts: u32,
    /// Whether the boot loader shall stay in its serial recovery at the next start.
    pub recovery_wanted: bool,
    /// Starts since power-on.
    pub starts: u32,
    /// How the application last died.
    pub death: Option<Death>,
}

/// How an application died.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Death {
    /// Of what.
    pub kind: DeathKind,
    /// Panic: the line. Fault: the address of the instruction.
    pub at: u32,
    /// Panic: 0. Fault: the return address.
    pub from: u32,
    /// Panic: the end of the file's name. Fault: zeros.
    pub file: [u8; 24],
}

/// Of what an application died.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum DeathKind {
    /// A Rust panic.
    Panic,
    /// A hard fault of the core.
    HardFault,
}

impl Survivor {
    /// Reads it; whatever is not intact counts as forgotten.
    #[must_use]
    pub fn from_words(words: &[u32; SURVIVOR_WORDS]) -> Self {
        if words[0] != MAGIC || words[SURVIVOR_WORDS - 1] != check(words) {
            return Self::default();
        }
        let kind = match words[4] {
            1 => Some(DeathKind::Panic),
            2 => Some(DeathKind::HardFault),
            _ => None,
        };
        let mut file = [0; 24];
        for (bytes, word) in file.chunks_exact_mut(4).zip(&words[7..13]) {
            bytes.copy_from_slice(&word.to_le_bytes());
        }
        Self {
            failed_starts: words[1],
            recovery_wanted: words[2] != 0,
            starts: words[3],
            death: kind.map(|kind| Death { kind, at: words[5], from: words[6], file }),
        }
    }

    /// The words to keep.
    #[must_use]
    pub fn to_words(&self) -> [u32; SURVIVOR_WORDS] {
        let mut words = [0; SURVIVOR_WORDS];
        words[0] = MAGIC;
        words[1] = self.failed_starts;
        words[2] = u32::from(self.recovery_wanted);
        words[3] = self.starts;
        if let Some(death) = self.death {
            words[4] = match death.kind {
                DeathKind::Panic => 1,
                DeathKind::HardFault => 2,
            };
            words[5] = death.at;
            words[6] = death.from;
            for (word, bytes) in words[7..13].iter_mut().zip(death.file.as_chunks::<4>().0) {
                *word = u32::from_le_bytes(*bytes);
            }
        }
        words[SURVIVOR_WORDS - 1] = check(&words);
        words
    }
}

impl Death {
    /// A panic at `line` of `file`.
    #[must_use]
    pub fn panic(file: &str, line: u32) -> Self {
        let mut name = [0; 24];
        let bytes = file.as_bytes();
        let tail = &bytes[bytes.len().saturating_sub(name.len())..];
        name[..tail.len()].copy_from_slice(tail);
        Self { kind: DeathKind::Panic, at: line, from: 0, file: name }
    }

    /// A hard fault of the instruction at `pc`, called from `lr`.
    #[must_use]
    pub const fn hard_fault(pc: u32, lr: u32) -> Self {
        Self { kind: DeathKind::HardFault, at: pc, from: lr, file: [0; 24] }
    }

    /// The end of the file's name, or nothing.
    #[must_use]
    pub fn file(&self) -> &str {
        let length = self.file.iter().position(|&byte| byte == 0).unwrap_or(self.file.len());
        core::str::from_utf8(&self.file[..length]).unwrap_or_default()
    }
}

fn check(words: &[u32; SURVIVOR_WORDS]) -> u32 {
    let mut digest = CASTAGNOLI.digest();
    for word in &words[..SURVIVOR_WORDS - 1] {
        digest.update(&word.to_le_bytes());
    }
    digest.finalize()
}
