//! Busy code: the same bytes on the simulated chip and on QEMU's `mps2-an386`, both of which have code at 0 and RAM at
//! `0x2000_0000`.

use std::io::ErrorKind;
use std::process::Command;

use vergence_mcu::{ChipConfig, FLASH_BASE, Firmware, Halt, Machine, Nothing, Picoseconds};

use crate::error::BenchError;
use crate::{Clock, timed};

/// Equal parts of one run; the fastest one counts, because the others had to share the machine.
pub const PARTS: u64 = 10;
/// A vector table, and a hash over 200 bytes of RAM: a load and a store among ten instructions, and a branch. The number of
/// rounds and the word that semihosting needs at an exit follow.
const HASH: [u16; 22] = [
    0x0000, 0x2001, // stack at 0x2001_0000
    0x0009, 0x0000, // entry at 8
    0x2220, // movs r2, #0x20
    0x0612, // lsls r2, r2, #24
    0x4D08, // ldr r5, rounds
    0x2300, // again: movs r3, #0
    0x5CD1, // next: ldrb r1, [r2, r3]
    0x4048, // eors r0, r1
    0x0144, // lsls r4, r0, #5
    0x1900, // adds r0, r0, r4
    0x09C4, // lsrs r4, r0, #7
    0x4060, // eors r0, r4
    0x54D0, // strb r0, [r2, r3]
    0x3301, // adds r3, #1
    0x2BC8, // cmp r3, #200
    0xD1F5, // bne next
    0x3D01, // subs r5, #1
    0xD1F2, // bne again
    0x2018, // movs r0, #0x18: SYS_EXIT
    0x4902, // ldr r1, exit
];
/// bkpt 0xAB, and a nop for the alignment of the words.
const CALL: [u16; 2] = [0xBEAB, 0xBF00];
/// ADP_Stopped_ApplicationExit (Arm semihosting specification): success.
const EXIT: u32 = 0x2_0026;
/// Instructions of one round.
const ROUND: u64 = 200 * 10 + 3;
/// Rounds that take some tenths of a second.
const ROUNDS_PER_SECOND: u32 = 50_000;
const QEMU: &str = "qemu-system-arm";
const QEMU_RUNS: usize = 3;

/// The hash program.
#[derive(Clone, Copy, Debug)]
pub struct Program {
    rounds: u32,
}

impl Program {
    /// As many rounds as take about `seconds` of the chip's time.
    pub fn for_seconds(seconds: u16) -> Self {
        Self { rounds: ROUNDS_PER_SECOND * u32::from(seconds) }
    }

    fn image(&self) -> Vec<u8> {
        let code = HASH.iter().chain(&CALL).flat_map(|half| half.to_le_bytes());
        code.chain(self.rounds.to_le_bytes()).chain(EXIT.to_le_bytes()).collect()
    }

    fn instructions(&self) -> f64 {
        (u64::from(self.rounds) * ROUND) as f64
    }

    /// Millions of instructions a second on the simulated chip, in the fastest of [`PARTS`].
    ///
    /// # Errors
    /// Where the program does not end as it should.
    pub fn on_the_chip(&self, clock: Clock) -> Result<f64, BenchError> {
        let mut machine = Machine::new(ChipConfig::default(), Nothing);
        let firmware = Firmware::from_image(FLASH_BASE, &self.image());
        machine.load(firmware).map_err(|error| BenchError::Chip(error.to_string()))?;
        // The chip starts at 16 MHz, and a round takes a little more than its instructions.
        let part = Picoseconds::microseconds(u64::from(self.rounds) * ROUND / PARTS / 16);
        let mut best: f64 = 0.0;
        loop {
            let before = machine.cpu().instructions();
            let (halt, seconds) = timed(clock, || machine.run_for(part));
            match halt {
                Halt::Reached => {}
                Halt::Semihosting { .. } => return Ok(best),
                other => return Err(BenchError::Chip(other.to_string())),
            }
            best = best.max((machine.cpu().instructions() - before) as f64 * 1e-6 / seconds);
        }
    }

    /// Millions of instructions a second on QEMU, in the fastest of a few runs, without the time that QEMU takes to start;
    /// `None` where it is not installed.
    ///
    /// # Errors
    /// Where QEMU does not run the program to its end.
    pub fn on_qemu(&self, clock: Clock) -> Result<Option<f64>, BenchError> {
        let mut best: f64 = 0.0;
        for _ in 0..QEMU_RUNS {
            let Some(start) = Self { rounds: 1 }.qemu_seconds(clock)? else { return Ok(None) };
            let Some(whole) = self.qemu_seconds(clock)? else { return Ok(None) };
            best = best.max(self.instructions() * 1e-6 / (whole - start).max(f64::EPSILON));
        }
        Ok(Some(best))
    }

    fn qemu_seconds(&self, clock: Clock) -> Result<Option<f64>, BenchError> {
        let folder = tempfile::tempdir().map_err(BenchError::temporary)?;
        let image = folder.path().join("hash.bin");
        std::fs::write(&image, self.image()).map_err(BenchError::temporary)?;
        let mut qemu = Command::new(QEMU);
        qemu.args(["-M", "mps2-an386", "-display", "none", "-monitor", "none", "-serial", "none"])
            .args(["-semihosting-config", "enable=on,target=native", "-kernel"])
            .arg(&image);
        let (ran, seconds) = timed(clock, || qemu.output());
        match ran {
            Ok(output) if output.status.success() => Ok(Some(seconds)),
            Ok(output) => Err(BenchError::Qemu(String::from_utf8_lossy(&output.stderr).trim().to_owned())),
            Err(error) if error.kind() == ErrorKind::NotFound => Ok(None),
            Err(error) => Err(BenchError::QemuStart(format!("{QEMU}: {error}"))),
        }
    }
}
