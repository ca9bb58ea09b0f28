//! DMA requests and the transfers that they cause on the bus.

use vergence_cpu::Access;

use crate::chip::Chip;
use crate::dma::Transfer;
use crate::memory::{Memory, Place};
use crate::timer::timer_of_request;
use crate::trouble::Trouble;
use crate::unit::{TimerId, UartId, Unit};
use crate::world::World;

/// The source of a DMA request.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Source {
    Timer(TimerId),
    /// A serial port, to be read (0) or written (1).
    Uart(UartId, usize),
}

/// The source of each request (RM0440 §13.3.2).
#[derive(Clone, Debug)]
pub(crate) struct RequestSources([Option<Source>; 128]);

impl RequestSources {
    pub fn new() -> Self {
        Self(std::array::from_fn(|number| {
            let number = number as u8;
            let port = UartId::all().find_map(|uart| {
                uart.requests().iter().position(|&request| request == number).map(|way| Source::Uart(uart, way))
            });
            port.or_else(|| timer_of_request(number).map(Source::Timer))
        }))
    }

    fn of(&self, number: u8) -> Option<Source> {
        self.0.get(usize::from(number)).copied().flatten()
    }
}

/// Number of transfers at one instant that counts as an endless loop.
const TRANSFERS_AT_ONCE: u32 = 100_000;

impl<W: World> Chip<W> {
    /// Makes every transfer that is requested. Transfers take no time (see FIDELITY.md).
    pub(crate) fn serve_dma(&mut self) {
        // A transfer of one controller may cause a request to the other.
        while std::mem::take(&mut self.stirred) {
            self.serve_once();
        }
    }

    fn serve_once(&mut self) {
        for dma in 0..2 {
            if self.units.dma[dma].is_idle() {
                continue;
            }
            let mut transfers = 0;
            while let Some(transfer) =
                self.units.dma[dma].next_transfer(self.now, |channel| self.is_requested(dma, channel))
            {
                transfers += 1;
                if transfers > TRANSFERS_AT_ONCE {
                    return self.complain(Trouble::Endless { at: self.now, unit: Unit::Dma(dma as u8).to_string() });
                }
                self.transfer(dma, transfer);
            }
            if transfers > 0 {
                self.refresh(Unit::Dma(dma as u8));
            }
        }
    }

    fn is_requested(&self, dma: usize, channel: usize) -> bool {
        let number = self.units.dmamux.request(dma, channel);
        match self.sources.of(number) {
            Some(Source::Timer(timer)) => self.units.timers[timer.index()].requests(number),
            Some(Source::Uart(uart, way)) => self.units.uarts[uart.index()].requests(way),
            None => false,
        }
    }

    fn transfer(&mut self, dma: usize, transfer: Transfer) {
        let number = self.units.dmamux.request(dma, transfer.channel);
        if let Some(Source::Timer(timer)) = self.sources.of(number) {
            self.units.timers[timer.index()].acknowledge(number);
        }
        let (address, access) = transfer.from;
        let done = self.dma_read(address, access).and_then(|value| {
            let (address, access) = transfer.to;
            self.dma_write(address, access, value)
        });
        self.units.dma[dma].finish(transfer.channel, done.is_some());
    }

    fn dma_read(&mut self, address: u32, access: Access) -> Option<u32> {
        match Memory::place(address) {
            Some(Place::Ram(offset)) => self.memory.read_ram(offset, access),
            Some(Place::Flash(offset)) => self.memory.read_flash(offset, access),
            Some(Place::System(_)) => None,
            None => self.read_register(address, access).ok(),
        }
    }

    fn dma_write(&mut self, address: u32, access: Access, value: u32) -> Option<()> {
        match Memory::place(address) {
            Some(Place::Ram(offset)) => {
                if self.memory.holds_code(offset) {
                    self.code_version += 1;
                }
                self.memory.write_ram(offset, access, value)
            }
            Some(_) => None,
            None => self.write_register(address, access, value).ok(),
        }
    }
}
