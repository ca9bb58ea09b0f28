//! SPI as a full-duplex master with frames of 4 to 16 bits (RM0440 §42): FIFOs, flags, times. Devices answer whole frames.

use std::collections::VecDeque;

use vergence_cpu::{Access, Cycle, Lines, NEVER};

use crate::clocks::Clocks;
use crate::peripheral::{Moment, Peripheral, Registers, Reply, only};
use crate::time::Picoseconds;
use crate::unit::SpiId;

const CR1: u32 = 0x00;
const CR2: u32 = 0x04;
const SR: u32 = 0x08;
const DR: u32 = 0x0C;
const CRCPR: u32 = 0x10;

/// CR1.
const CPHA: u32 = 1 << 0;
const CPOL: u32 = 1 << 1;
const MSTR: u32 = 1 << 2;
const BR: u32 = 7 << 3;
const SPE: u32 = 1 << 6;
const LSBFIRST: u32 = 1 << 7;
const SSI: u32 = 1 << 8;
const SSM: u32 = 1 << 9;

/// CR2.
const SSOE: u32 = 1 << 2;
const ERRIE: u32 = 1 << 5;
const RXNEIE: u32 = 1 << 6;
const TXEIE: u32 = 1 << 7;
const DS: u32 = 0xF << 8;
const FRXTH: u32 = 1 << 12;

/// SR.
const RXNE: u32 = 1 << 0;
const TXE: u32 = 1 << 1;
const MODF: u32 = 1 << 5;
const OVR: u32 = 1 << 6;
const BSY: u32 = 1 << 7;

/// Bytes of each FIFO.
const FIFO: usize = 4;

/// A frame that an SPI has sent.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct SpiFrame {
    /// When its first bit began and its last one ended.
    pub from: Picoseconds,
    /// The end of its last bit.
    pub to: Picoseconds,
    /// The bits sent, the first one in the highest place.
    pub word: u16,
    /// Number of bits.
    pub bits: u8,
    /// Mode 0 to 3: the polarity of the clock (2), and its phase (1).
    pub mode: u8,
    /// Speed of the clock in hertz.
    pub hertz: u32,
}

/// A frame under way.
#[derive(Clone, Copy, Debug)]
struct Shifting {
    word: u16,
    begins: Cycle,
    ends: Cycle,
}

/// A synchronous serial port.
#[derive(Clone, Debug)]
pub(crate) struct Spi {
    id: SpiId,
    cr1: u32,
    cr2: u32,
    crcpr: u32,
    /// MODF and OVR, and whether DR was read since OVR.
    errors: u32,
    overrun_read: bool,
    outbox: VecDeque<u16>,
    inbox: VecDeque<u16>,
    shifting: Option<Shifting>,
    sent: Vec<Shifting>,
    /// Width of the access under way.
    pub access: Access,
    /// Whether clock, input and output have a pin.
    pub connected: [bool; 3],
}

impl Spi {
    pub fn new(id: SpiId) -> Self {
        Self {
            id,
            cr1: 0,
            cr2: 0x700,
            crcpr: 7,
            errors: 0,
            overrun_read: false,
            outbox: VecDeque::new(),
            inbox: VecDeque::new(),
            shifting: None,
            sent: Vec::new(),
            access: Access::Word,
            connected: [false; 3],
        }
    }

    fn is_on(&self) -> bool {
        self.cr1 & (SPE | MSTR) == SPE | MSTR
    }

    fn bits(&self) -> u8 {
        (self.cr2 >> 8 & 0xF) as u8 + 1
    }

    /// Bytes that a frame takes in a FIFO.
    fn bytes(&self) -> usize {
        if self.bits() > 8 { 2 } else { 1 }
    }

    /// Level of the clock between frames; `None` where the port is off.
    pub fn idle_clock(&self) -> Option<bool> {
        self.is_on().then_some(self.cr1 & CPOL != 0)
    }

    /// Level of the output between frames: that of the last bit on the chip, low here.
    pub fn idle_output(&self) -> Option<bool> {
        self.is_on().then_some(false)
    }

    /// Core cycles of one bit, as a fraction: the bus divided by 2 to 256.
    fn bit(&self, clocks: &Clocks) -> (u64, u64) {
        let divider = 2 << (self.cr1 >> 3 & 7);
        (divider * u64::from(clocks.tree.hclk), u64::from(clocks.tree.pclk[self.id.bus()].max(1)))
    }

    fn shift_next(&mut self, clocks: &Clocks, now: Cycle) {
        if self.shifting.is_some() || !self.is_on() {
            return;
        }
        if let Some(word) = self.outbox.pop_front() {
            let (cycles, per) = self.bit(clocks);
            let length = (u64::from(self.bits()) * cycles).div_ceil(per);
            self.shifting = Some(Shifting { word, begins: now, ends: now + length });
        }
    }

    /// Takes the frames sent since the last call.
    pub fn take_sent(&mut self, moment: Moment) -> Vec<SpiFrame> {
        let (cycles, per) = self.bit(moment.clocks);
        let hertz = u64::from(moment.clocks.tree.hclk) * per / cycles.max(1);
        let sent = std::mem::take(&mut self.sent).into_iter().map(|shifted| SpiFrame {
            from: moment.clocks.base.time_of(shifted.begins),
            to: moment.clocks.base.time_of(shifted.ends),
            word: shifted.word,
            bits: self.bits(),
            mode: (self.cr1 >> 1 & 1) as u8 * 2 + (self.cr1 & 1) as u8,
            hertz: hertz as u32,
        });
        sent.collect()
    }

    /// Takes what came in during a frame; without room it is lost (§42.5.11).
    pub fn receive(&mut self, word: u16) {
        if (self.inbox.len() + 1) * self.bytes() > FIFO {
            self.errors |= OVR;
            self.overrun_read = false;
        } else {
            let mask = u16::MAX >> (16 - self.bits());
            self.inbox.push_back(word & mask);
        }
    }

    fn flags(&self) -> u32 {
        let (received, waiting) = (self.inbox.len() * self.bytes(), self.outbox.len() * self.bytes());
        let threshold = if self.cr2 & FRXTH != 0 { 1 } else { 2 };
        // The levels count quarters; four and three bytes read as full (§42.9.3).
        let level = |bytes: usize| bytes.min(3) as u32;
        let flag = |is_set: bool, bit: u32| if is_set { bit } else { 0 };
        self.errors
            | flag(received >= threshold, RXNE)
            | flag(waiting <= FIFO / 2, TXE)
            | flag(self.shifting.is_some() || self.is_on() && waiting > 0, BSY)
            | level(received) << 9
            | level(waiting) << 11
    }

    /// Refuses an access whose width packs or splits frames.
    fn check_width(&self) -> Reply<()> {
        match (self.access, self.bytes()) {
            (Access::Byte, 1) | (Access::Half, 2) => Ok(()),
            _ => Err("DR must be accessed with the width of a frame: packing is not modelled".into()),
        }
    }

    fn write_cr1(&mut self, value: u32) -> Reply<()> {
        // Master in both directions; slaves, one line, CRC and receive only are missing.
        only(value, CPHA | CPOL | MSTR | BR | SPE | LSBFIRST | SSI | SSM)?;
        if value & LSBFIRST != 0 || value & SPE != 0 && value & MSTR == 0 {
            return Err("a slave, or the lowest bit first, is not modelled".into());
        }
        if self.cr1 & value & SPE != 0 && (self.cr1 ^ value) & (CPHA | CPOL | MSTR | BR) != 0 {
            return Err("the mode must not change while the port is on (§42.5.7)".into());
        }
        if self.cr1 & !value & SPE != 0 && self.shifting.is_some() {
            return Err("the port was switched off in mid-frame (§42.5.9)".into());
        }
        self.cr1 = value;
        // The slave select that a master reads must be high (§42.5.11).
        if value & (MSTR | SSM | SSI) == MSTR | SSM {
            self.cr1 &= !(MSTR | SPE);
            self.errors |= MODF;
        } else if value & (SPE | SSM) == SPE && self.cr2 & SSOE == 0 {
            return Err("a slave select by pin is not modelled: set SSM and SSI, or SSOE".into());
        }
        self.errors &= !if value & MSTR != 0 && value & SSI != 0 { MODF } else { 0 };
        Ok(())
    }

    fn write_cr2(&mut self, value: u32) -> Reply<()> {
        only(value, SSOE | ERRIE | RXNEIE | TXEIE | DS | FRXTH)?;
        if self.cr1 & SPE != 0 && (self.cr2 ^ value) & (DS | SSOE) != 0 {
            return Err("the size of frames must not change while the port is on (§42.5.7)".into());
        }
        // Sizes below four bits are forced to eight (§42.9.2).
        let forced = if value & DS < 3 << 8 { value & !DS | 7 << 8 } else { value };
        self.cr2 = forced;
        Ok(())
    }
}

impl Peripheral for Spi {
    fn registers(&self) -> Registers {
        &[
            (CR1, "CR1"),
            (CR2, "CR2"),
            (SR, "SR"),
            (DR, "DR"),
            (CRCPR, "CRCPR"),
            (0x14, "RXCRCR"),
            (0x18, "TXCRCR"),
            (0x1C, "I2SCFGR"),
            (0x20, "I2SPR"),
        ]
    }

    fn read(&mut self, _moment: Moment, offset: u32) -> Reply<u32> {
        Ok(match offset {
            CR1 => self.cr1,
            CR2 => self.cr2,
            SR => {
                let flags = self.flags();
                // A read of DR and then of SR clears the overrun (§42.5.11).
                if self.overrun_read {
                    self.errors &= !OVR;
                }
                flags
            }
            DR => {
                self.check_width()?;
                self.overrun_read = true;
                self.inbox.pop_front().map_or(0, u32::from)
            }
            CRCPR => self.crcpr,
            0x20 => 2,
            _ => 0,
        })
    }

    fn write(&mut self, moment: Moment, offset: u32, value: u32) -> Reply<()> {
        match offset {
            CR1 => self.write_cr1(value)?,
            CR2 => self.write_cr2(value)?,
            DR => {
                self.check_width()?;
                if (self.outbox.len() + 1) * self.bytes() > FIFO {
                    return Err("DR was written while its FIFO was full".into());
                }
                self.outbox.push_back(value as u16 & (u16::MAX >> (16 - self.bits())));
            }
            CRCPR => self.crcpr = value & 0xFFFF,
            // I2S is missing.
            0x1C => only(value, 0)?,
            0x20 => only(value, 2)?,
            _ => {}
        }
        self.shift_next(moment.clocks, moment.now);
        Ok(())
    }

    fn advance(&mut self, moment: Moment) {
        while let Some(shifting) = self.shifting.filter(|shifting| shifting.ends <= moment.now) {
            self.shifting = None;
            self.sent.push(shifting);
            self.shift_next(moment.clocks, shifting.ends);
        }
    }

    fn due(&self, _clocks: &Clocks) -> Cycle {
        self.shifting.map_or(NEVER, |shifting| shifting.ends)
    }

    fn lines(&self) -> Lines {
        let flags = self.flags();
        let asks = self.cr2 & RXNEIE != 0 && flags & RXNE != 0
            || self.cr2 & TXEIE != 0 && flags & TXE != 0
            || self.cr2 & ERRIE != 0 && flags & (OVR | MODF) != 0;
        if asks { 1 << self.id.interrupt() } else { 0 }
    }
}
