//! RCC: oscillators, clock tree, clock enables, reset flags (RM0440 §7).

use vergence_cpu::{Cycle, Lines};

use crate::clocks::{ClockTree, Clocks, HSE_HZ, HSI16_HZ, HSI48_HZ, LSE_HZ};
use crate::peripheral::{Moment, Peripheral, Refused, Registers, Reply, only};
use crate::time::Picoseconds;
use crate::unit::{UartId, Unit};

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

/// Clock sources; each is ready after the longest start-up time of the datasheet (DS12288, clock source characteristics).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Source {
    Hsi16,
    Hse,
    Pll,
    Lse,
    Lsi,
    Hsi48,
}

const SOURCES: [Source; 6] = [Source::Hsi16, Source::Hse, Source::Pll, Source::Lse, Source::Lsi, Source::Hsi48];

impl Source {
    fn start_up(self) -> Picoseconds {
        match self {
            Self::Hsi16 => Picoseconds::nanoseconds(1_200),
            Self::Hse => Picoseconds::milliseconds(2),
            Self::Pll => Picoseconds::microseconds(40),
            Self::Lse => Picoseconds::milliseconds(2_000),
            Self::Lsi => Picoseconds::microseconds(130),
            Self::Hsi48 => Picoseconds::microseconds(6),
        }
    }

    /// The register that switches it on, the bit that does, and its bit in CIER and CIFR.
    fn bits(self) -> (u32, u32, u32) {
        match self {
            Self::Hsi16 => (CR, 8, 3),
            Self::Hse => (CR, 16, 4),
            Self::Pll => (CR, 24, 5),
            Self::Lse => (BDCR, 0, 1),
            Self::Lsi => (CSR, 0, 0),
            Self::Hsi48 => (CRRCR, 0, 10),
        }
    }

    /// HSIRDY is two bits above HSION, the others follow their switch at once.
    fn ready_bit(self) -> u32 {
        let (_, on, _) = self.bits();
        if self == Self::Hsi16 { on + 2 } else { on + 1 }
    }
}

/// Why the chip starts, as RCC_CSR tells it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ResetCause {
    /// The supply came.
    PowerOn,
    /// The reset button.
    Pin,
    /// Firmware asked for it through SYSRESETREQ.
    Software,
    /// The independent watchdog was not fed in time.
    Watchdog,
    /// Firmware reloaded the option bytes.
    OptionBytes,
}

impl ResetCause {
    /// Flags of RCC_CSR. The chip pulls its own reset pin low on every reset, so PINRSTF always comes along (§7.1.2).
    fn flags(self) -> u32 {
        const PIN: u32 = 1 << 26;
        PIN | match self {
            Self::PowerOn => 1 << 27,
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
    /// Peripherals that a write to a reset register has just put back.
    pub resets: Vec<Unit>,
}

impl Rcc {
    pub fn new(cause: ResetCause, flags_before: u32) -> Self {
        let mut plain = [0; 0x28];
        for &(offset, value) in RESET_VALUES {
            plain[offset as usize / 4] = value;
        }
        plain[CR as usize / 4] = 1 << 8;
        plain[CSR as usize / 4] = if cause == ResetCause::PowerOn { 0 } else { flags_before } | cause.flags();
        let mut ready = [false; SOURCES.len()];
        ready[Source::Hsi16 as usize] = true;
        Self { plain, ready_at: [None; SOURCES.len()], ready, system_clock: 1, flags: 0, resets: Vec::new() }
    }

    /// The flags of RCC_CSR, which outlive a reset.
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

    /// The frequencies at present.
    pub fn tree(&self) -> ClockTree {
        let sysclk = match self.system_clock {
            1 => HSI16_HZ,
            2 => HSE_HZ,
            _ => self.pll(self.get(PLLCFGR) >> 25 & 3),
        };
        let cfgr = self.get(CFGR);
        let hclk = sysclk >> shift_of(cfgr >> 4 & 0xF, 8, &[1, 2, 3, 4, 6, 7, 8, 9]);
        let bus_shift = [8, 11].map(|low| shift_of(cfgr >> low & 7, 4, &[1, 2, 3, 4]));
        let pclk = bus_shift.map(|shift| hclk >> shift);
        // Timers run twice as fast as a divided bus (§7.2.15).
        let timer_divider = bus_shift.map(|shift| if shift == 0 { 1 } else { 1 << (shift - 1) });
        let mut uart = [0; UartId::COUNT];
        for (index, hz) in uart.iter_mut().enumerate() {
            let bus = if index == UartId::USART1.index() { pclk[1] } else { pclk[0] };
            *hz = match self.get(CCIPR) >> (2 * index) & 3 {
                0 => bus,
                1 => sysclk,
                2 => self.when_ready(Source::Hsi16, HSI16_HZ),
                _ => self.when_ready(Source::Lse, LSE_HZ),
            };
        }
        let clk48 = match self.get(CCIPR) >> 26 & 3 {
            0 => self.when_ready(Source::Hsi48, HSI48_HZ),
            2 if self.get(PLLCFGR) >> 20 & 1 == 1 => self.pll(self.get(PLLCFGR) >> 21 & 3),
            _ => 0,
        };
        ClockTree { sysclk, hclk, pclk, timer_divider, uart, clk48 }
    }

    fn when_ready(&self, source: Source, hz: u32) -> u32 {
        if self.ready[source as usize] { hz } else { 0 }
    }

    /// An output of the PLL (§7.4.4): source / M × N / (2, 4, 6, 8).
    fn pll(&self, divider: u32) -> u32 {
        let (input, multiplier) = self.pll_input();
        if self.ready[Source::Pll as usize] {
            (u64::from(input) * u64::from(multiplier) / u64::from(2 * (divider + 1))) as u32
        } else {
            0
        }
    }

    fn pll_input(&self) -> (u32, u32) {
        let config = self.get(PLLCFGR);
        let source = match config & 3 {
            2 => HSI16_HZ,
            3 => HSE_HZ,
            _ => 0,
        };
        (source / ((config >> 4 & 0xF) + 1), config >> 8 & 0x7F)
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

    /// Ranges of the PLL's frequencies (DS12288 table 46).
    fn check_pll(&self, cr: u32) -> Reply<()> {
        let source_on = match self.get(PLLCFGR) & 3 {
            2 => self.ready[Source::Hsi16 as usize],
            3 => cr >> 16 & 1 == 1 && self.ready[Source::Hse as usize],
            _ => false,
        };
        if !source_on {
            return Err("the PLL is switched on before its source runs".into());
        }
        let (input, multiplier) = self.pll_input();
        let vco = u64::from(input) * u64::from(multiplier);
        if !(2_660_000..=16_000_000).contains(&input) {
            return Err(Refused(format!("the PLL's input of {input} Hz is outside 2.66..16 MHz")));
        }
        if !(96_000_000..=344_000_000).contains(&vco) {
            return Err(Refused(format!("the PLL's oscillator at {vco} Hz is outside 96..344 MHz")));
        }
        Ok(())
    }

    fn write_cfgr(&mut self, value: u32) -> Reply<()> {
        only(value, 0x0000_3FFF)?;
        self.put(CFGR, value & 0x3FF3);
        self.follow_switch();
        Ok(())
    }

    /// The system clock moves to the chosen source as soon as that is ready.
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

/// How far a divider field shifts: values with their `enabling` bit set divide by the listed power of two.
fn shift_of(field: u32, enabling: u32, shifts: &[u32]) -> u32 {
    if field & enabling == 0 { 0 } else { shifts.get((field & (enabling - 1)) as usize).copied().unwrap_or(0) }
}
