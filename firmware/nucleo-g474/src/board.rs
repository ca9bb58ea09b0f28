//! Pins and timers of the NUCLEO-G474RE. The stages are wired in a file of [`crate::wiring`], which a feature of the package
//! chooses: for another wiring change that file and the table in docs/firmware.md.
//!
//! The compiler checks that a pin can do its job: `TimerPin<TIM8, Ch1>` and similar traits are implemented from the chip's
//! alternate-function data, and each pin can be given away only once.

use embassy_stm32::gpio::{Input, Level, Output, Pull, Speed};
use embassy_stm32::mode::Async;
use embassy_stm32::usart::{self, Uart, UartTx};
use embassy_stm32::{Peri, Peripherals, bind_interrupts, dma, pac, peripherals, rcc};

use crate::absolute::AbsoluteEncoders;
use crate::drivers::DriverWire;
use crate::encoder::Encoder;
use crate::index_lines::IndexLines;
use crate::joints::{BusPort, Joints};
use crate::receiver::{Bell, Receiver};
use crate::rig::{Latched, Rig, Stage};
use crate::steps::StepPulses;
use crate::trigger::Trigger;
use crate::wiring;

/// Name of the kind of board.
pub const NAME: &str = "nucleo-g474";

bind_interrupts!(struct Interrupts {
    LPUART1 => Bell, usart::InterruptHandler<peripherals::LPUART1>;
    DMA1_CHANNEL1 => dma::InterruptHandler<peripherals::DMA1_CH1>;
    DMA1_CHANNEL2 => dma::InterruptHandler<peripherals::DMA1_CH2>;
});

/// The parts of the board, ready to be used.
pub struct Board {
    /// Motors, encoders, switches and trigger.
    pub rig: Rig,
    /// Timer of the control tick.
    pub tick: Peri<'static, peripherals::TIM7>,
    /// Watchdog, not started yet.
    pub watchdog: Peri<'static, peripherals::IWDG>,
    /// The green LED LD2.
    pub led: Output<'static>,
    /// Serial line, not opened yet.
    pub line: SerialLine,
    /// Serial line of the motor drivers.
    pub driver_line: DriverWire,
    /// Bus of a robot's servos, not started yet.
    pub servo_bus: BusPort,
    /// Random number generator.
    pub random: Peri<'static, peripherals::RNG>,
    /// Flash controller.
    pub flash: Peri<'static, peripherals::FLASH>,
}

/// The serial line through the ST-LINK's virtual COM port.
pub struct SerialLine {
    port: Peri<'static, peripherals::LPUART1>,
    tx: Peri<'static, peripherals::PA2>,
    rx: Peri<'static, peripherals::PA3>,
    tx_dma: Peri<'static, peripherals::DMA1_CH2>,
    rx_dma: Peri<'static, peripherals::DMA1_CH1>,
}

impl Board {
    /// Sets up every pin. The drivers are off.
    pub fn new(p: Peripherals) -> Self {
        // First, so that nothing can move: high switches the drivers off.
        let drivers_off = Output::new(p.PA10, Level::High, Speed::Low);
        let stages = wiring::stages!(p);
        let counters = stages.each_ref().map(|stage| stage.encoder.counter());
        let rig = Rig {
            stages,
            index_lines: IndexLines::new(p.PB11, p.PB12, counters),
            absolute: AbsoluteEncoders::new(p.SPI1, p.PB3, p.PA6, p.PA7, [p.PB0.into(), p.PA4.into()]),
            emergency_stop: Input::new(p.PC4, Pull::Up),
            drivers_off,
            holding: Output::new(p.PB5, Level::Low, Speed::Low),
            trigger: Trigger::new(p.TIM4, p.PB6, counters),
            latched: None,
            joints: Joints::default(),
            before: Latched::default(),
            latest: Latched::default(),
        };
        Self {
            rig,
            tick: p.TIM7,
            watchdog: p.IWDG,
            led: Output::new(p.PA5, Level::High, Speed::Low),
            line: SerialLine { port: p.LPUART1, tx: p.PA2, rx: p.PA3, tx_dma: p.DMA1_CH2, rx_dma: p.DMA1_CH1 },
            driver_line: DriverWire::new(p.UART4, p.PC10),
            servo_bus: BusPort::new(p.USART3, p.PB10, p.PB14, p.DMA1_CH6, p.DMA1_CH7),
            random: p.RNG,
            flash: p.FLASH,
        }
    }
}

impl SerialLine {
    /// Opens the line at `baud`; `None` where the port cannot make that speed.
    pub fn open(self, baud: u32) -> Option<(Receiver, UartTx<'static, Async>)> {
        let mut config = usart::Config::default();
        config.baudrate = baud;
        let Self { port, tx, rx, tx_dma, rx_dma } = self;
        let uart = Uart::new(port, rx, tx, tx_dma, rx_dma, Interrupts, config).ok()?;
        let (tx, rx) = uart.split();
        Some((Receiver::start(rx), tx))
    }
}

/// One random number, which takes some microseconds; `None` if the generator does not work.
pub fn random(_generator: Peri<'static, peripherals::RNG>) -> Option<u32> {
    const PATIENCE: u32 = 10_000;
    rcc::enable_and_reset::<peripherals::RNG>();
    pac::RNG.cr().write(|w| w.set_rngen(true));
    (0..PATIENCE).find_map(|_| pac::RNG.sr().read().drdy().then(|| pac::RNG.dr().read()))
}

/// Switches the drivers off when the program dies: sets the pin of [`Rig::drivers_off`] without its owner.
pub fn cut_drivers() {
    pac::GPIOA.bsrr().write(|w| w.set_bs(10, true));
}
