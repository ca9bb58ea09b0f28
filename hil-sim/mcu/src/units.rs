//! All peripherals of the chip together.

use crate::crc::Crc;
use crate::debug::Debug;
use crate::dma::{Dma, Dmamux};
use crate::exti::Exti;
use crate::flash::Flash;
use crate::gpio::Port;
use crate::iwdg::Iwdg;
use crate::peripheral::Peripheral;
use crate::pwr::Pwr;
use crate::rcc::{Rcc, ResetCause};
use crate::rng::Rng;
use crate::spi::Spi;
use crate::syscfg::Syscfg;
use crate::timer::Timer;
use crate::uart::Uart;
use crate::unit::{SpiId, TimerId, UartId, Unit};

#[derive(Clone, Debug)]
pub(crate) struct Units {
    pub rcc: Rcc,
    pub pwr: Pwr,
    pub flash: Flash,
    pub syscfg: Syscfg,
    pub exti: Exti,
    pub iwdg: Iwdg,
    pub rng: Rng,
    pub crc: Crc,
    pub debug: Debug,
    pub dmamux: Dmamux,
    pub dma: [Dma; 2],
    pub ports: [Port; 7],
    pub timers: Vec<Timer>,
    pub uarts: Vec<Uart>,
    pub spis: Vec<Spi>,
}

impl Units {
    /// All peripherals as after power-on; `seed` decides the random numbers.
    pub fn new(seed: u64) -> Self {
        Self {
            rcc: Rcc::new(ResetCause::PowerOn, 0),
            pwr: Pwr::default(),
            flash: Flash::new(),
            syscfg: Syscfg::default(),
            exti: Exti::default(),
            iwdg: Iwdg::default(),
            rng: Rng::new(seed),
            crc: Crc::default(),
            debug: Debug::default(),
            dmamux: Dmamux::default(),
            dma: [Dma::new(0), Dma::new(1)],
            ports: std::array::from_fn(|port| Port::new(port as u8)),
            timers: TimerId::all().map(Timer::new).collect(),
            uarts: UartId::all().map(Uart::new).collect(),
            spis: SpiId::all().map(Spi::new).collect(),
        }
    }

    /// Resets every register; flash cells, noise and the peers of serial lines stay as they are.
    pub fn reset(&mut self, cause: ResetCause) {
        let rcc = Rcc::new(cause, self.rcc.reset_flags());
        self.flash.reset();
        self.rng.reset();
        self.uarts.iter_mut().for_each(Uart::reset);
        let fresh = Self::new(0);
        // A system reset leaves the debug registers alone (§47.6.3).
        let debug = if cause.is_of_power() { Debug::default() } else { self.debug.clone() };
        *self = Self {
            rcc,
            debug,
            flash: self.flash.clone(),
            rng: self.rng.clone(),
            uarts: std::mem::take(&mut self.uarts),
            ..fresh
        };
    }

    /// Resets one peripheral, as RCC's reset registers do.
    pub fn reset_one(&mut self, unit: Unit) {
        match unit {
            Unit::Pwr => self.pwr = Pwr::default(),
            Unit::Syscfg => self.syscfg = Syscfg::default(),
            Unit::Rng => self.rng.reset(),
            Unit::Crc => self.crc = Crc::default(),
            Unit::Dmamux => self.dmamux = Dmamux::default(),
            Unit::Dma(number) => self.dma[usize::from(number)] = Dma::new(number),
            Unit::Gpio(port) => self.ports[usize::from(port)] = Port::new(port),
            Unit::Timer(timer) => {
                let state = &mut self.timers[timer.index()];
                let watched = state.watched;
                *state = Timer::new(timer);
                state.watched = watched;
            }
            Unit::Uart(uart) => {
                let connected = self.uarts[uart.index()].connected;
                self.uarts[uart.index()].reset();
                self.uarts[uart.index()].connected = connected;
            }
            Unit::Spi(spi) => {
                let connected = self.spis[spi.index()].connected;
                self.spis[spi.index()] = Spi::new(spi);
                self.spis[spi.index()].connected = connected;
            }
            // Not in a reset register; or the flash interface, which firmware does not reset.
            Unit::Rcc | Unit::Flash | Unit::Exti | Unit::Iwdg | Unit::Debug => {}
        }
    }

    pub fn get(&mut self, unit: Unit) -> &mut dyn Peripheral {
        match unit {
            Unit::Rcc => &mut self.rcc,
            Unit::Pwr => &mut self.pwr,
            Unit::Flash => &mut self.flash,
            Unit::Syscfg => &mut self.syscfg,
            Unit::Exti => &mut self.exti,
            Unit::Iwdg => &mut self.iwdg,
            Unit::Rng => &mut self.rng,
            Unit::Crc => &mut self.crc,
            Unit::Debug => &mut self.debug,
            Unit::Dmamux => &mut self.dmamux,
            Unit::Dma(number) => &mut self.dma[usize::from(number)],
            Unit::Gpio(port) => &mut self.ports[usize::from(port)],
            Unit::Timer(timer) => &mut self.timers[timer.index()],
            Unit::Uart(uart) => &mut self.uarts[uart.index()],
            Unit::Spi(spi) => &mut self.spis[spi.index()],
        }
    }
}
