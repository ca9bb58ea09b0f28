//! A board and its mechanics as one simulated rig.

use std::collections::VecDeque;
use std::time::Duration;

use vergence_board::Served;
use vergence_control::TICK_US;
use vergence_plant::{AxisPlant, EncoderFault, Plant, Stage};
use vergence_protocol::{AxisKind, Microseconds};
use vergence_rig::{Rig, RigAxis, RigPose};

use crate::controller::Controller;
use crate::history::LoadHistory;
use crate::native::Native;
use crate::{BentRail, DrivenTrunk, SimError, SimulatedChip, Trunk};

/// Number of pulses remembered for [`SimulatedRig::pulses_from`].
const PULSES_KEPT: usize = 256;

/// A simulated rig: a board that speaks the protocol, with the controller core alone or with the firmware on a simulated chip, and the truth
/// beside it.
#[derive(Debug)]
pub struct SimulatedRig {
    controller: Controller,
    rig: Rig,
    output: Vec<u8>,
    history: LoadHistory,
    pulses: VecDeque<Pulse>,
    loose: Vec<LoosePlug>,
}

/// The plug of an encoder that is out for a while, in microseconds of the board's clock.
#[derive(Debug)]
struct LoosePlug {
    axis: usize,
    times: [u64; 2],
    is_out: bool,
}

/// A pulse of the camera trigger.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Pulse {
    /// Number of pulses before this one since power-on.
    pub number: u32,
    /// Time of its edge, board clock.
    pub at: Microseconds,
}

impl SimulatedRig {
    /// Switches on a simulated rig with one stage for every axis; `seed` decides where they stand. A trunk stands in spider, and
    /// `seed` decides the play of its joints.
    ///
    /// # Errors
    /// [`SimError::Axes`] where the rig has no axes, or one that no stage or servo fits.
    pub fn new(rig: &Rig, seed: u64) -> Result<Self, SimError> {
        Ok(Self::driven_by(Controller::Native(Box::new(Native::new(rig, seed)?)), rig))
    }

    /// The rig of `chip`, which was made for the same rig file: the unmodified firmware drives its mechanics.
    #[must_use]
    pub fn on_chip(chip: SimulatedChip, rig: &Rig) -> Self {
        Self::driven_by(Controller::Chip(Box::new(chip), Microseconds(0)), rig)
    }

    fn driven_by(controller: Controller, rig: &Rig) -> Self {
        Self {
            controller,
            rig: rig.clone(),
            output: Vec::new(),
            history: LoadHistory::default(),
            pulses: VecDeque::new(),
            loose: Vec::new(),
        }
    }

    /// Lets a native board take firmware that is signed by `key`, an Ed25519 public key. Firmware on a chip has its own key.
    pub fn trust(&mut self, key: [u8; 32]) {
        if let Some(native) = self.controller.native() {
            native.trust(key);
        }
    }

    /// Switches a native board on with these bytes in its settings flash; none at all stand for erased flash.
    ///
    /// # Errors
    /// [`SimError::NotFlash`] for bytes of another length and for a chip, whose flash holds its program too, [`SimError::Settings`] where the board refuses the settings.
    pub fn power_on_with_flash(&mut self, bytes: &[u8]) -> Result<(), SimError> {
        self.controller.native().ok_or(SimError::NotFlash)?.power_on_with_flash(bytes, &self.rig)
    }

    /// Contents of the settings flash of a native board, where they changed since the last call or since
    /// [`Self::power_on_with_flash`].
    pub fn changed_flash(&mut self) -> Option<&[u8]> {
        self.controller.native()?.changed_flash()
    }

    /// Runs until `elapsed_us` microseconds after the simulation began. What the board sends meanwhile is kept until
    /// [`Self::take_output`].
    pub fn run_until(&mut self, elapsed_us: u64) {
        let until = self.controller.time_at(elapsed_us).0;
        // A UART sends while the board runs, not after: a pose must not wait for the next one and be replaced by it.
        while self.controller.now().0 < until {
            self.pull_plugs();
            self.controller.advance(Microseconds(until.min(self.controller.now().0 + TICK_US)));
            self.output.append(&mut self.controller.transmit());
            self.remember();
        }
    }

    /// Keeps the positions and the trigger pulse of this tick for the cameras.
    fn remember(&mut self) {
        let plant = self.controller.plant();
        self.history.push(self.controller.now(), loads(plant));
        let Some((at, _)) = plant.exposed() else { return };
        if self.pulses.back().is_some_and(|last| last.at == at) {
            return;
        }
        let number = self.pulses.back().map_or(0, |last| last.number.wrapping_add(1));
        if self.pulses.len() == PULSES_KEPT {
            self.pulses.pop_front();
        }
        self.pulses.push_back(Pulse { number, at });
    }

    /// The last pulses of the camera trigger, from number `first` on.
    pub fn pulses_from(&self, first: u32) -> impl Iterator<Item = Pulse> {
        self.pulses.iter().copied().filter(move |pulse| pulse.number >= first)
    }

    /// True positions of the mechanics during the last second.
    #[must_use]
    pub const fn history(&self) -> &LoadHistory {
        &self.history
    }

    /// Time on the clock of [`Self::history`] and of the pulses: that of a native board, or the time since power-on of a chip.
    #[must_use]
    pub fn now(&self) -> Microseconds {
        self.controller.now()
    }

    /// The rig that is simulated.
    #[must_use]
    pub const fn rig(&self) -> &Rig {
        &self.rig
    }

    /// Gives bytes of the host to the board, at the time to which it was last run.
    pub fn receive(&mut self, bytes: &[u8]) {
        match &mut self.controller {
            Controller::Native(native) => self.output.append(&mut native.receive(bytes)),
            Controller::Chip(chip, _) => chip.send(bytes),
        }
    }

    /// Bytes that the board sent since the last call.
    pub fn take_output(&mut self) -> Vec<u8> {
        std::mem::take(&mut self.output)
    }

    /// Does something to the mechanics: harms or mends them.
    pub fn with_plant<R>(&mut self, act: impl FnOnce(&mut Plant) -> R) -> R {
        self.controller.with_plant(act)
    }

    /// Bends a rail from now on: the cameras move as it takes them, and neither board nor rig file knows.
    pub fn bend_rail(&mut self, rail: BentRail) {
        self.history.rail = Some(rail);
    }

    /// Unplugs the encoder of the stage `axis`, and plugs it in again, at these times from now.
    pub fn unplug_encoder(&mut self, axis: usize, times: [Duration; 2]) {
        let times = times.map(|time| self.controller.now().0 + time.as_micros() as u64);
        self.loose.push(LoosePlug { axis, times, is_out: false });
    }

    fn pull_plugs(&mut self) {
        let now = self.controller.now().0;
        for plug in &mut self.loose {
            let is_out = (plug.times[0]..plug.times[1]).contains(&now);
            if std::mem::replace(&mut plug.is_out, is_out) == is_out {
                continue;
            }
            self.controller.with_plant(|plant| match (plant.axis_mut(plug.axis), is_out) {
                (Some(axis), true) => axis.fail_encoder(Some(EncoderFault::Stuck)),
                (Some(axis), false) => AxisPlant::mend_encoder(axis),
                (None, _) => {}
            });
        }
    }

    /// True pose of the cameras now: from the mechanics, not from the encoders.
    #[must_use]
    pub fn true_pose(&self) -> RigPose {
        self.history.pose_of(&self.rig, &loads(self.controller.plant()))
    }

    /// True pose of the cameras when they were last triggered; `None` before the first pulse.
    #[must_use]
    pub fn exposed_pose(&self) -> Option<RigPose> {
        let (at, loads) = self.controller.plant().exposed()?;
        match self.rig.trunk {
            Some(_) => self.history.pose_at(&self.rig, at.0 as f64),
            None => Some(self.history.pose_of(&self.rig, loads)),
        }
    }

    /// The trunk of a robot, as it stands.
    #[must_use]
    pub fn trunk(&self) -> Option<&Trunk> {
        trunk_of(self.controller.plant())
    }
}

impl Served for SimulatedRig {
    type Error = SimError;

    fn run_until(&mut self, elapsed_us: u64) {
        self.run_until(elapsed_us);
    }

    fn hear_at(&mut self, baud: u32) {
        if let Controller::Chip(chip, _) = &mut self.controller {
            chip.hear_at(baud);
        }
    }

    fn receive(&mut self, bytes: &[u8]) {
        self.receive(bytes);
    }

    fn take_output(&mut self) -> Vec<u8> {
        self.take_output()
    }

    fn settle(&mut self) -> Result<(), SimError> {
        match &mut self.controller {
            Controller::Native(_) => Ok(()),
            Controller::Chip(chip, _) => chip.settle(),
        }
    }
}

/// What a history keeps of the mechanics: the position of each load in micro-units, or the angle of each joint of a trunk in radians.
fn loads(plant: &Plant) -> Vec<f64> {
    trunk_of(plant).map_or_else(|| plant.loads(), |trunk| trunk.angles().to_vec())
}

/// The trunk that a board's servos hold, if they hold one.
pub(crate) fn trunk_of(plant: &Plant) -> Option<&Trunk> {
    Some(plant.joints().servos().mechanism().get::<DrivenTrunk>()?.trunk())
}

/// The simulated stage of an axis of the rig file.
pub(crate) fn stage(axis: &RigAxis) -> Stage {
    let [min, max] = axis.range.map(|position| position.micro());
    match axis.kind {
        AxisKind::Linear => Stage::linear(min, max, axis.counts_per_unit),
        AxisKind::Rotary => Stage::rotary(min, max, axis.counts_per_unit),
    }
}
