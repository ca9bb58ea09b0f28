//! `vergence bench mcu`: how fast the simulated chip runs on this machine.

use std::path::PathBuf;

use serde_json::json;
use vergence_mcu::{ChipConfig, FLASH_BASE, Firmware, Halt, Machine, Nothing, Picoseconds};
use vergence_protocol::{HostSession, MAX_FRAME, Microseconds, Request, SessionId};

use crate::cmd::report::rounded;
use crate::console::Console;
use crate::failure::Failure;
use crate::rig_file;
use crate::sim::{Served, SimulatedChip};
use crate::stopwatch::Stopwatch;

/// Runs a hash over RAM, then the firmware disarmed without a host, then armed with its 1 kHz tick and poses at 100 Hz.
/// Every figure is one of the machine that this runs on.
#[derive(Debug, clap::Args)]
pub struct Args {
    /// The firmware.
    #[arg(
        long,
        value_name = "FIRMWARE",
        default_value = "firmware/nucleo-g474/target/thumbv7em-none-eabihf/release/vergence-nucleo-g474"
    )]
    elf: PathBuf,
    /// Seconds of simulated time for each figure.
    #[arg(long, default_value_t = 5, value_parser = clap::value_parser!(u16).range(1..))]
    seconds: u16,
}

/// Where the stages stand at the start.
const SEED: u64 = 1;
/// A start and a session take less.
const STARTING_US: u64 = 1_000_000;
/// How often the host looks at the wire.
const STEP_US: u64 = 1_000;
const POSE_PERIOD_US: u32 = 10_000;
const BEAT_US: u64 = 100_000;
const LEASE_MS: u16 = 500;

pub fn run(args: &Args, console: Console) -> Result<(), Failure> {
    let busy = busy_mips(u64::from(args.seconds))?;
    let idle = idle(args)?;
    let ready = ready(args)?;
    console.say(format!("busy code: {busy:.0} million instructions a second"))?;
    console.say(format!("firmware, disarmed without a host: {idle:.0} times real time"))?;
    console.say(format!("firmware, armed with poses at 100 Hz: {ready:.0} times real time"))?;
    let [busy, idle, ready] = [busy, idle, ready].map(rounded);
    console.result(&json!({ "busy_mips": busy, "idle_times_real_time": idle, "ready_times_real_time": ready }))
}

/// A vector table, and a hash over RAM that never ends: a load and a store among ten instructions, and a branch.
const HASH: [u16; 18] = [
    0x0000, 0x2001, // stack at 0x2001_0000
    0x0009, 0x0800, // entry at 0x0800_0008
    0x2220, // movs r2, #0x20
    0x0612, // lsls r2, r2, #24
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
    0xE7F3, // b again
];
/// The chip starts at 16 MHz: this takes so many simulated seconds for each one of the others.
const BUSY_SECONDS: u64 = 4;

fn busy_mips(seconds: u64) -> Result<f64, Failure> {
    let image: Vec<u8> = HASH.iter().flat_map(|half| half.to_le_bytes()).collect();
    let mut machine = Machine::new(ChipConfig::default(), Nothing);
    machine.load(Firmware::from_image(FLASH_BASE, &image)).map_err(|error| Failure::check(error.to_string()))?;
    let watch = Stopwatch::start();
    let halt = machine.run_until(Picoseconds::milliseconds(1_000 * BUSY_SECONDS * seconds));
    let took = watch.seconds();
    if halt == Halt::Reached {
        Ok(machine.cpu().instructions() as f64 * 1e-6 / took)
    } else {
        Err(Failure::check(format!("the hash stopped: {halt}")))
    }
}

fn chip(args: &Args) -> Result<SimulatedChip, Failure> {
    SimulatedChip::new(&[&args.elf], &rig_file::load(None)?, SEED)
}

fn idle(args: &Args) -> Result<f64, Failure> {
    let mut chip = chip(args)?;
    chip.run_until(STARTING_US);
    let watch = Stopwatch::start();
    chip.run_until(STARTING_US + 1_000_000 * u64::from(args.seconds));
    let took = watch.seconds();
    chip.settle()?;
    Ok(f64::from(args.seconds) / took)
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
    let watch = Stopwatch::start();
    host.run_until(STARTING_US + 1_000_000 * u64::from(args.seconds))?;
    Ok(f64::from(args.seconds) / watch.seconds())
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
