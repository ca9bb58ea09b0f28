//! `vergence bench mcu`: how fast the simulated chip runs on this machine.

use std::path::PathBuf;

use serde_json::json;
use vergence_bench::busy::{PARTS, Program};
use vergence_protocol::{HostSession, MAX_FRAME, Microseconds, Request, SessionId};
use vergence_rig::rounded;

use crate::console::Console;
use crate::failure::Failure;
use crate::firmware::APPLICATION;
use crate::rig_file;
use crate::sim::{Served, SimulatedChip, simulated_chip};
use crate::stopwatch::{Stopwatch, clock};

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
/// More than a start and the opening of a session take.
const STARTING_US: u64 = 1_000_000;
/// Period at which the host reads the wire.
const STEP_US: u64 = 1_000;
const POSE_PERIOD_US: u32 = 10_000;
const BEAT_US: u64 = 100_000;
const LEASE_MS: u16 = 500;

pub fn run(args: &Args, console: Console) -> Result<(), Failure> {
    let program = Program::for_seconds(args.seconds);
    let busy = program.on_the_chip(clock)?;
    let qemu = program.on_qemu(clock)?;
    let idle = idle(args)?;
    let ready = ready(args)?;
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

fn idle(args: &Args) -> Result<f64, Failure> {
    let mut chip = chip(args)?;
    chip.run_until(STARTING_US);
    fastest(args, |us| {
        chip.run_until(us);
        Ok(chip.settle()?)
    })
}

/// The fastest part: simulated seconds in one real second. `run_until` runs up to so many microseconds.
fn fastest(args: &Args, mut run_until: impl FnMut(u64) -> Result<(), Failure>) -> Result<f64, Failure> {
    let part = 1_000_000 * u64::from(args.seconds) / PARTS;
    let mut best: f64 = 0.0;
    for index in 1..=PARTS {
        let watch = Stopwatch::start();
        run_until(STARTING_US + index * part)?;
        best = best.max(part as f64 * 1e-6 / watch.seconds());
    }
    Ok(best)
}

fn ready(args: &Args) -> Result<f64, Failure> {
    let mut host = Host { chip: chip(args)?, session: HostSession::new(SessionId(1)), now: 0 };
    host.session.hello();
    host.run_until(STARTING_US / 2)?;
    host.submit(Request::SetStream { period_us: POSE_PERIOD_US })?;
    host.submit(Request::Arm { session: SessionId(1) })?;
    host.run_until(STARTING_US)?;
    if !host.chip.machine().chip().world().plant().drivers_on() {
        return Err(Failure::check("the firmware did not arm"));
    }
    fastest(args, |us| host.run_until(us))
}

/// A host in simulated time.
struct Host {
    chip: SimulatedChip,
    session: HostSession,
    now: u64,
}

impl Host {
    fn submit(&mut self, request: Request) -> Result<(), Failure> {
        let taken = self.session.submit(Microseconds(self.now), request);
        taken.map(|_| ()).map_err(|error| Failure::check(format!("the firmware does not answer: {error}")))
    }

    fn run_until(&mut self, us: u64) -> Result<(), Failure> {
        while self.now < us {
            self.now += STEP_US;
            self.chip.run_until(self.now);
            self.chip.settle()?;
            let now = Microseconds(self.now);
            self.session.receive(now, &self.chip.take_output(), |_| {});
            if self.session.is_open() && self.now.is_multiple_of(BEAT_US) {
                // The line takes one in 100 ms.
                let _ = self.session.send_now(Request::Heartbeat { session: SessionId(1), lease_ms: LEASE_MS });
            }
            let mut frame = [0; MAX_FRAME];
            while let Some(length) = self.session.transmit(now, &mut frame) {
                self.chip.send(frame.get(..length).unwrap_or_default());
            }
        }
        Ok(())
    }
}
