//! A chip without a core: registers are poked directly, time passes on command.
#![allow(dead_code, reason = "each test file uses its part")]
#![allow(clippy::unwrap_used, reason = "a test fails by panic")]

pub mod serial;
pub mod timer;

use vergence_cpu::{Access, Bus, Cycle};
use vergence_mcu::{Chip, ChipConfig, Drive, Frame, LineFault, Nothing, Pin, PinEdge, Terminals, UartId, World};

pub const RCC: u32 = 0x4002_1000;
pub const PWR: u32 = 0x4000_7000;
pub const FLASH: u32 = 0x4002_2000;
pub const GPIOA: u32 = 0x4800_0000;
pub const GPIOB: u32 = 0x4800_0400;
pub const GPIOC: u32 = 0x4800_0800;
pub const TIM1: u32 = 0x4001_2C00;
pub const TIM2: u32 = 0x4000_0000;
pub const TIM3: u32 = 0x4000_0400;
pub const TIM15: u32 = 0x4001_4000;
pub const LPUART1: u32 = 0x4000_8000;
pub const USART2: u32 = 0x4000_4400;
pub const USART3: u32 = 0x4000_4800;

/// A world that records the edges of the pins it observes.
#[derive(Clone, Debug, Default)]
pub struct Recorder {
    pub pins: Vec<Pin>,
    pub edges: Vec<PinEdge>,
}

impl World for Recorder {
    fn watched(&self) -> Vec<Pin> {
        self.pins.clone()
    }

    fn pin_changed(&mut self, edge: PinEdge, _terminals: &mut Terminals) {
        self.edges.push(edge);
    }
}

/// A chip and its clock.
pub struct Bench<W> {
    pub chip: Chip<W>,
    pub now: Cycle,
}

/// A chip at 16 MHz with every clock of the model on.
pub fn bench() -> Bench<Nothing> {
    bench_with(Nothing)
}

pub fn bench_with<W: World>(world: W) -> Bench<W> {
    let mut bench = bare(world);
    bench.write(RCC + 0x48, 0x0000_1107);
    bench.write(RCC + 0x4C, 0x0400_007F);
    bench.write(RCC + 0x58, 0x101E_003F);
    bench.write(RCC + 0x5C, 0x0000_0001);
    bench.write(RCC + 0x60, 0x0017_6801);
    bench
}

/// A chip as it comes out of reset.
pub fn bare<W: World>(world: W) -> Bench<W> {
    Bench { chip: Chip::new(ChipConfig::default(), world), now: 0 }
}

pub fn pin(name: &str) -> Pin {
    Pin::named(name).unwrap()
}

pub fn frame(byte: u8, baud: u32) -> Frame {
    Frame { byte, baud, fault: LineFault::None }
}

impl<W: World> Bench<W> {
    pub fn read(&mut self, address: u32) -> u32 {
        self.chip.read(self.now, address, Access::Word).unwrap()
    }

    pub fn write(&mut self, address: u32, value: u32) {
        self.chip.write(self.now, address, Access::Word, value).unwrap();
    }

    pub fn modify(&mut self, address: u32, clear: u32, set: u32) {
        let value = self.read(address);
        self.write(address, value & !clear | set);
    }

    /// Lets cycles pass.
    pub fn wait(&mut self, cycles: Cycle) {
        self.now += cycles;
        self.chip.advance(self.now);
    }

    /// Connects a pin to an alternate function.
    pub fn connect(&mut self, name: &str, function: u32) {
        let number = u32::from(name[2..].parse::<u8>().unwrap());
        let port = GPIOA + 0x400 * u32::from(name.as_bytes()[1] - b'A');
        self.modify(port, 3 << (2 * number), 2 << (2 * number));
        let register = port + 0x20 + 4 * (number / 8);
        self.modify(register, 0xF << (4 * (number % 8)), function << (4 * (number % 8)));
    }

    pub fn drive(&mut self, name: &str, high: bool) {
        self.chip.drive(pin(name), Drive::level(high));
    }

    pub fn line(&self, number: u32) -> bool {
        self.chip.lines() >> number & 1 == 1
    }

    pub fn sent(&mut self, port: UartId) -> Vec<u8> {
        self.chip.take_sent(port).iter().map(|sent| sent.byte).collect()
    }

    /// The troubles that the chip has recorded.
    pub fn complaint(&self) -> Option<String> {
        self.chip.complaint().map(ToString::to_string)
    }
}
