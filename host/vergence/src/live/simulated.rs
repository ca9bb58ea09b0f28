//! A simulated camera of the live loop: it rides on the simulated mechanics, is fired by the board, exposes row after row where
//! the rig file says so, and may be unplugged for a while. Its pictures are rendered when they are wanted, from where the
//! mechanics truly were. Motion within one row's exposure does not blur.

use std::str::FromStr;
use std::sync::Arc;
use std::time::Duration;

use tokio::sync::mpsc::Sender;
use tokio::time::{Instant, sleep};
use vergence_rig::{HostInstant, Shutter};
use vergence_scene::{Optics, View, render_rolling};
use vergence_vision::{Camera as CameraFrame, KannalaBrandt, Side, Transform, World};

use super::eye::{Heard, LiveFrame, News, Picture};
use crate::camera::{FrameTiming, Stage, StampedAt};
use crate::link::HostClock;
use crate::sim::{Pulse, SharedRig};

/// How often the camera looks for a pulse, as its driver's interrupt would.
const WATCH: Duration = Duration::from_millis(1);
const EXPOSURE: Duration = Duration::from_millis(4);
/// From the end of the last row's exposure until the frame is in memory.
const TRANSFER: Duration = Duration::from_millis(6);
/// The camera takes no more than 30 frames each second.
const PERIOD: Duration = Duration::from_micros(33_333);

/// When a simulated camera is unplugged, in seconds of its life: `left@2s..4s`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Unplugged {
    /// Which camera.
    pub side: Side,
    /// From when.
    pub from: Duration,
    /// Until when.
    pub until: Duration,
}

impl FromStr for Unplugged {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let read = || {
            let (side, times) = text.split_once('@')?;
            let (from, until) = times.split_once("..")?;
            let side = match side {
                "left" => Side::Left,
                "right" => Side::Right,
                _ => return None,
            };
            let time = |text| humantime::parse_duration(text).ok();
            Some(Self { side, from: time(from)?, until: time(until)? })
        };
        read().ok_or_else(|| format!("'{text}' does not say when a camera is unplugged: write it like left@2s..4s"))
    }
}

/// One camera.
#[derive(Clone)]
pub struct SimulatedEye {
    /// Which.
    pub side: Side,
    /// Lens and sensor geometry.
    pub lens: KannalaBrandt,
    /// How its rows are exposed.
    pub shutter: Shutter,
    /// The room.
    pub stage: Arc<Stage>,
    /// The mechanics that carry it.
    pub rig: SharedRig,
    /// Stamps the frames.
    pub clock: HostClock,
    /// Drives the noise; each frame has its own.
    pub seed: u64,
    /// When it is not there.
    pub unplugged: Vec<Unplugged>,
}

impl SimulatedEye {
    /// How it takes its frames.
    #[must_use]
    pub fn timing(&self) -> FrameTiming {
        FrameTiming {
            period: PERIOD,
            exposure: Some(EXPOSURE),
            rolling: self.shutter.span(self.lens.size().height),
            readout: TRANSFER + 3 * WATCH,
        }
    }

    /// Rides until nobody listens any more.
    pub async fn ride(self, listener: Sender<Heard>) {
        let (born, timing) = (Instant::now(), self.timing());
        let (mut plugged, mut next, mut ready) = (None, 0, 0.0);
        let mut seq = 0;
        loop {
            let is_plugged = self.is_plugged(born.elapsed());
            if plugged.replace(is_plugged) != Some(is_plugged) {
                let news = match is_plugged {
                    true => News::There(timing),
                    false => News::Dead("the simulated camera is unplugged".into()),
                };
                if listener.send(Heard { side: self.side, news }).await.is_err() {
                    return;
                }
            }
            for pulse in self.complete_pulses(next, &timing) {
                next = pulse.number + 1;
                // A pulse that comes while the last frame is taken is missed.
                if !is_plugged || (pulse.at.0 as f64) < ready {
                    continue;
                }
                ready = pulse.at.0 as f64 + PERIOD.as_secs_f64() * 1e6;
                let frame = self.frame(seq, &pulse, &timing);
                seq += 1;
                if listener.send(Heard { side: self.side, news: News::Frame(frame) }).await.is_err() {
                    return;
                }
            }
            sleep(WATCH).await;
            if listener.is_closed() {
                return;
            }
        }
    }

    fn is_plugged(&self, age: Duration) -> bool {
        !self.unplugged.iter().any(|out| out.side == self.side && (out.from..out.until).contains(&age))
    }

    /// Pulses from number `first` on whose frames are in memory now.
    fn complete_pulses(&self, first: u32, timing: &FrameTiming) -> Vec<Pulse> {
        let takes = (EXPOSURE + timing.rolling + TRANSFER).as_micros() as u64;
        let mut rig = self.rig.lock();
        rig.run_to_now();
        let now = rig.now().0;
        rig.pulses_from(first).filter(|pulse| pulse.at.0 + takes <= now).collect()
    }

    fn frame(&self, seq: u32, pulse: &Pulse, timing: &FrameTiming) -> LiveFrame {
        let stamp = Duration::from_micros(self.clock.now().0);
        let middle = timing.middle(stamp, StampedAt::End);
        let us = |time: Duration| time.as_secs_f64() * 1e6;
        let middle = HostInstant { us: us(middle.at), error_us: us(middle.error) };
        LiveFrame { seq, middle, picture: self.picture(pulse, timing) }
    }

    /// What the pulse's frame shows, when somebody wants to see it.
    fn picture(&self, pulse: &Pulse, timing: &FrameTiming) -> Picture {
        let us = |time: Duration| time.as_secs_f64() * 1e6;
        let start = pulse.at.0 as f64;
        let (motion, built) = {
            let rig = self.rig.lock();
            (rig.history().between(start, start + us(EXPOSURE + timing.rolling)), rig.rig().clone())
        };
        let middle = start + 0.5 * us(EXPOSURE + timing.rolling);
        let (rows, line_us) = (f64::from(self.lens.size().height), self.shutter.line_us());
        let (eye, seed) = (self.clone(), self.seed.wrapping_mul(2).wrapping_add(u64::from(self.side == Side::Right)));
        let seed = seed.wrapping_add(u64::from(pulse.number) << 32);
        Box::new(move || {
            let at_row = |row: u32| {
                let at = middle + (f64::from(row) - 0.5 * (rows - 1.0)) * line_us;
                motion.pose_at(&built, at).map_or_else(
                    || eye.stage.world_from_base.renamed(),
                    |pose| {
                        let left = eye.stage.world_from_left(pose.base_from_left);
                        match eye.side {
                            Side::Left => left.renamed(),
                            Side::Right => (left * pose.left_from_right).renamed(),
                        }
                    },
                )
            };
            let optics = Optics::default();
            let world_from_camera: Transform<World, CameraFrame> = at_row(0);
            let view = View { scene: &eye.stage.scene, camera: &eye.lens, world_from_camera, optics: &optics };
            Ok(render_rolling(&view, seed, &at_row).image)
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn when_a_camera_is_unplugged_can_be_said() {
        let said: Unplugged = "left@2s..3500ms".parse().expect("it is said");
        assert_eq!((said.side, said.from, said.until.as_millis()), (Side::Left, Duration::from_secs(2), 3500));
        for wrong in ["left", "left@2s", "top@1s..2s", "left@1..2"] {
            assert!(wrong.parse::<Unplugged>().is_err_and(|error| error.contains("left@2s..4s")), "{wrong}");
        }
    }
}
