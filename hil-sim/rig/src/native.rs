//! The controller core without a chip: its clock, its starts and its settings flash.

use vergence_control::UNIT;
use vergence_image::is_signed_by;
use vergence_plant::{NativeBoard, Stage};
use vergence_protocol::{Microseconds, ResetCause};
use vergence_rig::Rig;

use crate::error::refusal;
use crate::rig::stage;
use crate::{SimError, TrunkMechanics, joint_settings, trunk_servos};

/// The board's clock when the simulation starts, in microseconds.
const START_US: u64 = 3_000_000;
/// Drift of the board's clock against the host's: no quartz is exact.
const DRIFT: f64 = 40e-6;
/// Number of the board's first start; later ones count up.
const FIRST_BOOT: u32 = 1;
/// Version of the oldest firmware that may replace the board's own.
const OLDEST: [u8; 3] = [0, 1, 0];

/// A board that is the controller core, compiled for this computer.
#[derive(Debug)]
pub(crate) struct Native {
    pub board: NativeBoard,
    /// Elapsed time to which the simulation was last run, and at which the board last started, in microseconds.
    elapsed_us: u64,
    began_us: u64,
    /// Time of the board's clock when it last started, in microseconds.
    started_us: u64,
    boot: u32,
    /// Number of flash operations up to the last [`Self::changed_flash`].
    saved_operations: usize,
}

impl Native {
    /// The board of `rig`; `seed` decides where its mechanics stand.
    ///
    /// # Errors
    /// [`SimError::Axes`] where no stage or servo fits an axis.
    pub(crate) fn new(rig: &Rig, seed: u64) -> Result<Self, SimError> {
        let refused = |error| SimError::Axes { rig: rig.name.clone(), why: refusal(error, rig) };
        let mut board = match &rig.trunk {
            Some(_) => {
                let servos = trunk_servos(rig, TrunkMechanics::default(), seed)?;
                NativeBoard::of_joints(&joint_settings(rig)?, servos, FIRST_BOOT)
            }
            None => {
                let stages: Vec<Stage> = rig.axes.iter().map(stage).collect();
                let settings: Vec<_> = stages.iter().map(|stage| stage.settings).collect();
                let mechanics: Vec<_> = stages.iter().map(|stage| stage.mechanics).collect();
                NativeBoard::new(&settings, &mechanics, seed)
            }
        }
        .map_err(refused)?;
        board.services_mut().oldest = OLDEST;
        board.restart(ResetCause::PowerOn, FIRST_BOOT).map_err(refused)?;
        Ok(Self { board, elapsed_us: 0, began_us: 0, started_us: START_US, boot: FIRST_BOOT, saved_operations: 0 })
    }

    /// Time of the board's clock at this time after the simulation began.
    pub(crate) fn clock_at(&mut self, elapsed_us: u64) -> Microseconds {
        self.elapsed_us = elapsed_us;
        let drifted = elapsed_us.saturating_sub(self.began_us) as f64 * (1.0 + DRIFT);
        Microseconds(self.started_us + drifted as u64)
    }

    /// Takes bytes of the host, and starts again where they ask for it. There is no boot loader to stay in.
    pub(crate) fn receive(&mut self, bytes: &[u8]) -> Vec<u8> {
        self.board.receive(bytes);
        let answers = self.board.transmit();
        if self.board.take_reboot().is_some() {
            self.boot += 1;
            // It has started with these settings before.
            if self.board.restart(ResetCause::Software, self.boot).is_ok() {
                (self.started_us, self.began_us) = (0, self.elapsed_us);
            }
        }
        answers
    }

    /// Takes firmware that is signed by `key`, an Ed25519 public key.
    pub(crate) fn trust(&mut self, key: [u8; 32]) {
        let services = self.board.services_mut();
        services.key = key;
        services.verifier = |key, signed, signature| is_signed_by(key, signed, signature);
    }

    /// Switches on with these bytes in the settings flash; none at all stand for erased flash.
    ///
    /// # Errors
    /// [`SimError::NotFlash`] for bytes of another length, [`SimError::Settings`] where the board refuses the settings of its axes, those of `rig`.
    pub(crate) fn power_on_with_flash(&mut self, bytes: &[u8], rig: &Rig) -> Result<(), SimError> {
        let flash = &mut self.board.services_mut().settings;
        if !bytes.is_empty() && bytes.len() != flash.bytes().len() {
            return Err(SimError::NotFlash);
        }
        // Erased units stay as they are: they may still be programmed.
        let units = bytes.chunks(UNIT).zip((0..).step_by(UNIT));
        units.filter(|(unit, _)| unit.iter().any(|&b| b != 0xFF)).for_each(|(unit, at)| flash.overwrite(at, unit));
        self.saved_operations = flash.operations();
        self.boot += 1;
        self.board.restart(ResetCause::PowerOn, self.boot).map_err(|error| SimError::Settings(refusal(error, rig)))
    }

    /// Contents of the settings flash, where they changed since the last call or since [`Self::power_on_with_flash`].
    pub(crate) fn changed_flash(&mut self) -> Option<&[u8]> {
        let flash = &self.board.services_mut().settings;
        let changed = std::mem::replace(&mut self.saved_operations, flash.operations()) != flash.operations();
        changed.then(|| flash.bytes())
    }
}
