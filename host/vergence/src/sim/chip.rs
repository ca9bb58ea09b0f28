//! The unmodified firmware on the simulated chip, its pins wired to the mechanics.

use std::path::Path;

use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64Mcg;
use vergence_image::ImageFile;
use vergence_image::layout::{ACTIVE, CAPACITY};
use vergence_mcu::{
    Bench, BenchWiring, ChipConfig, FLASH_BASE, Firmware, Frame, Halt, LineFault, Machine, Picoseconds, Pin, UartId,
};
use vergence_plant::{Plant, Stage};
use vergence_rig::Rig;

use super::pace::Pace;
use super::rig::stage;
use super::served::Served;
use crate::failure::Failure;
use crate::output::write_whole;

/// The port that the board's debugger passes on to the host.
const LINK: UartId = UartId::LPUART1;
/// The speed of the line until the firmware has sent something.
const BAUD: u32 = 921_600;
/// A vector table begins with the stack pointer and the entry.
const ENTRY: usize = 8;

/// A board whose processor is simulated too.
pub struct SimulatedChip {
    machine: Machine<Bench>,
    wiring: BenchWiring,
    pace: Pace,
    baud: u32,
    output: Vec<u8>,
    halt: Option<Halt>,
}

impl SimulatedChip {
    /// Gives power to a board with these programs in flash, each an ELF file or a signed image; symbols in messages are
    /// those of the last ELF file. Where no program is at the start of flash, the last one starts without boot loader.
    /// `seed` decides where the stages stand.
    ///
    /// # Errors
    /// A file that is no program for this chip, or a rig with other axes than the board drives.
    pub fn new(programs: &[impl AsRef<Path>], rig: &Rig, seed: u64) -> Result<Self, Failure> {
        let wiring = BenchWiring::nucleo_g474();
        if rig.axes.len() != wiring.axes.len() {
            return Err(Failure::usage(format!("rig '{}' has other axes than the board drives", rig.name)));
        }
        let bench = Bench::new(wiring.clone(), plant(rig, seed));
        let mut machine = Machine::new(ChipConfig::default(), bench);
        // Swaps and updates wait for the flash most of their time.
        machine.set_skips_waiting(true);
        let mut last = None;
        for path in programs {
            last = load(&mut machine, path.as_ref())?;
        }
        start(&mut machine, last);
        Ok(Self { machine, wiring, pace: Pace::begin(), baud: BAUD, output: Vec::new(), halt: None })
    }

    /// Traces all pins that are wired, from now on.
    pub fn trace(&mut self) {
        let pins: Vec<Pin> = self.wiring.signals().into_iter().map(|(pin, _)| pin).collect();
        self.machine.chip_mut().trace(&pins);
    }

    /// Writes what was traced as a value change dump.
    ///
    /// # Errors
    /// Where the file cannot be written.
    pub fn write_trace(&self, path: &Path) -> Result<(), Failure> {
        let signals = self.wiring.signals();
        let name = |pin: Pin| {
            let signal = signals.iter().find(|(wired, _)| *wired == pin);
            signal.map_or_else(|| pin.to_string(), |(_, name)| format!("{name}_{pin}"))
        };
        write_whole(path, self.machine.chip().vcd(name).as_bytes())
    }

    /// The board.
    pub fn machine(&mut self) -> &mut Machine<Bench> {
        &mut self.machine
    }

    /// Runs until `us` microseconds after power-on, unless the machine has stopped.
    pub fn run_until(&mut self, us: u64) {
        if self.halt.is_some() {
            return;
        }
        let halt = self.machine.run_until(Picoseconds::microseconds(us));
        self.halt = (halt != Halt::Reached).then_some(halt);
        for sent in self.machine.chip_mut().take_sent(LINK) {
            self.baud = sent.baud;
            self.output.push(sent.byte);
        }
    }

    /// Bytes begin to arrive, at the board's own speed, as a debugger's port would send them.
    pub fn send(&mut self, bytes: &[u8]) {
        let frame = |&byte| Frame { byte, baud: self.baud, fault: LineFault::None };
        let frames: Vec<Frame> = bytes.iter().map(frame).collect();
        self.machine.chip_mut().send(LINK, &frames);
    }
}

impl Served for SimulatedChip {
    fn run_to_now(&mut self) {
        let now = self.pace.elapsed_us();
        self.run_until(now);
    }

    fn receive(&mut self, bytes: &[u8]) {
        self.run_to_now();
        self.send(bytes);
    }

    fn take_output(&mut self) -> Vec<u8> {
        std::mem::take(&mut self.output)
    }

    fn settle(&mut self) -> Result<(), Failure> {
        match &self.halt {
            Some(halt) => Err(Failure::check(format!("the simulated board stopped: {halt}"))),
            None => Ok(()),
        }
    }
}

/// The same places for the same seed as those of the native board.
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

/// Puts a program into flash; returns the offset at which it begins.
fn load(machine: &mut Machine<Bench>, path: &Path) -> Result<Option<usize>, Failure> {
    let bytes = std::fs::read(path)
        .map_err(|error| Failure::input(path, format!("{error}; docs/firmware.md says how the firmware is built")))?;
    if let Ok(ImageFile { seal, image }) = ImageFile::read(&bytes) {
        let start = ACTIVE.start as usize;
        let chip = machine.chip_mut();
        let fits = image.len() <= CAPACITY as usize
            && chip.load_flash(start, image)
            && chip.load_flash(start + CAPACITY as usize, &seal.to_bytes());
        return if fits { Ok(Some(start)) } else { Err(Failure::input(path, "this image does not fit into flash")) };
    }
    let firmware = Firmware::from_elf(&bytes).map_err(|error| Failure::input(path, error))?;
    let first = firmware.segments().map(|(address, _)| address).min();
    machine.load(firmware).map_err(|error| Failure::input(path, error))?;
    Ok(first.map(|address| (address - FLASH_BASE) as usize))
}

/// The chip looks for its first vectors at the start of flash: where nothing is there, it finds those of the program.
fn start(machine: &mut Machine<Bench>, program: Option<usize>) {
    let erased = machine.chip().flash().iter().take(ENTRY).all(|&byte| byte == 0xFF);
    if let Some(start) = program.filter(|_| erased) {
        let entry = machine.chip().flash().get(start..start + ENTRY).unwrap_or_default().to_vec();
        machine.chip_mut().load_flash(0, &entry);
    }
    machine.power_on();
}
