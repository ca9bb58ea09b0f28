//! USART, UART and LPUART of version 4: frames with their times, FIFOs, errors, DMA requests (RM0440 §37, §38).
//!
//! - `receive`: frames from the peer
//! - `transmit`: frames to the peer
//! - `registers`: the registers

mod receive;
mod registers;
mod transmit;

use std::collections::VecDeque;

use vergence_cpu::Cycle;

use crate::peripheral::{Moment, Reply};
use crate::time::Picoseconds;
use crate::unit::UartId;

/// CR1.
mod cr1 {
    pub const UE: u32 = 1 << 0;
    pub const RE: u32 = 1 << 2;
    pub const TE: u32 = 1 << 3;
    pub const IDLEIE: u32 = 1 << 4;
    pub const RXNEIE: u32 = 1 << 5;
    pub const TCIE: u32 = 1 << 6;
    pub const TXEIE: u32 = 1 << 7;
    pub const PEIE: u32 = 1 << 8;
    pub const M0: u32 = 1 << 12;
    pub const OVER8: u32 = 1 << 15;
    pub const RTOIE: u32 = 1 << 26;
    pub const M1: u32 = 1 << 28;
    pub const FIFOEN: u32 = 1 << 29;
    pub const TXFEIE: u32 = 1 << 30;
    pub const RXFFIE: u32 = 1 << 31;
}

/// CR3.
mod cr3 {
    pub const EIE: u32 = 1 << 0;
    pub const HDSEL: u32 = 1 << 3;
    pub const DMAR: u32 = 1 << 6;
    pub const DMAT: u32 = 1 << 7;
    pub const OVRDIS: u32 = 1 << 12;
    pub const DDRE: u32 = 1 << 13;
    pub const TXFTIE: u32 = 1 << 23;
    pub const RXFTIE: u32 = 1 << 28;
}

/// ISR and ICR.
mod flag {
    pub const PE: u32 = 1 << 0;
    pub const FE: u32 = 1 << 1;
    pub const NE: u32 = 1 << 2;
    pub const ORE: u32 = 1 << 3;
    pub const IDLE: u32 = 1 << 4;
    pub const RXNE: u32 = 1 << 5;
    pub const TC: u32 = 1 << 6;
    pub const TXE: u32 = 1 << 7;
    pub const RTOF: u32 = 1 << 11;
    pub const BUSY: u32 = 1 << 16;
    pub const TEACK: u32 = 1 << 21;
    pub const REACK: u32 = 1 << 22;
    pub const TXFE: u32 = 1 << 23;
    pub const RXFF: u32 = 1 << 24;
    pub const RXFT: u32 = 1 << 26;
    pub const TXFT: u32 = 1 << 27;
}

/// A byte on a serial line.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Frame {
    /// Data bits.
    pub byte: u8,
    /// Speed of the line in bits per second.
    pub baud: u32,
    /// Transmission error injected into the byte.
    pub fault: LineFault,
}

/// The transmission error of a frame.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum LineFault {
    /// No error.
    #[default]
    None,
    /// One of the samples of a bit disagrees with the others.
    Noise,
    /// The stop bit is low.
    Framing,
}

/// A byte that the chip has sent.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct SentByte {
    /// The end of its stop bit.
    pub at: Picoseconds,
    /// The data bits.
    pub byte: u8,
    /// Speed of the line in bits per second.
    pub baud: u32,
}

/// A byte on its way out or in, and when it ends.
#[derive(Clone, Copy, Debug)]
struct Shifting {
    byte: u8,
    ends: Cycle,
}

/// A serial port.
#[derive(Clone, Debug)]
pub(crate) struct Uart {
    id: UartId,
    cr1: u32,
    cr2: u32,
    cr3: u32,
    brr: u32,
    rtor: u32,
    presc: u32,
    /// Flags that stay until cleared.
    isr: u32,
    /// Bytes waiting to be sent, and the one being sent.
    outbox: VecDeque<u8>,
    sending: Option<Shifting>,
    /// The line is held idle until here, after the transmitter is switched on.
    idle_until: Cycle,
    /// Received bytes with their error flags.
    inbox: VecDeque<(u8, u32)>,
    /// Frames that the peer sends one after the other, and the one that arrives.
    incoming: VecDeque<Frame>,
    arriving: Option<(Frame, Shifting)>,
    /// When the line will have been idle for a frame, and for RTOR.
    idle_at: Option<Cycle>,
    timeout_at: Option<Cycle>,
    /// Whether a pin is connected to transmitter and receiver.
    pub connected: [bool; 2],
    /// The bytes sent since they were last taken.
    pub sent: Vec<(Cycle, u8)>,
}

impl Uart {
    pub fn new(id: UartId) -> Self {
        Self {
            id,
            cr1: 0,
            cr2: 0,
            cr3: 0,
            brr: 0,
            rtor: 0,
            presc: 0,
            isr: flag::TC,
            outbox: VecDeque::new(),
            sending: None,
            idle_until: 0,
            inbox: VecDeque::new(),
            incoming: VecDeque::new(),
            arriving: None,
            idle_at: None,
            timeout_at: None,
            connected: [false; 2],
            sent: Vec::new(),
        }
    }

    /// Resets the registers; the peer continues to send.
    pub fn reset(&mut self) {
        *self = Self { incoming: std::mem::take(&mut self.incoming), ..Self::new(self.id) };
    }

    /// Whether a DMA request to read (0) or write (1) the data register is asserted.
    pub fn requests(&self, direction: usize) -> bool {
        if self.cr1 & cr1::UE == 0 {
            return false;
        }
        match direction {
            0 => {
                let barred = self.cr3 & cr3::DDRE != 0 && self.isr & (flag::PE | flag::FE | flag::NE) != 0;
                self.cr3 & cr3::DMAR != 0 && !self.inbox.is_empty() && !barred
            }
            _ => self.cr3 & cr3::DMAT != 0 && self.cr1 & cr1::TE != 0 && self.has_room(),
        }
    }

    fn is_on(&self, direction: u32) -> bool {
        self.cr1 & (cr1::UE | direction) == cr1::UE | direction
    }

    fn depth(&self) -> usize {
        if self.cr1 & cr1::FIFOEN != 0 { 8 } else { 1 }
    }

    /// Bits of a frame: start, data with parity, stop.
    fn frame_bits(&self) -> u64 {
        let data = match (self.cr1 & cr1::M1 != 0, self.cr1 & cr1::M0 != 0) {
            (true, _) => 7,
            (false, true) => 9,
            (false, false) => 8,
        };
        let stop = if self.cr2 >> 12 & 3 == 2 { 2 } else { 1 };
        1 + data + stop
    }

    /// The port's own clock after its prescaler (§37.8.14), and how many of its clocks a bit takes, as a fraction.
    fn bit(&self, moment: Moment) -> Reply<(u64, u64)> {
        const PRESCALERS: [u64; 12] = [1, 2, 4, 6, 8, 10, 12, 16, 32, 64, 128, 256];
        let clock = u64::from(moment.clocks.tree.uart[self.id.index()]);
        let prescaler = PRESCALERS.get(self.presc as usize).copied().unwrap_or(256);
        let brr = u64::from(self.brr);
        let (clocks, hertz) = if self.id == UartId::LPUART1 {
            // Baud rate = 256 × clock / BRR (§38.4.6).
            (brr, 256 * clock)
        } else if self.cr1 & cr1::OVER8 != 0 {
            (brr & 0xFFF0 | brr << 1 & 0xE, 2 * clock)
        } else {
            (brr, clock)
        };
        if clocks == 0 || clock == 0 {
            return Err("the port has no baud rate: BRR is zero or its clock stands".into());
        }
        Ok((clocks * prescaler, hertz))
    }

    /// Speed in bits per second.
    pub fn baud(&self, moment: Moment) -> u32 {
        self.bit(moment).map_or(0, |(clocks, hertz)| ((hertz + clocks / 2) / clocks) as u32)
    }

    /// Core cycles that `half_bits` half bits take.
    fn half_bits(&self, moment: Moment, half_bits: u64) -> Cycle {
        let Ok((clocks, hertz)) = self.bit(moment) else { return 0 };
        let core = u128::from(moment.clocks.tree.hclk);
        let divisor = 2 * u128::from(hertz);
        ((u128::from(half_bits) * u128::from(clocks) * core + divisor / 2) / divisor) as Cycle
    }
}
