//! RCC: oscillators, clock tree, clock enables, reset flags (RM0440 §7).

mod source;
mod tree;

use vergence_cpu::{Cycle, Lines};

use crate::clocks::Clocks;
use crate::peripheral::{Moment, Peripheral, Registers, Reply, only};
use crate::time::Picoseconds;
use crate::unit::Unit;
use source::{SOURCES, Source};

const CR: u32 = 0x00;
const ICSCR: u32 = 0x04;
const CFGR: u32 = 0x08;
const PLLCFGR: u32 = 0x0C;
const CIER: u32 = 0x18;
const CIFR: u32 = 0x1C;
const CICR: u32 = 0x20;
const CCIPR: u32 = 0x88;
const BDCR: u32 = 0x90;
const CSR: u32 = 0x94;
const CRRCR: u32 = 0x98;

const REGISTERS: Registers = &[
    (CR, "CR"),
    (ICSCR, "ICSCR"),
    (CFGR, "CFGR"),
    (PLLCFGR, "PLLCFGR"),
    (CIER, "CIER"),
    (CIFR, "CIFR"),
    (CICR, "CICR"),
    (0x28, "AHB1RSTR"),
    (0x2C, "AHB2RSTR"),
    (0x30, "AHB3RSTR"),
    (0x38, "APB1RSTR1"),
    (0x3C, "APB1RSTR2"),
    (0x40, "APB2RSTR"),
    (0x48, "AHB1ENR"),
    (0x4C, "AHB2ENR"),
    (0x50, "AHB3ENR"),
    (0x58, "APB1ENR1"),
    (0x5C, "APB1ENR2"),
    (0x60, "APB2ENR"),
    (0x68, "AHB1SMENR"),
    (0x6C, "AHB2SMENR"),
    (0x70, "AHB3SMENR"),
    (0x78, "APB1SMENR1"),
    (0x7C, "APB1SMENR2"),
    (0x80, "APB2SMENR"),
    (CCIPR, "CCIPR"),
    (BDCR, "BDCR"),
    (CSR, "CSR"),
    (CRRCR, "CRRCR"),
    (0x9C, "CCIPR2"),
];

/// Reset values other than zero (RM0440 §7.4).
const RESET_VALUES: &[(u32, u32)] = &[
    (ICSCR, 0x4000_0000),
    (CFGR, 0x0000_0005),
    (PLLCFGR, 0x0000_1000),
    (0x48, 0x0000_0100),
    (0x68, 0x0000_130F),
    (0x6C, 0x050F_667F),
    (0x70, 0x0000_0101),
    (0x78, 0xD2FE_CD3F),
    (0x7C, 0x0000_0103),
    (0x80, 0x0437_F801),
];

/// Why the chip starts, as RCC_CSR shows it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ResetCause {
    /// Power-on.
    PowerOn,
    /// The supply fell below the brown-out threshold. RCC_CSR shows it like power-on (§7.4.28).
    BrownOut,
    /// The reset button.
    Pin,
    /// The firmware asked for a reset through SYSRESETREQ.
    Software,
    /// The independent watchdog was not fed in time.
    Watchdog,
    /// Firmware reloaded the option bytes.
    OptionBytes,
}

impl ResetCause {
    /// Whether registers and RAM lost their power.
    pub(crate) const fn is_of_power(self) -> bool {
        matches!(self, Self::PowerOn | Self::BrownOut)
    }

    /// Flags of RCC_CSR. The chip pulls its own reset pin low on every reset, so PINRSTF is always set too (§7.1.2).
    fn flags(self) -> u32 {
        const PIN: u32 = 1 << 26;
        PIN | match self {
            Self::PowerOn | Self::BrownOut => 1 << 27,
            Self::Pin => 0,
            Self::Software => 1 << 28,
            Self::Watchdog => 1 << 29,
            Self::OptionBytes => 1 << 25,
        }
    }
}

/// The reset and clock controller.
#[derive(Clone, Debug)]
pub(crate) struct Rcc {
    plain: [u32; 0x28],
    ready_at: [Option<Picoseconds>; SOURCES.len()],
    ready: [bool; SOURCES.len()],
    /// CFGR.SWS.
    system_clock: u32,
    flags: u32,
    /// Peripherals that a write to a reset register has just reset.
    pub resets: Vec<Unit>,
}

impl Rcc {
    pub fn new(cause: ResetCause, flags_before: u32) -> Self {
        let mut plain = [0; 0x28];
        for &(offset, value) in RESET_VALUES {
            plain[offset as usize / 4] = value;
        }
        plain[CR as usize / 4] = 1 << 8;
        plain[CSR as usize / 4] = if cause.is_of_power() { 0 } else { flags_before } | cause.flags();
        let mut ready = [false; SOURCES.len()];
        ready[Source::Hsi16 as usize] = true;
        Self { plain, ready_at: [None; SOURCES.len()], ready, system_clock: 1, flags: 0, resets: Vec::new() }
    }

    /// The flags of RCC_CSR, which persist through a reset.
    pub fn reset_flags(&self) -> u32 {
        self.get(CSR) & 0xFF80_0000
    }

    pub fn is_clocked(&self, unit: Unit) -> bool {
        unit.clock_enable().is_none_or(|(offset, bit)| self.get(offset) >> bit & 1 == 1)
    }

    /// The watchdog switches the slow oscillator on by itself.
    pub fn start_lsi(&mut self, moment: Moment) {
        self.put(CSR, self.get(CSR) | 1);
        self.switch(moment);
    }

    fn get(&self, offset: u32) -> u32 {
        self.plain.get(offset as usize / 4).copied().unwrap_or(0)
    }

    fn put(&mut self, offset: u32, value: u32) {
        if let Some(register) = self.plain.get_mut(offset as usize / 4) {
            *register = value;
        }
    }

    /// Starts and stops oscillators after a write to a register with their switches.
    fn switch(&mut self, moment: Moment) {
        for source in SOURCES {
            let (register, bit, _) = source.bits();
            let on = self.get(register) >> bit & 1 == 1;
            let index = source as usize;
            if !on {
                self.ready[index] = false;
                self.ready_at[index] = None;
            } else if !self.ready[index] && self.ready_at[index].is_none() {
                self.ready_at[index] = Some(moment.time() + source.start_up());
            }
        }
    }

    fn write_cr(&mut self, moment: Moment, value: u32) -> Reply<()> {
        only(value, 0x0307_0700)?;
        let starts_pll = value & !self.get(CR) & 1 << 24 != 0;
        if starts_pll {
            self.check_pll(value)?;
        }
        // A clock in use cannot be switched off (§7.4.1).
        let kept = [0, 1 << 8, 1 << 16, 1 << 24][self.system_clock as usize & 3];
        self.put(CR, value & 0x0105_0300 | kept);
        self.switch(moment);
        Ok(())
    }

    fn write_cfgr(&mut self, value: u32) -> Reply<()> {
        only(value, 0x0000_3FFF)?;
        self.put(CFGR, value & 0x3FF3);
        self.follow_switch();
        Ok(())
    }

    /// Switches the system clock to the chosen source as soon as that is ready.
    fn follow_switch(&mut self) {
        let wanted = self.get(CFGR) & 3;
        let ready = match wanted {
            1 => self.ready[Source::Hsi16 as usize],
            2 => self.ready[Source::Hse as usize],
            3 => self.ready[Source::Pll as usize] && self.get(PLLCFGR) >> 24 & 1 == 1,
            _ => false,
        };
        if ready {
            self.system_clock = wanted;
        }
    }

    fn note_resets(&mut self, offset: u32, value: u32) {
        let enables = offset + 0x20;
        let put_back = (0..crate::unit::UNITS).map(Unit::at).filter(|unit| {
            unit.clock_enable().is_some_and(|(register, bit)| register == enables && value >> bit & 1 == 1)
        });
        self.resets.extend(put_back);
    }
}

impl Peripheral for Rcc {
    fn registers(&self) -> Registers {
        REGISTERS
    }

    fn reads_quietly(&self, _offset: u32) -> bool {
        true
    }

    fn read(&mut self, _moment: Moment, offset: u32) -> Reply<u32> {
        let mut value = match offset {
            CFGR => self.get(CFGR) & !0xC | self.system_clock << 2,
            CIFR => self.flags,
            CICR => 0,
            offset => self.get(offset),
        };
        for source in SOURCES {
            if source.bits().0 == offset {
                value |= u32::from(self.ready[source as usize]) << source.ready_bit();
            }
        }
        Ok(value)
    }

    fn write(&mut self, moment: Moment, offset: u32, value: u32) -> Reply<()> {
        match offset {
            CR => self.write_cr(moment, value)?,
            CFGR => self.write_cfgr(value)?,
            PLLCFGR if self.ready[Source::Pll as usize] && (value ^ self.get(PLLCFGR)) & 0x7FF3 != 0 => {
                return Err("the PLL is changed while it runs".into());
            }
            CIFR => {}
            CICR => self.flags &= !value,
            0x28..=0x40 => {
                self.put(offset, value);
                self.note_resets(offset, value);
            }
            BDCR => {
                only(value, 0x0001_831F)?;
                self.put(BDCR, value & !2);
                self.switch(moment);
            }
            CSR => {
                let flags = if value >> 23 & 1 == 1 { 0 } else { self.reset_flags() };
                self.put(CSR, flags | value & 1);
                self.switch(moment);
            }
            CRRCR => {
                self.put(CRRCR, value & 1);
                self.switch(moment);
            }
            _ => self.put(offset, value),
        }
        self.follow_switch();
        Ok(())
    }

    fn advance(&mut self, moment: Moment) {
        for source in SOURCES {
            let index = source as usize;
            if self.ready_at[index].is_some_and(|at| moment.clocks.base.cycle_at(at) <= moment.now) {
                self.ready_at[index] = None;
                self.ready[index] = true;
                self.flags |= self.get(CIER) & 1 << source.bits().2;
            }
        }
        self.follow_switch();
    }

    fn due(&self, clocks: &Clocks) -> Cycle {
        let next = self.ready_at.iter().flatten().min();
        clocks.base.cycle_at(next.copied().unwrap_or(Picoseconds::NEVER))
    }

    fn lines(&self) -> Lines {
        if self.flags & self.get(CIER) != 0 { 1 << 5 } else { 0 }
    }
}
