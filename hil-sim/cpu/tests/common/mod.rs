//! A board of plain RAM for the core to run on, and code given as half-words.
#![allow(dead_code, reason = "each test file uses its part")]

pub mod code;

use vergence_cpu::{Access, Bus, BusFault, Cpu, Cycle, Lines, NEVER};

pub const CODE_SIZE: usize = 0x10_0000;
pub const RAM: u32 = 0x2000_0000;
pub const RAM_SIZE: usize = 0x10_0000;
/// A device register: writing it moves the lines.
pub const LINES_REGISTER: u32 = 0x4000_0000;

/// Memory at 0 and at [`RAM`], interrupt lines set by the test, and a schedule of changes to them.
#[derive(Clone)]
pub struct Board {
    pub code: Vec<u8>,
    pub ram: Vec<u8>,
    pub lines: Lines,
    pub nmi: bool,
    pub wait_states: u32,
    /// Changes of the interrupt lines: cycle and new state, earliest first.
    pub schedule: Vec<(Cycle, Lines)>,
    pub stop: bool,
}

impl Default for Board {
    fn default() -> Self {
        Self {
            code: vec![0; CODE_SIZE],
            ram: vec![0; RAM_SIZE],
            lines: 0,
            nmi: false,
            wait_states: 0,
            schedule: Vec::new(),
            stop: false,
        }
    }
}

impl Board {
    /// A board with the stack at the top of RAM, every vector on its own `b .` and the entry at 0x400.
    pub fn with_program(halves: &[u16]) -> Self {
        let mut board = Self::default();
        board.put_word(0, RAM + RAM_SIZE as u32);
        board.put_word(4, 0x401);
        for number in 2..144 {
            board.handler(number, &[0xe7fe]);
        }
        board.put_code(0x400, halves);
        board
    }

    /// Puts the handler of an exception and its vector; there is room for 32 half-words.
    pub fn handler(&mut self, exception: u32, halves: &[u16]) {
        let address = 0x1000 + exception * 0x40;
        self.put_word(4 * exception, address | 1);
        self.put_code(address, halves);
    }

    pub fn handler_address(exception: u32) -> u32 {
        0x1000 + exception * 0x40
    }

    pub fn put_word(&mut self, address: u32, word: u32) {
        self.code[address as usize..address as usize + 4].copy_from_slice(&word.to_le_bytes());
    }

    pub fn put_code(&mut self, address: u32, halves: &[u16]) {
        for (index, half) in halves.iter().enumerate() {
            let at = address as usize + 2 * index;
            self.code[at..at + 2].copy_from_slice(&half.to_le_bytes());
        }
    }

    /// Puts bytes into memory.
    pub fn put(&mut self, address: u32, bytes: &[u8]) {
        if let Some(place) = self.bytes_mut(address, bytes.len()) {
            place.copy_from_slice(bytes);
        }
    }

    /// The zero-terminated text in memory.
    pub fn text(&self, address: u32) -> String {
        (address..)
            .map_while(|at| self.bytes(at, 1))
            .map(|bytes| bytes[0])
            .take_while(|&b| b != 0)
            .map(char::from)
            .collect()
    }

    /// A word of memory, zero outside.
    pub fn word(&self, address: u32) -> u32 {
        self.bytes(address, 4).map_or(0, |bytes| u32::from_le_bytes([bytes[0], bytes[1], bytes[2], bytes[3]]))
    }

    fn bytes(&self, address: u32, size: usize) -> Option<&[u8]> {
        let (memory, offset) =
            if address >= RAM { (&self.ram, (address - RAM) as usize) } else { (&self.code, address as usize) };
        memory.get(offset..offset.checked_add(size)?)
    }

    fn bytes_mut(&mut self, address: u32, size: usize) -> Option<&mut [u8]> {
        let (memory, offset) =
            if address >= RAM { (&mut self.ram, (address - RAM) as usize) } else { (&mut self.code, address as usize) };
        memory.get_mut(offset..offset.checked_add(size)?)
    }
}

impl Bus for Board {
    #[inline]
    fn read(&mut self, _: Cycle, address: u32, access: Access) -> Result<u32, BusFault> {
        if address == LINES_REGISTER {
            return Ok(self.lines as u32);
        }
        match access {
            Access::Byte => self.bytes(address, 1).map(|bytes| u32::from(bytes[0])),
            Access::Half => self.bytes(address, 2).map(|bytes| u32::from(u16::from_le_bytes([bytes[0], bytes[1]]))),
            Access::Word => {
                self.bytes(address, 4).map(|bytes| u32::from_le_bytes([bytes[0], bytes[1], bytes[2], bytes[3]]))
            }
        }
        .ok_or(BusFault)
    }

    #[inline]
    fn write(&mut self, _: Cycle, address: u32, access: Access, value: u32) -> Result<(), BusFault> {
        if address == LINES_REGISTER {
            self.lines = Lines::from(value);
            return Ok(());
        }
        let value = value.to_le_bytes();
        let size = match access {
            Access::Byte => 1,
            Access::Half => 2,
            Access::Word => 4,
        };
        self.bytes_mut(address, size).ok_or(BusFault)?.copy_from_slice(&value[..size]);
        Ok(())
    }

    fn fetch(&self, address: u32) -> Result<u16, BusFault> {
        self.bytes(address, 2).map(|bytes| u16::from_le_bytes([bytes[0], bytes[1]])).ok_or(BusFault)
    }

    fn code_version(&self) -> u64 {
        0
    }

    fn wait_states(&self, _now: Cycle) -> u32 {
        self.wait_states
    }

    fn advance(&mut self, now: Cycle) {
        while let Some(&(due, lines)) = self.schedule.first() {
            if due > now {
                break;
            }
            self.lines = lines;
            self.schedule.remove(0);
        }
    }

    fn next_event(&self) -> Cycle {
        self.schedule.first().map_or(NEVER, |&(due, _)| due)
    }

    fn lines(&self) -> Lines {
        self.lines
    }

    fn nmi(&self) -> bool {
        self.nmi
    }

    fn stop_requested(&self) -> bool {
        self.stop
    }
}

/// A core fresh from reset on the board.
pub fn boot(board: &mut Board) -> Cpu {
    let mut cpu = Cpu::new();
    cpu.reset(board);
    cpu
}
