//! What the verbs share that take images live: the cameras, the board beside them, and what is simulated.

use std::path::Path;

use tokio::sync::mpsc::{Receiver, Sender, channel};
use vergence_board::{Board, Continuity, HostClock, Port};
use vergence_camera::{CameraError, CameraEvent, PLAYED_HZ, is_played};
use vergence_live::{attach_both, play_both, simulate_both, unplugged};
use vergence_protocol::{Trigger, TriggerMark};
use vergence_recording::{Recordable, Recording};
use vergence_rig::{Rig, Shutter};
use vergence_scene::{LensChoice, TrueLens};
use vergence_sim::Unplug;
use vergence_vision::{KannalaBrandt, Side};

use super::camera_options::CameraOptions;
use super::connect::{connect, port};
use crate::cli::CommonOptions;
use crate::console::{Console, shown_on};
use crate::failure::Failure;
use crate::rig_file;
use crate::sim::{Plug, SharedRig, lensed, simulated_rig};
use crate::stopwatch::started_us;

/// Number of camera events that may wait; images beyond it are lost, which the gap in their numbers shows.
const EVENTS_KEPT: usize = 16;

/// How images are taken.
#[derive(Debug, clap::Args)]
pub struct TakingOptions {
    /// Pulses of the camera trigger per second, 0.1 to 500; of files that are numbered, images per second.
    #[arg(long, default_value_t = PLAYED_HZ, value_name = "HZ", value_parser = super::camera_options::parse_rate)]
    pub rate: f64,
    /// The cameras are not fired but run freely; images are paired by their time stamps.
    #[arg(long)]
    pub free: bool,
    #[command(flatten)]
    camera: CameraOptions,
    /// With simulated cameras: sets where the stages stand at first and the noise of the images.
    #[arg(long, default_value_t = 1)]
    pub seed: u64,
    /// With simulated cameras: their lenses, ideal, as the rig's file has them, or a published design that is traced, sigma8_f18 or nikkor6_f28. A
    /// rig with traced lenses is calibrated first, from simulated targets, and measured by the file that this gives, `rig.toml` in --out.
    #[arg(long, default_value_t)]
    pub lens: LensChoice,
    /// With simulated cameras: unplugs one, the encoder of an axis, or the link to the board for a while, such as left@2s..4s after the start.
    #[arg(long, value_name = "WHEN")]
    pub unplug: Vec<vergence_sim::Unplug>,
}

/// A rig whose images are taken, as far as it is there.
pub struct LiveRig {
    /// What is known of the rig.
    pub known: Rig,
    /// The board; `None` of a rig without axes.
    pub board: Option<Board>,
    /// The cable to a simulated board.
    pub plug: Option<Plug>,
    /// The mechanics and the lenses, left and right, where they are simulated.
    pub simulated: Option<(SharedRig, [TrueLens; 2])>,
    /// What the camera trigger shall do; `None` where the cameras run freely.
    pub trigger: Option<Trigger>,
    /// The clock of images and pulses.
    pub clock: HostClock,
    /// The time at which that clock started, in microseconds since 1970.
    pub epoch_us: u64,
    /// Time between pulses of the trigger in microseconds; `None` where the cameras run freely.
    pub period_us: Option<f64>,
}

impl LiveRig {
    /// Begins a recording of it in `folder`.
    pub fn record(&self, folder: &Path) -> Result<Recording, Failure> {
        let board = self.board.as_ref().map(|board| board.client().knowledge());
        let simulated = self.simulated.as_ref().map(|_| "mechanics, room and cameras");
        let Self { known: rig, clock, epoch_us, period_us, .. } = self;
        let (clock, epoch_us, period_us) = (*clock, *epoch_us, *period_us);
        Ok(Recording::start(folder, Recordable { rig, simulated, board, clock, epoch_us, period_us })?)
    }

    /// The pulses of the camera trigger; `None` where the cameras run freely.
    pub fn take_marks(&mut self) -> Option<Receiver<TriggerMark>> {
        self.period_us.and(self.board.as_mut()).map(|board| board.client_mut().take_marks())
    }
}

impl TakingOptions {
    /// Reads the rig file and connects to the board; `cameras` are named as on the command line. Files of simulated rigs go to `out`.
    /// `prepare` makes of the rig what else the caller needs, before anything is connected.
    ///
    /// # Errors
    /// No board, a bad rig file, options that do not fit; those of `prepare`.
    pub async fn connect<T>(
        &self,
        cameras: &[String],
        common: &CommonOptions,
        out: Option<&Path>,
        console: Console,
        prepare: impl FnOnce(&Rig) -> Result<T, Failure>,
    ) -> Result<(LiveRig, T), Failure> {
        let is_simulated = cameras == ["sim"];
        let drawn = rig_file::load(common.rig.as_deref())?;
        let drawn = if is_simulated { self.camera.simulated(drawn)? } else { drawn };
        if self.lens != LensChoice::Ideal && !is_simulated {
            return Err(Failure::usage("--lens is for simulated cameras: --port sim --cameras sim"));
        }
        if cameras.iter().any(|name| is_played(name)) {
            self.camera.none_for_simulated()?;
            if !drawn.axes.is_empty() {
                return Err(CameraError::PoseUnknown(drawn.name).into());
            }
        }
        let (known, lenses) = match is_simulated {
            true => {
                let lensed = lensed(&drawn, (self.lens, self.seed), out, console).await?;
                (lensed.known, Some(lensed.lenses))
            }
            false => (drawn.clone(), None),
        };
        let prepared = prepare(&known)?;
        let (board, mechanics) = self.connected(is_simulated, common, [&drawn, &known], console).await?;
        // Images and pulses are stamped on the clock of the link.
        let clock = board.as_ref().map_or_else(HostClock::start, |board| board.client().clock());
        let period_us = (board.is_some() && !self.free).then_some(1e6 / self.rate);
        let trigger = period_us.map(|period| Trigger::Every { period_us: period.round() as u32 });
        let (mechanics, plug) = mechanics.unzip();
        let simulated = mechanics.zip(lenses);
        let epoch_us = started_us(clock);
        Ok((LiveRig { known, board, plug, simulated, trigger, clock, epoch_us, period_us }, prepared))
    }

    /// Starts both cameras, and unplugs simulated ones as the options say. Their events arrive at the result.
    ///
    /// # Errors
    /// Where neither camera is there, or nothing that can be unplugged has this name.
    pub fn start_cameras(
        &self,
        cameras: &[String],
        rig: &LiveRig,
        console: Console,
    ) -> Result<Receiver<(Side, CameraEvent)>, Failure> {
        let (listener, events) = channel(EVENTS_KEPT);
        rig.plug.iter().for_each(Plug::begin);
        match (&rig.simulated, cameras) {
            (Some((mechanics, lenses)), _) => self.simulate(rig, mechanics, lenses.clone(), &listener)?,
            (None, [left, right]) if is_played(left) || is_played(right) => {
                let names = [left.as_ref(), right.as_ref()];
                play_both(names, (self.rate, rig.clock), &listener, |warning| console.warn(warning))?;
            }
            (None, [left, right]) => {
                let opener = |device: &String, lens: KannalaBrandt, shutter: Shutter| {
                    let (device, options, clock) = (device.clone(), self.camera.for_size(lens.size()), rig.clock);
                    let rolling = shutter.span(lens.size().height);
                    move || options.open(&device, clock, rolling)
                };
                let [left_shutter, right_shutter] = rig.known.shutters;
                let left = opener(left, rig.known.left_camera, left_shutter);
                attach_both([left, opener(right, rig.known.right_camera, right_shutter)], &listener)?;
            }
            _ => return Err(Failure::usage("name the left and the right camera: --cameras /dev/video0 /dev/video2")),
        }
        // The loop ends when no sender is left.
        Ok(events)
    }

    fn simulate(
        &self,
        rig: &LiveRig,
        mechanics: &SharedRig,
        [left, right]: [TrueLens; 2],
        listener: &Sender<(Side, CameraEvent)>,
    ) -> Result<(), Failure> {
        let known = &rig.known;
        let unplugged = unplugged(&self.unplug, known, mechanics)?;
        let [left_shutter, right_shutter] = known.shutters;
        let cameras = [(left, left_shutter), (right, right_shutter)];
        simulate_both(cameras, mechanics, (self.seed, &unplugged), rig.clock, listener);
        Ok(())
    }

    /// The board, where the rig has axes; beside it the mechanics, where they are simulated: of the rig as drawn, while the board's is as known.
    async fn connected(
        &self,
        is_simulated: bool,
        common: &CommonOptions,
        [drawn, rig]: [&Rig; 2],
        console: Console,
    ) -> Result<(Option<Board>, Option<(SharedRig, Plug)>), Failure> {
        if rig.axes.is_empty() {
            return match is_simulated {
                true => Err(Failure::usage(format!("rig '{}' has no axes to simulate", rig.name))),
                false => Ok((None, None)),
            };
        }
        match (port(common)?, is_simulated) {
            (Port::Simulated(firmware), true) => {
                let simulated = SharedRig::new(simulated_rig(firmware.as_deref(), drawn, self.seed)?);
                let unplugged = self.unplug.iter().filter_map(|unplug| match unplug {
                    Unplug::Link(times) => Some(*times),
                    _ => None,
                });
                let plug = Plug::new(simulated.clone(), unplugged.collect());
                let board = plug.connect(rig.clone(), common.lease, Continuity::begin(None)).await?;
                Ok((Some(board.observed(shown_on(console.progress("live")))), Some((simulated, plug))))
            }
            (Port::Serial(_) | Port::Tcp(_), false) => Ok((Some(connect(common, console, "live").await?), None)),
            _ => Err(Failure::usage("a simulated rig has simulated cameras: --port sim --cameras sim")),
        }
    }
}
