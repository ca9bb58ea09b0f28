//! `vergence bench mcu`: how fast the simulated chip runs on this machine.

use std::path::PathBuf;

use serde_json::json;
use vergence_bench::busy::Program;
use vergence_bench::firmware::{armed, without_host};
use vergence_rig::rounded;

use crate::console::Console;
use crate::failure::Failure;
use crate::firmware::APPLICATION;
use crate::rig_file;
use crate::sim::{SimulatedChip, simulated_chip};
use crate::stopwatch::clock;

/// Runs a hash over RAM (on QEMU too, where qemu-system-arm is installed), then the firmware disarmed without a host, then
/// armed with its 1 kHz tick and poses at 100 Hz.
///
/// The figures depend on this machine. Each run is timed in ten parts and the fastest counts: the others had to share the
/// machine.
#[derive(Debug, clap::Args)]
pub struct Args {
    /// The firmware.
    #[arg(long, value_name = "FIRMWARE", default_value = APPLICATION)]
    elf: PathBuf,
    /// Seconds of simulated time for each figure.
    #[arg(long, default_value_t = 5, value_parser = clap::value_parser!(u16).range(1..))]
    seconds: u16,
}

/// Where the stages stand at the start.
const SEED: u64 = 1;

pub fn run(args: &Args, console: Console) -> Result<(), Failure> {
    let program = Program::for_seconds(args.seconds);
    let busy = program.on_the_chip(clock)?;
    let qemu = program.on_qemu(clock)?;
    let idle = without_host(chip(args)?, args.seconds, clock)?;
    let ready = armed(chip(args)?, args.seconds, clock)?;
    console.say(format!("busy code: {busy:.0} million instructions a second"))?;
    match qemu {
        Some(qemu) => console.say(format!("the same on QEMU: {qemu:.0} million instructions a second"))?,
        None => console.say("QEMU is not there to compare with: install qemu-system-arm")?,
    }
    console.say(format!("firmware, disarmed without a host: {idle:.0} times real time"))?;
    console.say(format!("firmware, armed with poses at 100 Hz: {ready:.0} times real time"))?;
    let [busy, idle, ready] = [busy, idle, ready].map(rounded);
    console.result(&json!({
        "busy_mips": busy,
        "qemu_busy_mips": qemu.map(rounded),
        "idle_times_real_time": idle,
        "ready_times_real_time": ready,
    }))
}

fn chip(args: &Args) -> Result<SimulatedChip, Failure> {
    simulated_chip(&[&args.elf], &rig_file::load(None)?, SEED)
}
