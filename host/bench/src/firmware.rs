//! How many times faster than real time the firmware runs on the simulated chip.

use vergence_board::Served;
use vergence_protocol::{HostSession, MAX_FRAME, Microseconds, Request, SessionId};
use vergence_sim::SimulatedChip;

use crate::busy::PARTS;
use crate::error::BenchError;
use crate::{Clock, timed};

/// More than a start and the opening of a session take.
const STARTING_US: u64 = 1_000_000;
/// Period at which the host reads the wire.
const STEP_US: u64 = 1_000;
const POSE_PERIOD_US: u32 = 10_000;
const BEAT_US: u64 = 100_000;
const LEASE_MS: u16 = 500;

/// Simulated seconds in one real second of `chip`, just powered, that is disarmed and without a host: the fastest of ten
/// parts of `seconds`.
///
/// # Errors
/// [`BenchError::Sim`] where the processor stops.
pub fn without_host(mut chip: SimulatedChip, seconds: u16, clock: Clock) -> Result<f64, BenchError> {
    chip.run_until(STARTING_US);
    fastest(seconds, clock, |us| {
        chip.run_until(us);
        Ok(chip.settle()?)
    })
}

/// The same of a chip that is armed with its 1 kHz tick, with poses at 100 Hz.
///
/// # Errors
/// [`BenchError::Sim`] where the processor stops, [`BenchError::Work`] where the firmware does not arm.
pub fn armed(chip: SimulatedChip, seconds: u16, clock: Clock) -> Result<f64, BenchError> {
    let mut host = Host { chip, session: HostSession::new(SessionId(1)), now: 0 };
    host.session.hello();
    host.run_until(STARTING_US / 2)?;
    host.submit(Request::SetStream { period_us: POSE_PERIOD_US })?;
    host.submit(Request::Arm { session: SessionId(1) })?;
    host.run_until(STARTING_US)?;
    if !host.chip.machine().chip().world().plant().drivers_on() {
        return Err(BenchError::Work("the firmware did not arm".into()));
    }
    fastest(seconds, clock, |us| host.run_until(us))
}

/// The fastest part: simulated seconds in one real second. `run_until` runs up to so many microseconds.
fn fastest(
    seconds: u16,
    clock: Clock,
    mut run_until: impl FnMut(u64) -> Result<(), BenchError>,
) -> Result<f64, BenchError> {
    let part = 1_000_000 * u64::from(seconds) / PARTS;
    let mut best: f64 = 0.0;
    for index in 1..=PARTS {
        let (ran, taken) = timed(clock, || run_until(STARTING_US + index * part));
        ran?;
        best = best.max(part as f64 * 1e-6 / taken);
    }
    Ok(best)
}

/// A host in simulated time.
struct Host {
    chip: SimulatedChip,
    session: HostSession,
    now: u64,
}

impl Host {
    fn submit(&mut self, request: Request) -> Result<(), BenchError> {
        let taken = self.session.submit(Microseconds(self.now), request);
        taken.map(|_| ()).map_err(|error| BenchError::Work(format!("the firmware does not answer: {error}")))
    }

    fn run_until(&mut self, us: u64) -> Result<(), BenchError> {
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
