//! A board and its mechanics that know which rig they are.

use std::collections::VecDeque;
use std::io::ErrorKind;
use std::path::{Path, PathBuf};

use vergence_control::{TICK_US, UNIT};
use vergence_image::is_signed_by;
use vergence_plant::{NativeBoard, Stage};
use vergence_protocol::{AxisKind, Microseconds, ResetCause};
use vergence_rig::{Rig, RigAxis, RigPose};

use super::history::LoadHistory;
use super::pace::Pace;
use super::served::{Served, Shared};
use crate::failure::Failure;
use crate::output::write_whole;

/// The board's clock when the simulation starts, and how fast it runs against the host's: a quartz is never exact.
const BOARD_START_US: u64 = 3_000_000;
const BOARD_DRIFT: f64 = 40e-6;
/// Names the first start; the next ones follow.
const FIRST_BOOT: u32 = 1;
/// The oldest firmware that may replace this one: that of the board.
const OLDEST: [u8; 3] = [0, 1, 0];

/// A simulated rig: what the host sees through the wire, and the truth beside it.
#[derive(Debug)]
pub struct SimulatedRig {
    board: NativeBoard,
    rig: Rig,
    /// How much time has passed since the board last started.
    pace: Pace,
    /// What the board's clock showed when time began to pass.
    started_us: u64,
    boot: u32,
    output: Vec<u8>,
    flash: Option<FlashFile>,
    history: LoadHistory,
    /// The last pulses of the camera trigger.
    pulses: VecDeque<Pulse>,
}

/// A pulse of the camera trigger.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Pulse {
    /// How many there were before it, since power on.
    pub number: u32,
    /// Its edge, board clock.
    pub at: Microseconds,
}

/// Pulses that are remembered.
const PULSES_KEPT: usize = 256;

/// Where the settings outlive the simulator, as flash outlives the power.
#[derive(Debug)]
struct FlashFile {
    path: PathBuf,
    /// Operations of the flash that the file knows of.
    written: usize,
}

/// The board is driven by its link and looked at by the simulated cameras.
pub type SharedRig = Shared<SimulatedRig>;

impl SimulatedRig {
    /// Switches on a simulated rig: a stage of the bench's kind for every axis; `seed` decides where they stand.
    ///
    /// # Errors
    /// Where the rig has no axes, or a range that no stage has.
    pub fn new(rig: &Rig, seed: u64) -> Result<Self, Failure> {
        let stages: Vec<Stage> = rig.axes.iter().map(stage).collect();
        let settings: Vec<_> = stages.iter().map(|stage| stage.settings).collect();
        let mechanics: Vec<_> = stages.iter().map(|stage| stage.mechanics).collect();
        let refused = |error| {
            let name = &rig.name;
            Failure::usage(format!("rig '{name}' cannot be simulated: its controller refuses the axes ({error:?})"))
        };
        let mut board = NativeBoard::new(&settings, &mechanics, seed).map_err(refused)?;
        board.services_mut().oldest = OLDEST;
        board.restart(ResetCause::PowerOn, FIRST_BOOT).map_err(refused)?;
        Ok(Self {
            board,
            rig: rig.clone(),
            pace: Pace::begin(),
            started_us: BOARD_START_US,
            boot: FIRST_BOOT,
            output: Vec::new(),
            flash: None,
            history: LoadHistory::default(),
            pulses: VecDeque::new(),
        })
    }

    /// Lets the board take firmware that is signed by `key`, an Ed25519 public key.
    pub fn trust(&mut self, key: [u8; 32]) {
        let services = self.board.services_mut();
        services.key = key;
        services.verifier = |key, signed, signature| is_signed_by(key, signed, signature);
    }

    /// Switches the board on with the settings that `path` holds, and keeps later ones there. A file that is not there
    /// yet is empty flash.
    ///
    /// # Errors
    /// A file that is no such flash.
    pub fn keep_flash_in(&mut self, path: &Path) -> Result<(), Failure> {
        let flash = &mut self.board.services_mut().settings;
        match std::fs::read(path) {
            Ok(bytes) if bytes.len() == flash.bytes().len() => {
                // What is erased may still be programmed.
                let units = bytes.chunks(UNIT).zip((0..).step_by(UNIT));
                units
                    .filter(|(unit, _)| unit.iter().any(|&b| b != 0xFF))
                    .for_each(|(unit, at)| flash.overwrite(at, unit));
            }
            Ok(_) => return Err(Failure::input(path, "this is not the flash of a simulated board")),
            Err(error) if error.kind() == ErrorKind::NotFound => {}
            Err(error) => return Err(Failure::input(path, error)),
        }
        self.flash = Some(FlashFile { path: path.to_owned(), written: flash.operations() });
        self.boot += 1;
        self.board
            .restart(ResetCause::PowerOn, self.boot)
            .map_err(|error| Failure::input(path, format!("the board does not start with these settings ({error:?})")))
    }

    /// Writes the flash to its file where it has changed.
    ///
    /// # Errors
    /// Where the file cannot be written.
    pub fn save_flash(&mut self) -> Result<(), Failure> {
        let flash = &self.board.services_mut().settings;
        match &mut self.flash {
            Some(file) if file.written != flash.operations() => {
                file.written = flash.operations();
                write_whole(&file.path, flash.bytes())
            }
            _ => Ok(()),
        }
    }

    /// Lets the rig run until now: simulated time follows the clock, but never leaps. What the board sends meanwhile is
    /// kept until [`Self::take_output`].
    pub fn run_to_now(&mut self) {
        let drifted = self.pace.elapsed_us() as f64 * (1.0 + BOARD_DRIFT);
        let until = self.started_us + drifted as u64;
        // A UART sends while the board runs, not after: a pose must not wait for the next one and be replaced by it.
        while self.board.now().0 < until {
            self.board.advance(Microseconds(until.min(self.board.now().0 + TICK_US)));
            self.output.append(&mut self.board.transmit());
            self.remember();
        }
    }

    /// Keeps what cameras on the mechanics may ask for.
    fn remember(&mut self) {
        let plant = self.board.plant();
        self.history.push(self.board.now(), plant.loads());
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

    /// The remembered pulses of the camera trigger from number `first` on.
    pub fn pulses_from(&self, first: u32) -> impl Iterator<Item = Pulse> {
        self.pulses.iter().copied().filter(move |pulse| pulse.number >= first)
    }

    /// Where the mechanics truly were during the last second.
    #[must_use]
    pub const fn history(&self) -> &LoadHistory {
        &self.history
    }

    /// What the board's clock shows.
    #[must_use]
    pub fn now(&self) -> Microseconds {
        self.board.now()
    }

    /// The rig that is simulated.
    #[must_use]
    pub const fn rig(&self) -> &Rig {
        &self.rig
    }

    /// Gives bytes of the host to the board, now.
    pub fn receive(&mut self, bytes: &[u8]) {
        self.run_to_now();
        self.board.receive(bytes);
        self.output.append(&mut self.board.transmit());
        if self.board.take_reboot().is_some() {
            self.restart();
        }
    }

    /// Starts the board's software again. There is no boot loader to stay in.
    fn restart(&mut self) {
        self.boot += 1;
        // It has started with these settings before.
        if self.board.restart(ResetCause::Software, self.boot).is_ok() {
            (self.started_us, self.pace) = (0, Pace::begin());
        }
    }

    /// What the board sent since this was last asked.
    pub fn take_output(&mut self) -> Vec<u8> {
        std::mem::take(&mut self.output)
    }

    /// The board.
    pub fn board(&mut self) -> &mut NativeBoard {
        &mut self.board
    }

    /// Where the cameras truly are: from the mechanics, not from the encoders.
    #[must_use]
    pub fn true_pose(&self) -> RigPose {
        self.pose_of(&self.board.plant().loads())
    }

    /// Where the cameras truly were when they were last fired; `None` before the first pulse.
    #[must_use]
    pub fn exposed_pose(&self) -> Option<RigPose> {
        self.board.plant().exposed().map(|(_, loads)| self.pose_of(loads))
    }

    fn pose_of(&self, loads: &[f64]) -> RigPose {
        let values: Vec<f64> =
            self.rig.axes.iter().zip(loads).map(|(axis, &load)| axis.value_from_micro(load)).collect();
        self.rig.pose_at_values(&values)
    }
}

impl Served for SimulatedRig {
    fn run_to_now(&mut self) {
        self.run_to_now();
    }

    fn receive(&mut self, bytes: &[u8]) {
        self.receive(bytes);
    }

    fn take_output(&mut self) -> Vec<u8> {
        self.take_output()
    }

    fn settle(&mut self) -> Result<(), Failure> {
        self.save_flash()
    }
}

/// A stage that fits an axis of the rig file.
pub(super) fn stage(axis: &RigAxis) -> Stage {
    let [min, max] = axis.range.map(|position| position.micro());
    match axis.kind {
        AxisKind::Linear => Stage::linear(min, max, axis.counts_per_unit),
        AxisKind::Rotary => Stage::rotary(min, max, axis.counts_per_unit),
    }
}
