//! Connections between peripherals: pins to interrupts and timers, timers to timers, bytes to the world.

use crate::chip::Chip;
use crate::flash::{Change, FlashOperation};
use crate::gpio::Mode;
use crate::peripheral::Moment;
use crate::pin::{Drive, Pin, PinSet, Signal};
use crate::trouble::Demand;
use crate::uart::SentByte;
use crate::unit::{SpiId, TimerId, UartId, Unit};
use crate::world::{PinEdge, World};

impl<W: World> Chip<W> {
    /// Applies the effects of a peripheral on others after it was advanced or written, and determines its state anew.
    pub(crate) fn react(&mut self, unit: Unit) {
        match unit {
            Unit::Rcc => {
                for reset in std::mem::take(&mut self.units.rcc.resets) {
                    self.units.reset_one(reset);
                    let tree = self.clocks.tree;
                    let moment = Moment { now: self.now, clocks: &self.clocks };
                    if let Unit::Timer(timer) = reset {
                        self.units.timers[timer.index()].set_divider(moment, &tree);
                    }
                    self.react(reset);
                }
                self.find_clocked();
                self.reclock();
            }
            Unit::Pwr => self.reclock(),
            Unit::Flash => self.react_to_flash(),
            Unit::Iwdg => self.react_to_watchdog(),
            Unit::Gpio(port) => self.react_to_port(usize::from(port)),
            Unit::Timer(timer) => {
                self.stirred = true;
                self.react_to_timer(timer);
            }
            Unit::Uart(uart) => {
                self.stirred = true;
                self.react_to_uart(uart);
            }
            Unit::Spi(spi) => self.react_to_spi(spi),
            Unit::Dma(_) | Unit::Dmamux => self.stirred = true,
            _ => {}
        }
        self.refresh(unit);
    }

    fn react_to_flash(&mut self) {
        for change in std::mem::take(&mut self.units.flash.changes) {
            let lost = change.apply(&mut self.memory.flash, &mut self.units.flash.torn);
            self.code_version += 1;
            if let (Change::Done(FlashOperation::ErasePage(offset)), Some(pages)) = (change, &mut self.pages) {
                pages.erase(offset as usize);
            }
            if lost {
                self.ask(Demand::PowerLost);
            } else if self.units.flash.announces {
                self.ask(Demand::FlashBegins);
            }
        }
        if std::mem::take(&mut self.units.flash.reload_options) {
            self.ask(Demand::OptionBytes);
        }
    }

    fn react_to_watchdog(&mut self) {
        if std::mem::take(&mut self.units.iwdg.starts) {
            let moment = Moment { now: self.now, clocks: &self.clocks };
            self.units.rcc.start_lsi(moment);
            self.refresh(Unit::Rcc);
        }
        if std::mem::take(&mut self.units.iwdg.bites) {
            self.ask(Demand::Watchdog);
        }
    }

    fn react_to_port(&mut self, port: usize) {
        if !std::mem::take(&mut self.units.ports[port].changed) {
            return;
        }
        if self.pads.connect(&self.units, port) {
            for uart in UartId::all() {
                self.units.uarts[uart.index()].connected = self.pads.connected(uart);
            }
            for spi in SpiId::all() {
                self.units.spis[spi.index()].connected = self.pads.connected_spi(spi);
            }
            self.watch_timers();
        }
        for number in 0..16 {
            let pin = Pin::at(port * 16 + number);
            self.settle_pin(pin);
            // A pin newly connected to an input passes on its level.
            self.set_input(pin, self.pads.is_high(pin));
        }
        // A port that was reset has lost the levels that did not change.
        self.units.ports[port].levels = self.pads.levels_of_port(port);
    }

    fn react_to_timer(&mut self, timer: TimerId) {
        let index = timer.index();
        if std::mem::take(&mut self.units.timers[index].outputs_changed) {
            self.settle_pins(self.pads.pins_of_timer(timer));
        }
        for _ in 0..std::mem::take(&mut self.units.timers[index].triggers) {
            self.trigger_slaves(timer);
        }
    }

    fn trigger_slaves(&mut self, master: TimerId) {
        for slave in TimerId::all() {
            if self.units.timers[slave.index()].master() == Some(master) {
                let moment = Moment { now: self.now, clocks: &self.clocks };
                let timer = &mut self.units.timers[slave.index()];
                crate::peripheral::Peripheral::advance(timer, moment);
                timer.trigger(self.now);
                self.react(Unit::Timer(slave));
            }
        }
    }

    fn react_to_uart(&mut self, uart: UartId) {
        let moment = Moment { now: self.now, clocks: &self.clocks };
        let port = &mut self.units.uarts[uart.index()];
        let baud = port.baud(moment);
        for (cycle, byte) in std::mem::take(&mut port.sent) {
            let sent = SentByte { at: self.clocks.base.time_of(cycle), byte, baud };
            self.note_sent(uart, sent);
            self.world.byte_sent(uart, sent, &mut self.terminals);
            self.world_was_told();
        }
        self.settle_pins(self.pads.pins_of_enable(uart));
    }

    fn react_to_spi(&mut self, spi: SpiId) {
        let moment = Moment { now: self.now, clocks: &self.clocks };
        for frame in self.units.spis[spi.index()].take_sent(moment) {
            let [clocked, hears, _] = self.units.spis[spi.index()].connected;
            let answer = if clocked { self.world.frame_exchanged(spi, frame) } else { None };
            let floating = if self.pads.input_of_spi(spi) { u16::MAX } else { 0 };
            let word = answer.filter(|_| hears).unwrap_or(floating);
            self.units.spis[spi.index()].receive(word);
        }
        self.world_was_told();
    }

    /// Tells timers which of their outputs are observed, and which trigger outputs other timers use.
    pub(crate) fn watch_timers(&mut self) {
        let masters: Vec<_> = self.units.timers.iter().filter_map(crate::timer::Timer::master).collect();
        for timer in TimerId::all() {
            let watched = self.pads.watched_outputs(timer);
            let state = &mut self.units.timers[timer.index()];
            state.watched = watched;
            state.heard = masters.contains(&timer);
            self.refresh(Unit::Timer(timer));
        }
    }

    /// Determines the levels of pins whose outputs may have changed.
    pub(crate) fn settle_pins(&mut self, mut pins: PinSet) {
        while pins != 0 {
            let index = pins.trailing_zeros() as usize;
            pins &= pins - 1;
            self.settle_pin(Pin::at(index));
        }
    }

    fn settle_pin(&mut self, pin: Pin) {
        let high = self.pads.resolve(&self.units, pin);
        if high == self.pads.is_high(pin) {
            return;
        }
        self.pads.set_level(pin, high);
        let port = &mut self.units.ports[pin.port()];
        let bit = 1 << pin.number();
        port.levels = if high { port.levels | bit } else { port.levels & !bit };
        let hears = port.mode(pin.number()) != Mode::Analog;
        if hears && self.units.syscfg.exti_port(pin.number()) == pin.port() {
            self.units.exti.edge(pin.number(), high);
            self.refresh(Unit::Exti);
        }
        self.set_input(pin, high);
        if self.pads.watched & pin.set() != 0 {
            let edge = PinEdge { at: self.instant(), pin, high };
            self.trace.note(edge);
            self.world.pin_changed(edge, &mut self.terminals);
            self.world_was_told();
        }
    }

    /// Passes the level of a pin to the timer input that it is connected to.
    fn set_input(&mut self, pin: Pin, high: bool) {
        let Some(Signal::Channel(timer, channel)) = self.pads.signal(pin) else { return };
        let moment = Moment { now: self.now, clocks: &self.clocks };
        let state = &mut self.units.timers[timer.index()];
        crate::peripheral::Peripheral::advance(state, moment);
        state.set_input(self.now, usize::from(channel), high);
        self.react(Unit::Timer(timer));
    }

    /// Carries out the requests of the world, in their order.
    pub(crate) fn connect_terminals(&mut self) {
        // This may cause further requests of the world, which nested calls carry out.
        for (pin, drive) in std::mem::take(&mut self.terminals.drives) {
            self.drive(pin, drive);
        }
        for (uart, frame) in std::mem::take(&mut self.terminals.frames) {
            let moment = Moment { now: self.now, clocks: &self.clocks };
            let port = &mut self.units.uarts[uart.index()];
            port.receive(moment, frame);
            self.refresh(Unit::Uart(uart));
        }
    }

    /// Drives a pin from outside.
    pub fn drive(&mut self, pin: Pin, drive: Drive) {
        self.pads.drives[pin.index()] = drive;
        self.settle_pin(pin);
    }

    /// The level of a pin.
    #[must_use]
    pub fn is_high(&self, pin: Pin) -> bool {
        // A free-running output that is not observed is updated only when it is asked for.
        self.pads.resolve(&self.units, pin)
    }
}
