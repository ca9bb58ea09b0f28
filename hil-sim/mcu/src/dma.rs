//! DMA1, DMA2 and DMAMUX: eight channels each, any request to any channel (RM0440 §12, §13).

use vergence_cpu::{Access, Cycle, Lines, NEVER};

use crate::clocks::Clocks;
use crate::peripheral::{Moment, Peripheral, Refused, Registers, Reply, only};

const ISR: u32 = 0x00;
const IFCR: u32 = 0x04;
const FIRST_CHANNEL: u32 = 0x08;
const CHANNEL_STRIDE: u32 = 20;
const CHANNELS: usize = 8;

const EN: u32 = 1 << 0;
const FROM_MEMORY: u32 = 1 << 4;
const CIRCULAR: u32 = 1 << 5;
const PERIPHERAL_INCREMENT: u32 = 1 << 6;
const MEMORY_INCREMENT: u32 = 1 << 7;
const MEMORY_TO_MEMORY: u32 = 1 << 14;

const COMPLETE: u32 = 2;
const HALF: u32 = 4;
const ERROR: u32 = 8;

/// Core cycles from one transfer of memory to memory to the next (AN2548 §1.3: five, and one of arbitration).
const TRANSFER_CYCLES: u64 = 6;

/// One channel.
#[derive(Clone, Copy, Debug, Default)]
struct Channel {
    ccr: u32,
    left: u32,
    peripheral: u32,
    memory: u32,
    /// The count as written while the channel was off: circular mode restarts with it.
    count: u32,
    /// Bytes that the pointers have moved.
    moved: u32,
    /// When the next transfer of memory to memory is due.
    next: Option<Cycle>,
}

/// One transfer to be carried out on the bus.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Transfer {
    pub channel: usize,
    pub from: (u32, Access),
    pub to: (u32, Access),
}

/// One controller.
#[derive(Clone, Debug)]
pub(crate) struct Dma {
    number: u8,
    flags: u32,
    channels: [Channel; CHANNELS],
    /// A bit for each channel that is on.
    enabled: u8,
}

impl Dma {
    pub fn new(number: u8) -> Self {
        Self { number, flags: 0, channels: [Channel::default(); CHANNELS], enabled: 0 }
    }

    /// Whether any channel could serve a request.
    pub fn is_idle(&self) -> bool {
        self.enabled == 0
    }

    fn find_enabled(&mut self) {
        let channels = (0..).zip(&self.channels);
        self.enabled = channels.fold(0, |all, (index, channel)| all | ((channel.ccr & EN) as u8) << index);
    }

    /// The next transfer: among enabled channels with a request, the one of highest priority, then of lowest number
    /// (§12.4.4). `requested` tells whether the request line of a channel is asserted.
    pub fn next_transfer(&self, now: Cycle, requested: impl Fn(usize) -> bool) -> Option<Transfer> {
        (0..CHANNELS)
            .filter(|&index| self.enabled >> index & 1 == 1)
            .filter(|&index| {
                let channel = &self.channels[index];
                let ready = match channel.ccr & MEMORY_TO_MEMORY {
                    0 => requested(index),
                    _ => channel.next.is_some_and(|at| at <= now),
                };
                channel.left > 0 && ready
            })
            .max_by_key(|&index| (self.channels[index].ccr >> 12 & 3, CHANNELS - index))
            .map(|index| self.channels[index].transfer(index))
    }

    /// Records that the transfer was made, or that its address did not answer.
    pub fn finish(&mut self, index: usize, done: bool) {
        let channel = &mut self.channels[index];
        let flags = if done { channel.step() } else { channel.fail() };
        if !done {
            self.find_enabled();
        }
        if flags != 0 {
            self.flags |= (flags | 1) << (4 * index);
        }
    }

    fn write_channel(&mut self, moment: Moment, index: usize, register: u32, value: u32) -> Reply<()> {
        let channel = &mut self.channels[index];
        if register > 0 && channel.ccr & EN != 0 {
            return Err(Refused(format!("channel {} is changed while it runs", index + 1)));
        }
        match register {
            0 => {
                only(value, 0x7FFF)?;
                let starts = value & !channel.ccr & EN != 0;
                channel.ccr = value;
                if starts {
                    channel.start(moment.now);
                }
                let reply = channel.check();
                self.find_enabled();
                return reply;
            }
            4 => {
                channel.left = value & 0xFFFF;
                channel.count = channel.left;
            }
            8 => channel.peripheral = value,
            _ => channel.memory = value,
        }
        Ok(())
    }
}

impl Channel {
    fn start(&mut self, now: Cycle) {
        self.moved = 0;
        self.count = self.left;
        self.next = (self.ccr & MEMORY_TO_MEMORY != 0).then_some(now + TRANSFER_CYCLES);
    }

    fn check(&self) -> Reply<()> {
        let size = |low: u32| self.ccr >> low & 3;
        if self.ccr & EN != 0 && (size(8) == 3 || size(10) == 3) {
            return Err("a transfer size of 3 is reserved".into());
        }
        Ok(())
    }

    fn access(&self, low: u32) -> Access {
        match self.ccr >> low & 3 {
            0 => Access::Byte,
            1 => Access::Half,
            _ => Access::Word,
        }
    }

    fn transfer(&self, channel: usize) -> Transfer {
        let place = |base: u32, low: u32, increments: u32| {
            let access = self.access(low);
            let size = crate::memory::bytes(access) as u32;
            let offset = if self.ccr & increments != 0 { self.moved * size } else { 0 };
            // Addresses are aligned by ignoring their low bits (§12.6.5).
            (base.wrapping_add(offset) & !(size - 1), access)
        };
        let peripheral = place(self.peripheral, 8, PERIPHERAL_INCREMENT);
        let memory = place(self.memory, 10, MEMORY_INCREMENT);
        let (from, to) = if self.ccr & FROM_MEMORY != 0 { (memory, peripheral) } else { (peripheral, memory) };
        Transfer { channel, from, to }
    }

    fn step(&mut self) -> u32 {
        self.left -= 1;
        self.moved += 1;
        self.next = self.next.map(|at| at + TRANSFER_CYCLES);
        let mut flags = 0;
        if self.moved == self.count.div_ceil(2) {
            flags |= HALF;
        }
        if self.left == 0 {
            flags |= COMPLETE;
            self.next = None;
            if self.ccr & CIRCULAR != 0 {
                self.left = self.count;
                self.moved = 0;
            }
        }
        flags
    }

    fn fail(&mut self) -> u32 {
        self.ccr &= !EN;
        self.next = None;
        ERROR
    }
}

/// The channel and its register, 0 to 12, at an offset.
fn channel_at(offset: u32) -> Option<(usize, u32)> {
    let offset = offset.checked_sub(FIRST_CHANNEL)?;
    Some(((offset / CHANNEL_STRIDE) as usize, offset % CHANNEL_STRIDE)).filter(|&(index, _)| index < CHANNELS)
}

impl Peripheral for Dma {
    fn registers(&self) -> Registers {
        const TABLE: [(u32, &str); 2 + 4 * CHANNELS] = {
            const NAMES: [[&str; 4]; CHANNELS] = [
                ["CCR1", "CNDTR1", "CPAR1", "CMAR1"],
                ["CCR2", "CNDTR2", "CPAR2", "CMAR2"],
                ["CCR3", "CNDTR3", "CPAR3", "CMAR3"],
                ["CCR4", "CNDTR4", "CPAR4", "CMAR4"],
                ["CCR5", "CNDTR5", "CPAR5", "CMAR5"],
                ["CCR6", "CNDTR6", "CPAR6", "CMAR6"],
                ["CCR7", "CNDTR7", "CPAR7", "CMAR7"],
                ["CCR8", "CNDTR8", "CPAR8", "CMAR8"],
            ];
            let mut table = [(ISR, "ISR"); 2 + 4 * CHANNELS];
            table[1] = (IFCR, "IFCR");
            let mut index = 0;
            while index < 4 * CHANNELS {
                let (channel, register) = (index / 4, index % 4);
                let offset = FIRST_CHANNEL + CHANNEL_STRIDE * channel as u32 + 4 * register as u32;
                table[2 + index] = (offset, NAMES[channel][register]);
                index += 1;
            }
            table
        };
        &TABLE
    }

    fn reads_quietly(&self, _offset: u32) -> bool {
        true
    }

    fn read(&mut self, _moment: Moment, offset: u32) -> Reply<u32> {
        let Some((index, register)) = channel_at(offset) else {
            return Ok(if offset == ISR { self.flags } else { 0 });
        };
        let channel = &self.channels[index];
        Ok(match register {
            0 => channel.ccr,
            4 => channel.left,
            8 => channel.peripheral,
            _ => channel.memory,
        })
    }

    fn write(&mut self, moment: Moment, offset: u32, value: u32) -> Reply<()> {
        if let Some((index, register)) = channel_at(offset) {
            return self.write_channel(moment, index, register, value);
        }
        if offset == IFCR {
            // Clearing a channel's global flag clears all four.
            let global = value & 0x1111_1111;
            self.flags &= !(value | (global * 0xF));
            for index in 0..CHANNELS as u32 {
                if self.flags >> (4 * index) & 0xE == 0 {
                    self.flags &= !(1 << (4 * index));
                }
            }
        }
        Ok(())
    }

    fn due(&self, _clocks: &Clocks) -> Cycle {
        self.channels.iter().filter_map(|channel| channel.next).min().unwrap_or(NEVER)
    }

    fn lines(&self) -> Lines {
        const LINES: [[u32; CHANNELS]; 2] = [[11, 12, 13, 14, 15, 16, 17, 96], [56, 57, 58, 59, 60, 97, 98, 99]];
        let lines = LINES[usize::from(self.number)];
        (0..CHANNELS)
            .filter(|&index| self.flags >> (4 * index) & self.channels[index].ccr & 0xE != 0)
            .fold(0, |all, index| all | 1 << lines[index])
    }
}

/// Request routed to each channel: 0 to 7 of DMA1, 8 to 15 of DMA2.
#[derive(Clone, Debug, Default)]
pub(crate) struct Dmamux {
    ccr: [u32; 2 * CHANNELS],
}

impl Dmamux {
    /// The request of a channel; zero is none.
    pub fn request(&self, dma: usize, channel: usize) -> u8 {
        (self.ccr[dma * CHANNELS + channel] & 0x7F) as u8
    }
}

impl Peripheral for Dmamux {
    fn registers(&self) -> Registers {
        &[
            (0x00, "C0CR"),
            (0x04, "C1CR"),
            (0x08, "C2CR"),
            (0x0C, "C3CR"),
            (0x10, "C4CR"),
            (0x14, "C5CR"),
            (0x18, "C6CR"),
            (0x1C, "C7CR"),
            (0x20, "C8CR"),
            (0x24, "C9CR"),
            (0x28, "C10CR"),
            (0x2C, "C11CR"),
            (0x30, "C12CR"),
            (0x34, "C13CR"),
            (0x38, "C14CR"),
            (0x3C, "C15CR"),
            (0x80, "CSR"),
            (0x84, "CFR"),
        ]
    }

    fn read(&mut self, _moment: Moment, offset: u32) -> Reply<u32> {
        Ok(self.ccr.get(offset as usize / 4).copied().unwrap_or(0))
    }

    fn write(&mut self, _moment: Moment, offset: u32, value: u32) -> Reply<()> {
        if let Some(register) = self.ccr.get_mut(offset as usize / 4) {
            // Synchronization is missing. So are events (EGE, bit 9), but only it and the generators would use them.
            only(value, 0x27F)?;
            *register = value;
        }
        Ok(())
    }
}
