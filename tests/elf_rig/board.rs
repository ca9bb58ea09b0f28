//! Two kinds of board, driven in the same way.

use std::sync::OnceLock;

use vergence_cpu::{Access, Bus};
use vergence_image::layout::{ACTIVE, STACK};
use vergence_mcu::{Bench, BenchWiring, ChipConfig, Firmware, Frame, Halt, LineFault, Machine, Picoseconds, UartId};
use vergence_plant::{AxisMechanics, NativeBoard, Plant, bench_mechanics, bench_settings};
use vergence_protocol::Microseconds;

use super::build::build;
use super::conversation::{Conversation, Wired};
use super::program::sealed;

/// Registers of the timer whose interrupt is the control tick (RM0440, 31.4): its interrupt enable and its microseconds.
const TIM7_DIER: u32 = 0x4000_140C;
const TIM7_CNT: u32 = 0x4000_1424;
/// What an unused word of the stack holds.
const PAINT: u32 = 0xA5A5_5A5A;
/// The speed of the line from the factory.
const BAUD: u32 = 921_600;

/// The mechanics, and where they stand when the board gets power, in micro-units.
pub struct Standing {
    pub mechanics: [AxisMechanics; 2],
    pub at: [f64; 2],
}

impl Default for Standing {
    /// Near home, so that homing does not take long.
    fn default() -> Self {
        Self { mechanics: bench_mechanics(), at: [63_000.0, 40_000.0] }
    }
}

/// A board that a conversation can begin with.
pub trait Board: Wired {
    /// Gets power.
    fn switched_on(standing: &Standing) -> Self;
    /// Does something to the mechanics.
    fn with_plant(&mut self, act: impl FnOnce(&mut Plant));
}

impl<B: Board> Conversation<B> {
    /// A board that has just got power, and a host that has not spoken yet.
    pub fn off(standing: &Standing) -> Self {
        Self::with_board(B::switched_on(standing), Microseconds(0))
    }

    /// A session with telemetry, disarmed.
    pub fn open(standing: &Standing) -> Self {
        let mut talk = Self::off(standing);
        talk.connect();
        talk
    }

    /// Armed and homed.
    pub fn homed(standing: &Standing) -> Self {
        let mut talk = Self::open(standing);
        talk.arm_and_home();
        talk
    }
}

/// Boot loader and application on the simulated chip.
pub struct ElfBoard {
    pub machine: Machine<Bench>,
    /// The speed at which the host speaks and listens.
    pub baud: u32,
    /// The speed of what the board last said.
    pub heard_baud: u32,
}

/// The application and the boot loader, built once.
pub fn programs() -> &'static [Firmware; 2] {
    static READ: OnceLock<[Firmware; 2]> = OnceLock::new();
    READ.get_or_init(|| {
        ["vergence-nucleo-g474", "vergence-bootloader"].map(|package| {
            let bytes = std::fs::read(build(package)).expect("cargo says where the ELF is");
            Firmware::from_elf(&bytes).expect("the ELF is for this chip")
        })
    })
}

impl ElfBoard {
    /// Microseconds since the running control tick was due.
    pub fn tick_passed_us(&mut self) -> u64 {
        self.register(TIM7_CNT, None).into()
    }

    /// Masks the interrupt of the tick's timer until so long after its next update.
    pub fn delay_tick(&mut self, us: u64) {
        let passed = self.tick_passed_us();
        self.register(TIM7_DIER, Some(0));
        self.machine.run_for(Picoseconds::microseconds(1_000 - passed + us));
        self.register(TIM7_DIER, Some(1));
    }

    /// Fills the stack with a pattern: to be called before the board starts.
    pub fn paint_stack(&mut self) {
        for address in (STACK.start..STACK.end()).step_by(4) {
            self.register(address, Some(PAINT));
        }
    }

    /// Bytes of the stack that nothing has written since it was painted.
    pub fn stack_spare(&mut self) -> u32 {
        let written = (STACK.start..STACK.end()).step_by(4).find(|&address| self.register(address, None) != PAINT);
        written.unwrap_or(STACK.end()) - STACK.start
    }

    fn register(&mut self, address: u32, value: Option<u32>) -> u32 {
        let cycle = self.machine.cpu().now();
        let chip = self.machine.chip_mut();
        match value {
            Some(value) => chip.write(cycle, address, Access::Word, value).map(|_| 0).expect("it is there"),
            None => chip.read(cycle, address, Access::Word).expect("it is there"),
        }
    }
}

impl ElfBoard {
    /// With these mechanics on its pins, before it gets power.
    pub fn with_bench(bench: Bench) -> Self {
        let [application, boot_loader] = programs();
        let mut machine = Machine::new(ChipConfig::default(), bench);
        machine.load(boot_loader.clone()).expect("it fits");
        let (_, seal) = sealed(application);
        assert!(machine.chip_mut().load_flash(ACTIVE.start as usize, &seal.to_bytes()));
        // Last, for the symbols.
        machine.load(application.clone()).expect("it fits");
        Self { machine, baud: BAUD, heard_baud: BAUD }
    }
}

impl Board for ElfBoard {
    fn switched_on(standing: &Standing) -> Self {
        let plant = Plant::new(&standing.mechanics, &standing.at);
        Self::with_bench(Bench::new(BenchWiring::nucleo_g474(), plant))
    }

    fn with_plant(&mut self, act: impl FnOnce(&mut Plant)) {
        self.machine.chip_mut().with_world(|bench, _| act(bench.plant_mut()));
    }
}

impl Wired for ElfBoard {
    fn advance(&mut self, to: Microseconds) {
        let halt = self.machine.run_until(Picoseconds::microseconds(to.0));
        assert!(halt == Halt::Reached, "{halt}");
    }

    fn receive(&mut self, bytes: &[u8]) {
        let frames: Vec<_> =
            bytes.iter().map(|&byte| Frame { byte, baud: self.baud, fault: LineFault::None }).collect();
        self.machine.chip_mut().send(UartId::LPUART1, &frames);
    }

    fn transmit(&mut self) -> Vec<u8> {
        let sent = self.machine.chip_mut().take_sent(UartId::LPUART1);
        self.heard_baud = sent.last().map_or(self.heard_baud, |last| last.baud);
        // At another speed than the host's each byte is another one.
        let is_clear = |baud: u32| baud.abs_diff(self.baud) < self.baud / 25;
        sent.iter().map(|sent| if is_clear(sent.baud) { sent.byte } else { sent.byte ^ 0x5A }).collect()
    }

    fn plant(&self) -> &Plant {
        self.machine.chip().world().plant()
    }
}

impl Board for NativeBoard {
    fn switched_on(standing: &Standing) -> Self {
        Self::standing_at(&bench_settings(), &standing.mechanics, &standing.at, 1).expect("the bench works")
    }

    fn with_plant(&mut self, act: impl FnOnce(&mut Plant)) {
        act(self.plant_mut());
    }
}
