//! Pins between the inside and the outside of the chip: what drives them, and what they are connected to.

use crate::alternate::alternate_function;
use crate::gpio::Mode;
use crate::pin::{Drive, PINS, Pin, PinSet, Signal};
use crate::unit::{SpiId, TimerId, UartId};
use crate::units::Units;

/// All pins.
#[derive(Clone, Debug)]
pub(crate) struct Pads {
    pub drives: [Drive; PINS],
    levels: PinSet,
    signals: [Option<Signal>; PINS],
    /// Pins of each timer's outputs: CH1 to CH4, CH1N to CH4N.
    timer_pins: [[PinSet; 8]; TimerId::COUNT],
    /// Pins of each serial port's driver enable.
    enable_pins: [PinSet; UartId::COUNT],
    /// Pins whose levels are observed from outside.
    pub watched: PinSet,
}

impl Pads {
    pub fn new() -> Self {
        Self {
            drives: [Drive::Floating; PINS],
            levels: 0,
            signals: [None; PINS],
            timer_pins: [[0; 8]; TimerId::COUNT],
            enable_pins: [0; UartId::COUNT],
            watched: 0,
        }
    }

    pub fn is_high(&self, pin: Pin) -> bool {
        self.levels & pin.set() != 0
    }

    pub fn levels_of_port(&self, port: usize) -> u16 {
        (self.levels >> (16 * port)) as u16
    }

    pub fn set_level(&mut self, pin: Pin, high: bool) {
        if high {
            self.levels |= pin.set();
        } else {
            self.levels &= !pin.set();
        }
    }

    pub fn signal(&self, pin: Pin) -> Option<Signal> {
        self.signals[pin.index()]
    }

    /// Pins that a timer's outputs reach.
    pub fn pins_of_timer(&self, timer: TimerId) -> PinSet {
        self.timer_pins[timer.index()].iter().fold(0, |all, pins| all | pins)
    }

    pub fn pins_of_enable(&self, uart: UartId) -> PinSet {
        self.enable_pins[uart.index()]
    }

    /// Mask of the outputs of a timer that are observed, bit x for CHx+1 and its complement.
    pub fn watched_outputs(&self, timer: TimerId) -> u8 {
        let pins = &self.timer_pins[timer.index()];
        (0..4).fold(0, |all, channel| {
            let seen = (pins[channel] | pins[channel + 4]) & self.watched != 0;
            all | u8::from(seen) << channel
        })
    }

    /// A serial port's pins: whether transmitter and receiver have one. On one wire the transmitter's serves both.
    pub fn connected(&self, uart: UartId) -> [bool; 2] {
        let has = |wanted: Signal| self.signals.contains(&Some(wanted));
        let sends = has(Signal::Transmit(uart));
        [sends, sends || has(Signal::Receive(uart))]
    }

    /// Whether an SPI has pins for its clock, its input and its output.
    pub fn connected_spi(&self, spi: SpiId) -> [bool; 3] {
        [Signal::SpiClock(spi), Signal::SpiIn(spi), Signal::SpiOut(spi)]
            .map(|wanted| self.signals.contains(&Some(wanted)))
    }

    /// The level of the input of an SPI, where no device drives it.
    pub fn input_of_spi(&self, spi: SpiId) -> bool {
        let pin = self.signals.iter().position(|signal| *signal == Some(Signal::SpiIn(spi)));
        pin.is_some_and(|index| self.is_high(Pin::at(index)))
    }

    /// Connects the pins of a port anew after its registers changed; returns whether any connection changed.
    pub fn connect(&mut self, units: &Units, port: usize) -> bool {
        let mut changed = false;
        for number in 0..16 {
            let pin = Pin::at(port * 16 + number);
            let signal = match units.ports[port].mode(number) {
                Mode::Alternate(function) => alternate_function(pin, function),
                _ => None,
            };
            if self.signals[pin.index()] != signal {
                self.signals[pin.index()] = signal;
                changed = true;
            }
        }
        if changed {
            self.index_outputs();
        }
        changed
    }

    fn index_outputs(&mut self) {
        self.timer_pins = [[0; 8]; TimerId::COUNT];
        self.enable_pins = [0; UartId::COUNT];
        for (index, signal) in self.signals.iter().enumerate() {
            let pin = Pin::at(index).set();
            match *signal {
                Some(Signal::Channel(timer, channel)) => self.timer_pins[timer.index()][usize::from(channel)] |= pin,
                Some(Signal::Complement(timer, channel)) => {
                    self.timer_pins[timer.index()][usize::from(channel) + 4] |= pin;
                }
                Some(Signal::DriverEnable(uart)) => self.enable_pins[uart.index()] |= pin,
                _ => {}
            }
        }
    }

    /// The resulting level of a pin. An output of the chip wins over a driver outside.
    pub fn resolve(&self, units: &Units, pin: Pin) -> bool {
        let port = &units.ports[pin.port()];
        let number = pin.number();
        let outside = || match self.drives[pin.index()] {
            Drive::Floating => port.pulled(number),
            Drive::Low => false,
            Drive::High => true,
        };
        let inside = match port.mode(number) {
            Mode::Output => Some(port.output(number)),
            Mode::Alternate(_) => self.signals[pin.index()].and_then(|signal| level_of(units, signal)),
            Mode::Input | Mode::Analog => None,
        };
        match inside {
            Some(true) if port.is_open_drain(number) => outside(),
            Some(level) => level,
            None => outside(),
        }
    }
}

/// The level that a peripheral drives; `None` where it does not.
fn level_of(units: &Units, signal: Signal) -> Option<bool> {
    match signal {
        Signal::Channel(timer, channel) => units.timers[timer.index()].output(usize::from(channel)),
        Signal::Complement(timer, channel) => units.timers[timer.index()].complement(usize::from(channel)),
        // Serial lines carry whole frames; the pin shows the idle level.
        Signal::Transmit(_) => Some(true),
        Signal::DriverEnable(uart) => units.uarts[uart.index()].driver_enable(),
        Signal::SpiClock(spi) => units.spis[spi.index()].idle_clock(),
        Signal::SpiOut(spi) => units.spis[spi.index()].idle_output(),
        Signal::External(_) | Signal::Receive(_) | Signal::SpiIn(_) => None,
    }
}
