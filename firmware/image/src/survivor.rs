//! Memory that the board keeps through a reset, in RAM that no start-up code touches. It is lost at power-off.

use crc::{CRC_32_ISCSI, Crc, NoTable};

/// Length of the memory in 32-bit words.
pub const SURVIVOR_WORDS: usize = 14;
const MAGIC: u32 = 0x5355_5256;
/// Bits of the word that says what the next start is to do.
const RECOVERY: u32 = 1;
const DEFAULTS: u32 = 2;
const CASTAGNOLI: Crc<u32, NoTable> = Crc::<u32, NoTable>::new(&CRC_32_ISCSI);

/// Facts that outlive a reset.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Survivor {
    /// Number of starts of the application since it last ran without failing.
    pub failed_starts: u32,
    /// Whether the boot loader is to stay in its serial recovery at the next start.
    pub recovery_wanted: bool,
    /// Whether the application is to leave the saved settings aside at its next start.
    pub defaults_wanted: bool,
    /// Number of starts since power-on.
    pub starts: u32,
    /// How the program died last, if it did.
    pub death: Option<Death>,
}

/// Number of addresses kept of a death.
pub const TRACE: usize = 8;

/// How a program died.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Death {
    /// Cause of the death.
    pub kind: DeathKind,
    /// Return addresses of the calls that led to the place, the latest first; after a hard fault the address of the
    /// instruction goes before them. Filled up with zeros.
    pub trace: [u32; TRACE],
}

/// Cause of a death.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum DeathKind {
    /// A Rust panic.
    Panic,
    /// A hard fault of the core.
    HardFault,
    /// The program could not work with its default settings.
    Settings,
    /// The program could not open the serial line.
    SerialLine,
}

impl DeathKind {
    const ALL: [Self; 4] = [Self::Panic, Self::HardFault, Self::Settings, Self::SerialLine];

    /// Number of the kind from 1; zero means no death.
    const fn number(self) -> u32 {
        self as u32 + 1
    }

    fn from_number(number: u32) -> Option<Self> {
        Self::ALL.into_iter().find(|kind| kind.number() == number)
    }
}

impl Survivor {
    /// Reads the memory; if it is not intact, all is forgotten.
    #[must_use]
    pub fn from_words(words: &[u32; SURVIVOR_WORDS]) -> Self {
        if words[0] != MAGIC || words[SURVIVOR_WORDS - 1] != check(words) {
            return Self::default();
        }
        let mut trace = [0; TRACE];
        trace.copy_from_slice(&words[5..13]);
        Self {
            failed_starts: words[1],
            recovery_wanted: words[2] & RECOVERY != 0,
            defaults_wanted: words[2] & DEFAULTS != 0,
            starts: words[3],
            death: DeathKind::from_number(words[4]).map(|kind| Death { kind, trace }),
        }
    }

    /// The memory as words.
    #[must_use]
    pub fn to_words(&self) -> [u32; SURVIVOR_WORDS] {
        let mut words = [0; SURVIVOR_WORDS];
        words[0] = MAGIC;
        words[1] = self.failed_starts;
        words[2] = u32::from(self.recovery_wanted) * RECOVERY + u32::from(self.defaults_wanted) * DEFAULTS;
        words[3] = self.starts;
        if let Some(death) = self.death {
            words[4] = death.kind.number();
            words[5..13].copy_from_slice(&death.trace);
        }
        words[SURVIVOR_WORDS - 1] = check(&words);
        words
    }
}

impl Death {
    /// The addresses without the zeros that fill up the list.
    #[must_use]
    pub fn trace(&self) -> &[u32] {
        let length = self.trace.iter().position(|&address| address == 0).unwrap_or(TRACE);
        &self.trace[..length]
    }
}

fn check(words: &[u32; SURVIVOR_WORDS]) -> u32 {
    let mut digest = CASTAGNOLI.digest();
    for word in &words[..SURVIVOR_WORDS - 1] {
        digest.update(&word.to_le_bytes());
    }
    digest.finalize()
}
