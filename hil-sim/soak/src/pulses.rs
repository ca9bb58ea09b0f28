//! The pulses of the camera trigger, as the true mechanics saw them, beside what the board reports of them.

use std::collections::VecDeque;

use vergence_plant::Plant;
use vergence_protocol::Microseconds;

use crate::board_clock::BoardClock;

/// Longest time in microseconds from a pulse to the look that shows it: at rest the mechanics of the simulated chip go on
/// by a millisecond, and each millisecond is looked at.
pub const LOOK_US: u64 = 2_000;
/// Time after which the report of a pulse is not awaited any more, in microseconds.
const FORGOTTEN_US: u64 = 1_000_000;

/// A pulse that fired the cameras.
#[derive(Clone, Debug)]
struct Pulse {
    /// True time at which it was seen, at most [`LOOK_US`] after it came.
    seen_at: u64,
    /// True positions of the loads at the pulse, in micro-units.
    loads: Vec<f64>,
}

/// The latest pulses.
#[derive(Debug, Default)]
pub struct Pulses {
    /// The plant's time of the latest pulse.
    latest: Option<Microseconds>,
    pulses: VecDeque<Pulse>,
}

impl Pulses {
    /// Looks for a new pulse.
    pub fn watch(&mut self, now: Microseconds, plant: &Plant) {
        let exposed = plant.exposed();
        let at = exposed.map(|(at, _)| at);
        if at != std::mem::replace(&mut self.latest, at)
            && let Some((_, loads)) = exposed
        {
            self.pulses.push_back(Pulse { seen_at: now.0, loads: loads.to_vec() });
            self.pulses.retain(|pulse| now.0 - pulse.seen_at < FORGOTTEN_US);
        }
    }

    /// Forgets the pulses before a restart of the board.
    pub fn forget(&mut self) {
        self.pulses.clear();
    }

    /// Compares a report of a pulse at the board's time `at` with the pulses: returns the true positions of the loads at
    /// this pulse where only one fits.
    ///
    /// # Errors
    /// The contradiction where there was no such pulse.
    pub fn loads_at(&self, at: u64, clock: &mut BoardClock) -> Result<Option<&[f64]>, String> {
        let [least, most] = clock.when(at);
        let fits = |pulse: &&Pulse| pulse.seen_at as i64 >= least && pulse.seen_at as i64 <= most + LOOK_US as i64;
        let mut fitting = self.pulses.iter().filter(fits);
        match (fitting.next(), fitting.next()) {
            (None, _) => Err(format!("a pulse at {at} that the cameras did not see")),
            (Some(pulse), None) => {
                clock.note(at, pulse.seen_at.saturating_sub(LOOK_US), pulse.seen_at).map_or(Ok(Some(&pulse.loads)), Err)
            }
            (Some(_), Some(_)) => Ok(None),
        }
    }
}
