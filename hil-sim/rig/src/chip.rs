//! The unmodified firmware on the simulated chip, its pins wired to the mechanics.

use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64Mcg;
use vergence_board::Served;
use vergence_control::{BoardSettings, PAGE, settings_store};
use vergence_image::ImageFile;
use vergence_image::layout::{ACTIVE, CAPACITY, IMAGE, SETTINGS};
use vergence_mcu::{
    Bench, BenchWiring, ChipConfig, FLASH_BASE, Firmware, Frame, Halt, LineFault, Machine, Picoseconds, Pin, UartId,
};
use vergence_plant::servo::{AnyMechanism, ServoBus};
use vergence_plant::{Plant, RamFlash, Stage};
use vergence_rig::Rig;

use crate::error::refusal;
use crate::rig::{stage, trunk_of};
use crate::{SimError, Trunk};
use crate::{TrunkMechanics, joint_settings, trunk_servos};

/// The port that the on-board debugger passes on to the host.
const LINK: UartId = UartId::LPUART1;
/// Speed of the line until the firmware has sent something, in bits per second.
const BAUD: u32 = 921_600;
/// Length of the stack pointer and the entry, with which a vector table begins, in bytes.
const ENTRY: usize = 8;

/// A program for the chip.
#[derive(Clone, Copy, Debug)]
pub struct Program<'a> {
    /// Name for messages, such as the file name.
    pub name: &'a str,
    /// An ELF file, or a signed image.
    pub bytes: &'a [u8],
}

/// A board whose processor is simulated too: the unmodified firmware, its pins wired to simulated mechanics.
pub struct SimulatedChip {
    machine: Machine<Bench>,
    wiring: BenchWiring,
    /// The speed of what the board last said.
    baud: u32,
    /// The speed of the host, and the fastest that its adapter makes.
    host_baud: Option<u32>,
    fastest_baud: u32,
    output: Vec<u8>,
    halt: Option<Halt>,
}

impl SimulatedChip {
    /// Powers a board with these programs in flash. Messages use the symbols of the last ELF file. Where no program is at
    /// the start of flash, the last one starts without a boot loader. `seed` decides where the stages stand: at the same
    /// places as those of the native board.
    ///
    /// For a rig with a trunk the servos are on their bus, and the settings flash holds those of a robot with the axes of the
    /// rig file, as after `vergence config set machine robot` and a restart.
    ///
    /// # Errors
    /// [`SimError::Program`] where a program is none for this chip, [`SimError::OtherAxes`] where the rig does not fit the
    /// board.
    pub fn new(programs: &[Program<'_>], rig: &Rig, seed: u64) -> Result<Self, SimError> {
        let axes = rig.axes.len();
        let unknown = || SimError::OtherAxes { rig: rig.name.clone(), axes };
        let (wiring, plant) = match &rig.trunk {
            Some(_) => {
                let servos = trunk_servos(rig, TrunkMechanics::default(), seed)?;
                (BenchWiring::nucleo_g474_robot(), Plant::of_joints(servos))
            }
            None => (BenchWiring::nucleo_g474_of(axes).ok_or_else(unknown)?, plant(rig, seed)),
        };
        let bench = Bench::new(wiring.clone(), plant);
        let mut machine = Machine::new(ChipConfig::default(), bench);
        // Most of an update is waiting for the flash.
        machine.set_skips_waiting(true);
        let mut last = None;
        for program in programs {
            last = load(&mut machine, *program)?;
        }
        if rig.trunk.is_some() {
            machine.chip_mut().load_flash(SETTINGS.start as usize, &robot_settings(rig)?);
        }
        start(&mut machine, last);
        Ok(Self {
            machine,
            wiring,
            baud: BAUD,
            host_baud: None,
            fastest_baud: u32::MAX,
            output: Vec::new(),
            halt: None,
        })
    }

    /// Limits the speeds that the host's adapter can make, in bits per second: at a faster one every byte is garbled.
    pub fn limit_adapter(&mut self, fastest: u32) {
        self.fastest_baud = fastest;
    }

    /// Traces all wired pins from now on.
    pub fn trace(&mut self) {
        let pins: Vec<Pin> = self.wiring.signals().into_iter().map(|(pin, _)| pin).collect();
        self.machine.chip_mut().trace(&pins);
    }

    /// The traced pins as a value change dump (IEEE 1364-2005, section 18).
    #[must_use]
    pub fn trace_dump(&self) -> String {
        let signals = self.wiring.signals();
        let name = |pin: Pin| {
            let signal = signals.iter().find(|(wired, _)| *wired == pin);
            signal.map_or_else(|| pin.to_string(), |(_, name)| format!("{name}_{pin}"))
        };
        self.machine.chip().vcd(name)
    }

    /// The chip with its mechanics.
    pub fn machine(&mut self) -> &mut Machine<Bench> {
        &mut self.machine
    }

    /// The mechanics.
    #[must_use]
    pub fn plant(&self) -> &Plant {
        self.machine.chip().world().plant()
    }

    /// The trunk of a robot, as it stands.
    #[must_use]
    pub fn trunk(&self) -> Option<&Trunk> {
        trunk_of(self.plant())
    }

    /// Does something to a robot's servos: their supply, faults, motors, and what they move.
    pub fn with_servos<R>(&mut self, act: impl FnOnce(&mut ServoBus<AnyMechanism>) -> R) -> R {
        let chip = self.machine.chip_mut();
        chip.with_world(|bench, _| act(bench.plant_mut().joints_mut().servos_mut()))
    }

    /// A robot's servos with what they move.
    #[must_use]
    pub fn servos(&self) -> &ServoBus<AnyMechanism> {
        self.plant().joints().servos()
    }

    /// Presses or releases the emergency stop.
    pub fn press_emergency_stop(&mut self, pressed: bool) {
        let chip = self.machine.chip_mut();
        chip.with_world(|bench, _| bench.plant_mut().press_emergency_stop(pressed));
    }

    /// Cuts the power of the board for an instant: it starts again with what is in its flash. Time goes on, as do the mechanics.
    pub fn restart(&mut self) {
        self.machine.power_on();
        self.baud = BAUD;
        self.halt = None;
    }

    /// Runs until `us` microseconds after power-on, unless the processor has stopped.
    pub fn run_until(&mut self, us: u64) {
        if self.halt.is_some() {
            return;
        }
        let halt = self.machine.run_until(Picoseconds::microseconds(us));
        self.halt = (halt != Halt::Reached).then_some(halt);
        for sent in self.machine.chip_mut().take_sent(LINK) {
            self.baud = sent.baud;
            self.output.push(if self.is_clear(sent.baud) { sent.byte } else { sent.byte ^ 0x5A });
        }
    }

    /// Whether the host reads bytes of this speed as they are.
    fn is_clear(&self, baud: u32) -> bool {
        let host = self.host_baud.unwrap_or(baud);
        host <= self.fastest_baud && host.abs_diff(baud) < host / 25
    }

    /// Begins to send bytes to the board: at the speed of the host, or at the board's own where the host has none.
    pub fn send(&mut self, bytes: &[u8]) {
        let baud = self.host_baud.unwrap_or(self.baud);
        let garble = if baud > self.fastest_baud { 0x5A } else { 0 };
        let frame = |&byte: &u8| Frame { byte: byte ^ garble, baud, fault: LineFault::None };
        let frames: Vec<Frame> = bytes.iter().map(frame).collect();
        self.machine.chip_mut().send(LINK, &frames);
    }
}

impl Served for SimulatedChip {
    type Error = SimError;

    fn run_until(&mut self, elapsed_us: u64) {
        self.run_until(elapsed_us);
    }

    fn hear_at(&mut self, baud: u32) {
        self.host_baud = Some(baud);
    }

    fn receive(&mut self, bytes: &[u8]) {
        self.send(bytes);
    }

    fn take_output(&mut self) -> Vec<u8> {
        std::mem::take(&mut self.output)
    }

    fn settle(&mut self) -> Result<(), SimError> {
        match &self.halt {
            Some(halt) => Err(SimError::Stopped(halt.to_string())),
            None => Ok(()),
        }
    }
}

/// The mechanics, at the same places as those of the native board for the same seed.
fn plant(rig: &Rig, seed: u64) -> Plant {
    let stages: Vec<Stage> = rig.axes.iter().map(stage).collect();
    let mut random = Pcg64Mcg::seed_from_u64(seed);
    let place = |stage: &Stage| {
        let [min, max] = [stage.settings.min, stage.settings.max].map(|end| f64::from(end.0));
        min + random.random::<f64>() * (max - min)
    };
    let positions: Vec<f64> = stages.iter().map(place).collect();
    let mechanics: Vec<_> = stages.iter().map(|stage| stage.mechanics).collect();
    Plant::new(&mechanics, &positions)
}

/// The pages of the settings flash of a robot with the axes of the rig file, as after `vergence config set machine robot`.
///
/// # Errors
/// [`SimError::Axes`] where no servo fits an axis.
pub fn robot_settings(rig: &Rig) -> Result<Vec<u8>, SimError> {
    let refused = |error| SimError::Axes { rig: rig.name.clone(), why: refusal(error, rig) };
    let settings = BoardSettings::new(&joint_settings(rig)?).map_err(refused)?;
    let mut flash = RamFlash::new(SETTINGS.length as usize / PAGE);
    settings_store::save(&mut flash, &settings).map_err(|_| SimError::NotFlash)?;
    Ok(flash.bytes().to_vec())
}

/// Puts a program into flash; returns the offset at which it begins.
fn load(machine: &mut Machine<Bench>, Program { name, bytes }: Program<'_>) -> Result<Option<usize>, SimError> {
    let fail = |why: String| SimError::Program { name: name.to_owned(), why };
    if let Ok(ImageFile { seal, image }) = ImageFile::read(bytes) {
        let start = IMAGE.start as usize;
        let chip = machine.chip_mut();
        let fits = image.len() <= CAPACITY as usize
            && chip.load_flash(start, image)
            && chip.load_flash(ACTIVE.start as usize, &seal.to_bytes());
        return if fits { Ok(Some(start)) } else { Err(fail("this image does not fit into flash".into())) };
    }
    let firmware = Firmware::from_elf(bytes).map_err(|error| fail(error.to_string()))?;
    let first = firmware.segments().map(|(address, _)| address).min();
    machine.load(firmware).map_err(|error| fail(error.to_string()))?;
    Ok(first.map(|address| (address - FLASH_BASE) as usize))
}

/// Powers the chip, which reads its first vectors at the start of flash. Where that is erased, those of `program` are
/// copied there.
fn start(machine: &mut Machine<Bench>, program: Option<usize>) {
    let erased = machine.chip().flash().iter().take(ENTRY).all(|&byte| byte == 0xFF);
    if let Some(start) = program.filter(|_| erased) {
        let entry = machine.chip().flash().get(start..start + ENTRY).unwrap_or_default().to_vec();
        machine.chip_mut().load_flash(0, &entry);
    }
    machine.power_on();
}
