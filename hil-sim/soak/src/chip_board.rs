//! The board's own firmware on the simulated chip as the board of a scenario.

use vergence_cpu::{Access, Bus};
use vergence_mcu::{
    Bench, BenchWiring, ChipConfig, Firmware, FlashCells, Frame, Halt, LineFault, Machine, Picoseconds, UartId,
};
use vergence_plant::Plant;
use vergence_protocol::Microseconds;

use crate::power_cuts::SignedImage;
use crate::scenario::Scenario;
use crate::simulation::Board;
use crate::stages::stages;

/// The speed of the line from the factory.
const BAUD: u32 = 921_600;
/// Longest time from the first byte of a request to its effect, and from a tick to the end of the pose that reports it: two
/// ticks, and a pose of 45 bytes behind an answer on the wire.
const DELAY_US: u64 = 5_000;
/// Registers of TIM7, whose interrupt is the control tick (RM0440, 31.4): its enable bit and its counter, in microseconds.
const TIM7_DIER: u32 = 0x4000_140C;
const TIM7_CNT: u32 = 0x4000_1424;
/// The clocks of peripherals and the bit for that of TIM7 (RM0440, 7.4.19).
const RCC_APB1ENR1: u32 = 0x4002_1058;
const TIM7EN: u32 = 1 << 5;
/// Period of the control tick, in microseconds.
const TICK_US: u64 = 1_000;

/// The flash of a board as it is delivered: boot loader and sealed application.
#[derive(Clone, Debug)]
pub struct ChipFlash(FlashCells);

impl ChipFlash {
    /// Flash with this boot loader and this application; `None` where they do not fit.
    #[must_use]
    pub fn new(boot_loader: &Firmware, application: &SignedImage) -> Option<Self> {
        application.delivered_with(boot_loader).map(Self)
    }

    /// A board with this flash, just switched on, before the stages of `scenario`.
    #[must_use]
    pub fn board(&self, scenario: &Scenario) -> ChipBoard {
        let mechanics = stages().map(|stage| stage.mechanics);
        self.board_before(Plant::new(&mechanics, &scenario.positions))
    }

    /// A board with this flash, just switched on, before these mechanics.
    #[must_use]
    pub fn board_before(&self, plant: Plant) -> ChipBoard {
        self.board_with(BenchWiring::nucleo_g474(), plant, None)
    }

    /// The same with another wiring, and with these bytes at this place in flash.
    pub(crate) fn board_with(&self, wiring: BenchWiring, plant: Plant, flash: Option<(usize, &[u8])>) -> ChipBoard {
        let mut machine = Machine::new(ChipConfig::default(), Bench::new(wiring, plant));
        machine.chip_mut().set_flash_cells(&self.0);
        if let Some((start, bytes)) = flash {
            machine.chip_mut().load_flash(start, bytes);
        }
        machine.power_on();
        ChipBoard { machine, began_us: 0, halted: None }
    }
}

/// A board with the simulated chip.
pub struct ChipBoard {
    machine: Machine<Bench>,
    /// Time of the chip at which the clock of the scenario began, in microseconds; negative where it began before.
    began_us: i64,
    halted: Option<Halt>,
}

impl ChipBoard {
    fn run_until(&mut self, time: Picoseconds) {
        if self.halted.is_none() {
            let halt = self.machine.run_until(time);
            self.halted = (halt != Halt::Reached).then_some(halt);
        }
    }

    /// The time of the chip, in microseconds since it got power.
    pub(crate) fn now_us(&self) -> u64 {
        self.machine.time().0 / Picoseconds::microseconds(1).0
    }

    /// How often the chip was reset.
    pub(crate) fn resets(&self) -> u64 {
        self.machine.resets()
    }

    /// When the first control tick of the running firmware comes, in microseconds since the chip got power; `None` before
    /// its timer runs. To be asked within a tick of the start.
    pub(crate) fn first_tick_us(&mut self) -> Option<u64> {
        let is_set =
            |chip: &mut Self, register, bit: u32| chip.register(register, None).is_some_and(|value| value & bit != 0);
        // The timer has no clock before.
        let runs = is_set(self, RCC_APB1ENR1, TIM7EN) && is_set(self, TIM7_DIER, 1);
        let passed = if runs { self.register(TIM7_CNT, None) } else { None };
        passed.map(|passed| self.now_us() - u64::from(passed) + TICK_US)
    }

    fn register(&mut self, address: u32, value: Option<u32>) -> Option<u32> {
        let cycle = self.machine.cpu().now();
        let chip = self.machine.chip_mut();
        match value {
            Some(value) => chip.write(cycle, address, Access::Word, value).ok().map(|_| value),
            None => chip.read(cycle, address, Access::Word).ok(),
        }
    }
}

impl Board for ChipBoard {
    fn advance(&mut self, to: Microseconds) {
        self.run_until(Picoseconds::microseconds(to.0.saturating_add_signed(self.began_us)));
    }

    fn receive(&mut self, bytes: &[u8]) {
        let frames: Vec<_> = bytes.iter().map(|&byte| Frame { byte, baud: BAUD, fault: LineFault::None }).collect();
        self.machine.chip_mut().send(UartId::LPUART1, &frames);
    }

    fn transmit(&mut self) -> Vec<u8> {
        self.machine.chip_mut().take_sent(UartId::LPUART1).iter().map(|sent| sent.byte).collect()
    }

    /// Masks the interrupt of the tick's timer until so long after its next update.
    fn delay_tick(&mut self, us: u64) {
        let passed = self.register(TIM7_CNT, None).map_or(0, u64::from);
        self.register(TIM7_DIER, Some(0));
        let until = self.machine.time().0 + Picoseconds::microseconds(TICK_US.saturating_sub(passed) + us).0;
        self.run_until(Picoseconds(until));
        self.register(TIM7_DIER, Some(1));
    }

    fn restart(&mut self, _boot: u32, now: Microseconds) {
        self.machine.press_reset();
        self.began_us = (self.machine.time().0 / Picoseconds::microseconds(1).0) as i64 - now.0 as i64;
    }

    fn plant(&self) -> &Plant {
        self.machine.chip().world().plant()
    }

    fn with_plant(&mut self, act: &mut dyn FnMut(&mut Plant)) {
        self.machine.chip_mut().with_world(|bench, _| act(bench.plant_mut()));
    }

    fn delay_us(&self) -> u64 {
        DELAY_US
    }

    fn halted(&self) -> Option<String> {
        self.halted.as_ref().map(ToString::to_string)
    }
}
