//! Clocks of the chip: the core runs at 170 MHz, which needs the supply's boost mode.

use embassy_stm32::pac::flash::vals::Latency;
use embassy_stm32::pac::{FLASH, PWR, RCC, pwr, rcc::vals::Sw};
use embassy_stm32::rcc::{self, AHBPrescaler, Pll, PllMul, PllPreDiv, PllRDiv, PllSource, Sysclk};
use embassy_stm32::{Config, Peri, Peripherals, peripherals, time::Hertz};

/// Core cycles of more than a microsecond at 85 MHz and at 170 MHz.
const TRANSITION_CYCLES: u32 = 200;

/// Oscillator that the clocks are derived from.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Source {
    /// The board's crystal of 24 MHz.
    Crystal,
    /// The oscillator inside the chip: accurate to one percent, and always there.
    Inside,
}

/// Starts the chip and brings its core to 170 MHz.
///
/// The chip starts at 16 MHz: the driver's own start sets the supply to its normal mode, which is good for 150 MHz, and
/// tests the boost bit at the wrong place (bit 0 of `PWR_CR5` in stm32-metapac 21; it is bit 8, RM0440, 6.4.22).
///
/// The driver keeps to the state in between that a step to more than 80 MHz needs (RM0440, 7.2.7), and goes on believing in
/// it: AHB and timers at 85 MHz. The link and the servo bus are clocked by the undivided system clock, which it knows. A program with
/// its driver of time doubles the prescaler of that timer.
pub fn start(source: Source) -> Peripherals {
    let mut p = embassy_stm32::init(Config::default());
    PWR.cr5().write_value(pwr::regs::Cr5(0));
    speed_up(&mut p.RCC, source);
    p
}

fn speed_up(clocks: &mut Peri<'static, peripherals::RCC>, source: Source) {
    let mut config = Config::default().rcc;
    let (source, prediv) = match source {
        Source::Crystal => {
            config.hse = Some(rcc::Hse { freq: Hertz(24_000_000), mode: rcc::HseMode::Oscillator });
            (PllSource::HSE, PllPreDiv::DIV6)
        }
        Source::Inside => (PllSource::HSI, PllPreDiv::DIV4),
    };
    config.pll = Some(Pll { source, prediv, mul: PllMul::MUL85, divp: None, divq: None, divr: Some(PllRDiv::DIV2) });
    config.sys = Sysclk::PLL1_R;
    config.boost = true;
    // For random numbers.
    config.hsi48 = Some(rcc::Hsi48Config::new());
    config.mux.clk48sel = rcc::mux::Clk48sel::HSI48;
    // embassy-stm32 0.6 takes this prescaler back in the same write that switches to the PLL.
    config.ahb_pre = AHBPrescaler::DIV2;
    config.mux.lpuart1sel = rcc::mux::Uartsel::SYS;
    config.mux.usart3sel = rcc::mux::Uartsel::SYS;
    rcc::reinit(config, clocks);
    cortex_m::asm::delay(TRANSITION_CYCLES);
    FLASH.acr().modify(|w| w.set_latency(Latency::WS4));
    while FLASH.acr().read().latency() != Latency::WS4 {}
    RCC.cfgr().modify(|w| w.set_hpre(AHBPrescaler::DIV1));
}

/// Returns to the 16 MHz of a reset, for the next program, which starts the chip anew. The way down has the same state in
/// between as the way up (RM0440, 7.2.7).
pub fn slow_down() {
    RCC.cfgr().modify(|w| w.set_hpre(AHBPrescaler::DIV2));
    cortex_m::asm::delay(TRANSITION_CYCLES);
    RCC.cr().modify(|w| w.set_hsion(true));
    while !RCC.cr().read().hsirdy() {}
    RCC.cfgr().modify(|w| w.set_sw(Sw::HSI));
    while RCC.cfgr().read().sws() != Sw::HSI {}
    RCC.cfgr().modify(|w| w.set_hpre(AHBPrescaler::DIV1));
}
