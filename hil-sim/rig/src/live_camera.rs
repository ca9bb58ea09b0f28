//! A simulated camera that runs beside a board: the trigger fires it, it exposes row after row where the rig file says so,
//! and it may be unplugged for a while. Its images are rendered when they are wanted, from the true positions of the
//! mechanics. Motion within one row's exposure does not blur.

use std::sync::{Arc, OnceLock};
use std::time::Duration;

use vergence_camera::{CameraEvent, Develop, PendingImage};
use vergence_protocol::Microseconds;
use vergence_rig::{ExposureTiming, Shutter, StampedAt};
use vergence_scene::{Lens, RayTable, TrueLens};
use vergence_vision::Side;

use crate::{Pulse, RoomCamera, SimulatedRig, Unplugged};

/// Exposure time of one row.
const EXPOSURE: Duration = Duration::from_millis(4);
/// Time from the end of the last row's exposure until the image is in memory.
const TRANSFER: Duration = Duration::from_millis(6);
/// Time from one image to the next: the camera takes no more than 30 a second.
const PERIOD: Duration = Duration::from_micros(33_333);

/// How the images of a simulated camera are made.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Rendering {
    /// With many rays, for figures of accuracy.
    #[default]
    Exact,
    /// In real time, with one ray for most pixels.
    Quick,
}

/// A simulated camera fired by the board's trigger.
#[derive(Clone, Debug)]
pub struct LiveCamera {
    camera: RoomCamera<TrueLens>,
    rendering: Rendering,
    /// Made with the first quick image, and shared by all.
    table: Arc<OnceLock<RayTable>>,
    shutter: Shutter,
    unplugged: Vec<Unplugged>,
    plugged: Option<bool>,
    /// Time from a trigger pulse to the start of the exposure.
    reaction: Duration,
    next_pulse: u32,
    /// Board time in microseconds before which the camera takes no other image.
    ready_us: f64,
    seq: u32,
}

impl LiveCamera {
    /// How often [`Self::poll`] must be called for the times of images to be as exact as [`Self::timing`] says.
    pub const POLL_PERIOD: Duration = Duration::from_millis(1);

    /// The `camera` with this shutter, unplugged as listed; entries of the other side are ignored.
    #[must_use]
    pub fn new<L: Lens + Into<TrueLens>>(camera: RoomCamera<L>, shutter: Shutter, unplugged: &[Unplugged]) -> Self {
        let RoomCamera { side, lens, room, seed } = camera;
        let camera = RoomCamera { side, lens: lens.into(), room, seed };
        let unplugged = unplugged.iter().filter(|out| out.side == camera.side).copied().collect();
        Self {
            camera,
            rendering: Rendering::Exact,
            table: Arc::default(),
            shutter,
            unplugged,
            plugged: None,
            reaction: Duration::ZERO,
            next_pulse: 0,
            ready_us: 0.0,
            seq: 0,
        }
    }

    /// The same camera with images made in this way.
    #[must_use]
    pub fn with_rendering(self, rendering: Rendering) -> Self {
        Self { rendering, ..self }
    }

    /// The same camera, which begins to expose so long after a pulse; without it at once.
    #[must_use]
    pub fn reacting_after(self, reaction: Duration) -> Self {
        Self { reaction, ..self }
    }

    /// Side of the camera.
    #[must_use]
    pub const fn side(&self) -> Side {
        self.camera.side
    }

    /// Timing of its exposures.
    #[must_use]
    pub fn timing(&self) -> ExposureTiming {
        ExposureTiming {
            period: PERIOD,
            exposure: Some(EXPOSURE),
            rolling: self.shutter.span(self.camera.lens.size().height),
            readout: TRANSFER + 3 * Self::POLL_PERIOD,
        }
    }

    /// Everything that has happened to the camera since the last call. `rig` has been run to now; `age` is the time since
    /// the camera's first poll, `now` the time on the host's clock, with which it stamps its images.
    pub fn poll(&mut self, rig: &SimulatedRig, age: Duration, now: Microseconds) -> Vec<CameraEvent> {
        let mut events = Vec::new();
        let timing = self.timing();
        let plugged = !self.unplugged.iter().any(|out| (out.from..out.until).contains(&age));
        if self.plugged.replace(plugged) != Some(plugged) {
            events.push(match plugged {
                true => CameraEvent::Attached(timing),
                false => CameraEvent::Lost("the simulated camera is unplugged".into()),
            });
        }
        // Images that are in memory by now.
        let takes = (self.reaction + EXPOSURE + timing.rolling + TRANSFER).as_micros() as u64;
        for pulse in rig.pulses_from(self.next_pulse).filter(|pulse| pulse.at.0 + takes <= rig.now().0) {
            self.next_pulse = pulse.number + 1;
            // A pulse that comes while the last image is taken is missed.
            if !plugged || (pulse.at.0 as f64) < self.ready_us {
                continue;
            }
            self.ready_us = pulse.at.0 as f64 + micros(PERIOD);
            let middle = timing.middle(Duration::from_micros(now.0), StampedAt::End).on_host();
            let develop = self.develop(rig, &pulse, &timing);
            events.push(CameraEvent::Image(PendingImage { seq: self.seq, middle, bytes: None, develop }));
            self.seq += 1;
        }
        events
    }

    /// Renders the image of a pulse when it is wanted, with the motion of the rig as it is remembered now.
    fn develop(&self, rig: &SimulatedRig, pulse: &Pulse, timing: &ExposureTiming) -> Develop {
        let start = pulse.at.0 as f64 + micros(self.reaction);
        let exposed_us = micros(EXPOSURE + timing.rolling);
        let (motion, built) = (rig.history().between(start, start + exposed_us), rig.rig().clone());
        let middle = start + 0.5 * exposed_us;
        let (rows, line_us) = (f64::from(self.camera.lens.size().height), self.shutter.line_us());
        let (camera, number) = (self.camera.clone(), pulse.number);
        let (rendering, table) = (self.rendering, Arc::clone(&self.table));
        Box::new(move || {
            let at_row = |row: u32| {
                let at = middle + (f64::from(row) - 0.5 * (rows - 1.0)) * line_us;
                motion.cameras_at(&built, at).map_or_else(
                    || camera.room.world_from_base.renamed(),
                    |cameras| camera.room.world_from(camera.side, cameras),
                )
            };
            Ok(match rendering {
                Rendering::Exact => camera.photograph_rows(number, &at_row),
                Rendering::Quick => camera.photograph_quick(table.get_or_init(|| camera.ray_table()), number, &at_row),
            })
        })
    }
}

const fn micros(time: Duration) -> f64 {
    time.as_secs_f64() * 1e6
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use vergence_rig::{BENCH_TOML, Rig};

    use super::*;
    use crate::Room;

    const MS: u64 = 1_000;

    fn seconds(count: u64) -> Duration {
        Duration::from_secs(count)
    }

    /// The camera of a rig without trigger pulses, polled once a second, reports that it is plugged in and out.
    #[test]
    fn a_camera_reports_that_it_is_unplugged_and_back() {
        let rig = Rig::from_toml(BENCH_TOML).expect("the bench");
        let mut simulated = SimulatedRig::new(&rig, 1).expect("a simulated rig");
        let room = Arc::new(Room::with_rig());
        let camera = RoomCamera { side: Side::Left, lens: rig.left_camera, room, seed: 1 };
        let out = |side| Unplugged { side, from: seconds(2), until: seconds(4) };
        let mut camera = LiveCamera::new(camera, Shutter::Global, &[out(Side::Left), out(Side::Right)]);
        let mut events = Vec::new();
        for age in 0..6 {
            simulated.run_until(age * 1_000 * MS);
            let now = Microseconds(age * 1_000 * MS);
            events.extend(camera.poll(&simulated, seconds(age), now).into_iter().map(|event| (age, event)));
        }
        assert!(matches!(
            events[..],
            [(0, CameraEvent::Attached(_)), (2, CameraEvent::Lost(_)), (4, CameraEvent::Attached(_))]
        ));
    }
}
