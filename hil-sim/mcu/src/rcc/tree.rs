//! The frequencies that the registers choose, and those that the PLL cannot have.

use super::source::Source;
use super::{CCIPR, CFGR, PLLCFGR, Rcc};
use crate::clocks::{ClockTree, HSE_HZ, HSI16_HZ, HSI48_HZ, LSE_HZ};
use crate::peripheral::{Refused, Reply};
use crate::unit::UartId;

impl Rcc {
    /// The present frequencies.
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
        ClockTree { sysclk, hclk, pclk, timer_divider, uart, clk48, from_pll: self.system_clock == 3 }
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

    /// Ranges of the PLL's frequencies (DS12288 table 46).
    pub(super) fn check_pll(&self, cr: u32) -> Reply<()> {
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
}

/// How far a divider field shifts: values with their `enabling` bit set divide by the listed power of two.
fn shift_of(field: u32, enabling: u32, shifts: &[u32]) -> u32 {
    if field & enabling == 0 { 0 } else { shifts.get((field & (enabling - 1)) as usize).copied().unwrap_or(0) }
}
