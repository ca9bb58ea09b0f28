//! FLASH: erasing and programming with their times, error flags, ECC and power cuts (RM0440 §3).

use std::collections::BTreeSet;

use vergence_cpu::{Access, Cycle, Lines};

use crate::clocks::Clocks;
use crate::flash_cells::leave;
use crate::memory::FLASH_SIZE;
use crate::peripheral::{Moment, Peripheral, Registers, Reply, only};
use crate::power_cut::{Damage, PowerCut};
use crate::time::Picoseconds;

const ACR: u32 = 0x00;
const KEYR: u32 = 0x08;
const OPTKEYR: u32 = 0x0C;
const SR: u32 = 0x10;
const CR: u32 = 0x14;
const ECCR: u32 = 0x18;
const OPTR: u32 = 0x20;

const REGISTERS: Registers = &[
    (ACR, "ACR"),
    (KEYR, "KEYR"),
    (OPTKEYR, "OPTKEYR"),
    (SR, "SR"),
    (CR, "CR"),
    (ECCR, "ECCR"),
    (OPTR, "OPTR"),
    (0x24, "PCROP1SR"),
    (0x28, "PCROP1ER"),
    (0x2C, "WRP1AR"),
    (0x30, "WRP1BR"),
    (0x44, "PCROP2SR"),
    (0x48, "PCROP2ER"),
    (0x4C, "WRP2AR"),
    (0x50, "WRP2BR"),
    (0x70, "SEC1R"),
    (0x74, "SEC2R"),
];

/// Typical times (DS12288, flash memory characteristics): one page, one double word, one bank.
const PAGE_ERASE: Picoseconds = Picoseconds::microseconds(22_020);
const DOUBLE_WORD: Picoseconds = Picoseconds::nanoseconds(81_690);
const BANK_ERASE: Picoseconds = Picoseconds::microseconds(22_130);

const EOP: u32 = 1 << 0;
const PROGERR: u32 = 1 << 3;
const PGAERR: u32 = 1 << 5;
const SIZERR: u32 = 1 << 6;
const PGSERR: u32 = 1 << 7;
/// Every error flag of SR.
const ERRORS: u32 = 0xC3FA;

const PG: u32 = 1 << 0;
const PER: u32 = 1 << 1;
const MER: [u32; 2] = [1 << 2, 1 << 15];
const BKER: u32 = 1 << 11;
const STRT: u32 = 1 << 16;
const EOPIE: u32 = 1 << 24;
const ERRIE: u32 = 1 << 25;
const OPTLOCK: u32 = 1 << 30;
const LOCK: u32 = 1 << 31;

/// Factory option bytes: dual bank, all protections off (§3.7.8).
const FACTORY_OPTIONS: u32 = 0xFFEF_F8AA;

/// Bytes of a bank, and of a page in dual-bank mode.
const BANK: usize = FLASH_SIZE / 2;
pub(crate) const PAGE: usize = 2048;

/// An operation of the flash, which takes time.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum FlashOperation {
    /// Erases a page, given by its first byte.
    ErasePage(u32),
    /// Erases a bank, 0 or 1.
    EraseBank(u8),
    /// Programs a double word at an offset.
    Program {
        /// Bytes from the start of flash, a multiple of eight.
        offset: u32,
        /// The new contents.
        value: u64,
    },
}

impl FlashOperation {
    fn duration(self) -> Picoseconds {
        match self {
            Self::ErasePage(_) => PAGE_ERASE,
            Self::EraseBank(_) => BANK_ERASE,
            Self::Program { .. } => DOUBLE_WORD,
        }
    }

    /// The range of bytes that the operation changes.
    #[must_use]
    pub fn range(self) -> std::ops::Range<usize> {
        match self {
            Self::ErasePage(offset) => offset as usize..offset as usize + PAGE,
            Self::EraseBank(bank) => usize::from(bank) * BANK..(usize::from(bank) + 1) * BANK,
            Self::Program { offset, .. } => offset as usize..offset as usize + 8,
        }
    }

    fn bank(self) -> u8 {
        u8::from(self.range().start >= BANK)
    }
}

/// The effect of an operation that begins; the chip applies it, since it owns the memory.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Change {
    Done(FlashOperation),
    Cut(FlashOperation, PowerCut),
}

/// The flash interface.
#[derive(Clone, Debug)]
pub(crate) struct Flash {
    acr: u32,
    sr: u32,
    cr: u32,
    eccr: u32,
    optr: u32,
    keys: [u32; 2],
    running: Option<(FlashOperation, Picoseconds)>,
    /// The first word of a double word, waiting for the second.
    half: Option<(u32, u32)>,
    /// Operations begun since power-on of the simulation.
    pub operations: u64,
    /// Whether each operation stops the machine.
    pub announces: bool,
    pub cut: Option<PowerCut>,
    pub changes: Vec<Change>,
    /// Double words, by index, that ECC cannot correct.
    pub torn: BTreeSet<u32>,
    pub reload_options: bool,
}

impl Flash {
    pub fn new() -> Self {
        Self {
            acr: 0x0004_0600,
            sr: 0,
            cr: LOCK | OPTLOCK,
            eccr: 0,
            optr: FACTORY_OPTIONS,
            keys: [0; 2],
            running: None,
            half: None,
            operations: 0,
            announces: false,
            cut: None,
            changes: Vec::new(),
            torn: BTreeSet::new(),
            reload_options: false,
        }
    }

    /// Resets the registers; the cells keep their contents.
    pub fn reset(&mut self) {
        let fresh = Self::new();
        *self = Self {
            torn: std::mem::take(&mut self.torn),
            optr: self.optr,
            operations: self.operations,
            announces: self.announces,
            cut: self.cut,
            ..fresh
        };
    }

    /// OPTR.BOR_LEV (§3.7.8).
    pub fn brown_out_level(&self) -> usize {
        (self.optr >> 8 & 7) as usize
    }

    pub fn wait_states(&self) -> u32 {
        self.acr & 0xF
    }

    /// The operation in progress.
    pub fn running(&self) -> Option<FlashOperation> {
        self.running.map(|(operation, _)| operation)
    }

    pub fn options(&self) -> u32 {
        self.optr
    }

    /// The bank that is being erased or programmed and when it will be free: reading from it waits (§3.3.3).
    pub fn busy(&self) -> Option<(u8, Picoseconds)> {
        self.running.map(|(operation, until)| (operation.bank(), until))
    }

    /// Whether no operation is in progress and every word reads as it was written.
    pub fn is_calm(&self) -> bool {
        self.running.is_none() && self.torn.is_empty()
    }

    /// Whether writing flash may begin an operation that ends in an interrupt: the core must check after each access.
    pub fn is_touchy(&self) -> bool {
        self.cr & PG != 0 && self.cr & (EOPIE | ERRIE) != 0
    }

    pub fn nmi(&self) -> bool {
        self.eccr >> 31 == 1
    }

    /// Takes a read of the double word with this index; returns whether ECC finds it torn (§3.3.4).
    pub fn check_ecc(&mut self, double_word: u32) {
        if self.torn.contains(&double_word) && self.eccr >> 31 == 0 {
            let bank = u32::from(double_word as usize * 8 >= BANK);
            let in_bank = double_word - bank * (BANK / 8) as u32;
            self.eccr = self.eccr & 0x0100_0000 | 1 << 31 | bank << 21 | (in_bank & 0x7_FFFF);
        }
    }

    /// Takes a write into flash at `offset`: two words make a double word (§3.3.7).
    pub fn program(&mut self, moment: Moment, offset: u32, access: Access, value: u32, cells: u64) {
        if self.cr & PG == 0 || self.cr & LOCK != 0 || self.sr & ERRORS != 0 || self.running.is_some() {
            return self.fail(PGSERR);
        }
        if access != Access::Word {
            return self.fail(SIZERR);
        }
        match self.half.take() {
            None if offset.is_multiple_of(8) => self.half = Some((offset, value)),
            Some((first, low)) if offset == first + 4 => {
                let value = u64::from(value) << 32 | u64::from(low);
                if cells != u64::MAX && value != 0 {
                    return self.fail(PROGERR);
                }
                self.begin(moment, FlashOperation::Program { offset: first, value });
            }
            _ => self.fail(PGAERR),
        }
    }

    fn fail(&mut self, flag: u32) {
        self.half = None;
        self.sr |= flag;
    }

    fn begin(&mut self, moment: Moment, operation: FlashOperation) {
        self.running = Some((operation, moment.time() + operation.duration()));
        self.operations += 1;
        match self.cut {
            Some(cut) if cut.operation == self.operations => {
                self.cut = None;
                self.changes.push(Change::Cut(operation, cut));
            }
            _ => self.changes.push(Change::Done(operation)),
        }
    }

    /// Takes the setting of STRT, which begins an erasure (§3.3.6). Page numbers count within the bank.
    fn start(&mut self, moment: Moment) -> Reply<()> {
        if self.sr & ERRORS != 0 || self.running.is_some() {
            self.fail(PGSERR);
            return Ok(());
        }
        let mass = MER.map(|bank| self.cr & bank != 0);
        let operation = match (self.cr & PER != 0, mass) {
            (true, [false, false]) => {
                let bank = usize::from(self.cr & BKER != 0);
                FlashOperation::ErasePage((bank * BANK + (self.cr >> 3 & 0x7F) as usize * PAGE) as u32)
            }
            (false, [true, false]) => FlashOperation::EraseBank(0),
            (false, [false, true]) => FlashOperation::EraseBank(1),
            (false, [true, true]) => return Err("erasing both banks at once is not modelled".into()),
            _ => {
                self.fail(PGSERR);
                return Ok(());
            }
        };
        self.begin(moment, operation);
        Ok(())
    }

    fn write_cr(&mut self, moment: Moment, value: u32) -> Reply<()> {
        if self.cr & LOCK != 0 {
            return Err("the flash is locked".into());
        }
        if self.running.is_some() {
            return Err("the control register is written during an operation".into());
        }
        only(value, 0xCF01_8BFF & !(0x3 << 28))?;
        if value & 1 << 27 != 0 {
            self.reload_options = true;
        }
        self.cr = value & !STRT;
        if value & STRT != 0 { self.start(moment) } else { Ok(()) }
    }

    /// Takes a key: the two keys in sequence unlock; a wrong one locks until the next reset (§3.3.5).
    fn write_key(&mut self, value: u32) -> Reply<()> {
        const KEYS: [u32; 2] = [0x4567_0123, 0xCDEF_89AB];
        self.keys = [self.keys[1], value];
        if self.keys == KEYS {
            self.cr &= !LOCK;
            self.keys = [0; 2];
        } else if value != KEYS[0] {
            return Err("a wrong key locks the flash until the next reset".into());
        }
        Ok(())
    }
}

impl Peripheral for Flash {
    fn registers(&self) -> Registers {
        REGISTERS
    }

    fn read(&mut self, _moment: Moment, offset: u32) -> Reply<u32> {
        Ok(match offset {
            ACR => self.acr,
            SR => self.sr | u32::from(self.running.is_some()) << 16,
            CR => {
                self.cr
                    | if self.running.is_some_and(|(op, _)| !matches!(op, FlashOperation::Program { .. })) {
                        STRT
                    } else {
                        0
                    }
            }
            ECCR => self.eccr,
            OPTR => self.optr,
            // No area is protected: starts lie above ends (§3.7.10 ff.).
            0x24 | 0x44 => 0x7FFF,
            0x2C | 0x30 | 0x4C | 0x50 => 0x0000_007F,
            _ => 0,
        })
    }

    fn write(&mut self, moment: Moment, offset: u32, value: u32) -> Reply<()> {
        match offset {
            ACR => {
                only(value, 0x0004_1F0F)?;
                self.acr = value;
            }
            KEYR => self.write_key(value)?,
            SR => self.sr &= !(value & (ERRORS | EOP)),
            CR => self.write_cr(moment, value)?,
            ECCR => {
                // Flags are cleared by writing one; ECCIE is bit 24.
                let cleared = self.eccr & !(value & 0xF000_0000);
                self.eccr = cleared & !(1 << 24) | value & 1 << 24;
            }
            _ => return Err("option bytes are read-only in the model".into()),
        }
        Ok(())
    }

    fn advance(&mut self, moment: Moment) {
        if self.running.is_some_and(|(_, until)| moment.clocks.base.cycle_at(until) <= moment.now) {
            self.running = None;
            // EOP comes only with its interrupt enabled (§3.7.5).
            if self.cr & EOPIE != 0 {
                self.sr |= EOP;
            }
        }
    }

    fn due(&self, clocks: &Clocks) -> Cycle {
        clocks.base.cycle_at(self.running.map_or(Picoseconds::NEVER, |(_, until)| until))
    }

    fn lines(&self) -> Lines {
        let done = self.cr & EOPIE != 0 && self.sr & EOP != 0;
        let failed = self.cr & ERRIE != 0 && self.sr & ERRORS != 0;
        if done || failed { 1 << 4 } else { 0 }
    }
}

impl Change {
    /// Applies the change to the cells; returns whether the power is gone.
    pub fn apply(self, cells: &mut [u8], torn: &mut BTreeSet<u32>) -> bool {
        match self {
            Self::Done(operation) => leave(operation, Damage::Complete, cells, torn),
            Self::Cut(operation, cut) => leave(operation, cut.damage, cells, torn),
        }
        matches!(self, Self::Cut(..))
    }
}
