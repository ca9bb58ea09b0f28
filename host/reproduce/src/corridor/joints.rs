//! The joints of the robot: what brings its trunk to a mode, and where both cameras then are.

use vergence_board::{Board, BoardError, Shared};
use vergence_protocol::SessionId;
use vergence_rig::{Rig, RigPose};
use vergence_sim::{Random, SimulatedRig};

use super::station::values;
use crate::demo::Pulse;
use crate::error::DemoError;

/// Lease of the simulated board, in milliseconds.
const LEASE_MS: u16 = 100;

/// Where both cameras are while the robot stands still.
#[derive(Clone, Debug)]
pub struct Standing {
    /// By the encoders of the joints.
    pub by_joints: RigPose,
    /// In truth.
    pub truth: RigPose,
}

/// What brings the trunk to its modes, and tells where the cameras are.
pub trait Joints {
    /// Goes to the mode of this name. Returns the seconds that it took, or `None` where the joints are placed and nothing moves them.
    ///
    /// # Errors
    /// An unknown mode, or a board that does not do what it is asked.
    fn go_to(&mut self, mode: &str) -> Result<Option<f64>, DemoError>;

    /// Lets the robot walk for so many seconds, with its trunk held.
    ///
    /// # Errors
    /// A fault of the board.
    fn walk(&mut self, seconds: f64) -> Result<(), DemoError>;

    /// Where the cameras are at a pulse of the trigger.
    ///
    /// # Errors
    /// A board that does not fire the cameras.
    fn standing(&mut self) -> Result<Standing, DemoError>;
}

/// Joints placed at the values of a mode, each off by its play: no controller moves them. For comparisons in many corridors.
pub struct PlacedJoints<'a> {
    rig: &'a Rig,
    seed: u64,
    said: Vec<f64>,
}

impl<'a> PlacedJoints<'a> {
    /// Joints of `rig` that `seed` puts off.
    #[must_use]
    pub const fn new(rig: &'a Rig, seed: u64) -> Self {
        Self { rig, seed, said: Vec::new() }
    }
}

impl Joints for PlacedJoints<'_> {
    fn go_to(&mut self, mode: &str) -> Result<Option<f64>, DemoError> {
        self.said = values(self.rig, mode);
        Ok(None)
    }

    fn walk(&mut self, _: f64) -> Result<(), DemoError> {
        Ok(())
    }

    fn standing(&mut self) -> Result<Standing, DemoError> {
        let mut random = Random::new(self.seed);
        self.seed = self.seed.wrapping_add(1);
        let off = |(axis, &value): (usize, &f64)| {
            value + 0.5 * self.rig.axes.get(axis).map_or(0.0, |axis| axis.play) * random.normal()
        };
        let truth: Vec<f64> = self.said.iter().enumerate().map(off).collect();
        Ok(Standing { by_joints: self.rig.pose_read_at(&self.said), truth: self.rig.pose_at_values(&truth) })
    }
}

/// Joints moved by the controller of a simulated board over the real protocol. The servos, and the trunk with its play and springs, are
/// simulated; they stand in spider at first.
pub struct DrivenJoints {
    board: Board,
    simulated: Shared<SimulatedRig>,
    /// Number of pulses so far.
    pulses: u32,
}

impl DrivenJoints {
    /// Powers the simulated robot, and arms its board. `seed` decides the play of the joints.
    ///
    /// # Errors
    /// A rig whose joints no simulated servos fit, or a board that is not armed.
    pub async fn start(rig: &Rig, seed: u64) -> Result<Self, DemoError> {
        let simulated = Shared::new(SimulatedRig::new(rig, seed)?);
        let session = SessionId((seed as u32).max(1));
        let mut board = Board::in_process(simulated.clone(), rig.clone(), session, LEASE_MS).await?;
        // The pose at a pulse needs the clocks compared.
        board.compare_clocks().await?;
        board.arm().await?;
        Ok(Self { board, simulated, pulses: 0 })
    }

    /// As [`Joints::go_to`], by the ways of [`Board::move_to`]. The time is that of the board's clock, with the settling of the joints.
    ///
    /// # Errors
    /// As there.
    pub async fn go_to(&mut self, mode: &str) -> Result<f64, DemoError> {
        let unknown = || DemoError::UnknownPose(format!("the rig has no mode {mode}"));
        let mode = self.board.rig().mode(mode).cloned().ok_or_else(unknown)?;
        let begins = self.simulated.lock().now();
        self.board.move_to(mode.number, &mode.targets).await?;
        let took = self.simulated.lock().now().0 - begins.0;
        Ok(took as f64 * 1e-6)
    }

    /// As [`Joints::walk`]: the joints are held, and their play wanders.
    ///
    /// # Errors
    /// As there.
    pub async fn walk(&mut self, seconds: f64) -> Result<(), DemoError> {
        Ok(self.board.hold(Some(std::time::Duration::from_secs_f64(seconds.max(0.0)))).await?)
    }

    /// As [`Joints::standing`]: by the counts that the pulse latches, and the truth at that pulse.
    ///
    /// # Errors
    /// As there.
    pub async fn standing(&mut self) -> Result<Standing, DemoError> {
        let pulse = Pulse::fired_by(&mut self.board, self.pulses).await?;
        self.pulses += 1;
        let truth = self.simulated.lock().exposed_pose().ok_or(DemoError::NotTriggered)?;
        Ok(Standing { by_joints: pulse.pose()?.at_middle().clone(), truth })
    }

    /// Disarms the board.
    ///
    /// # Errors
    /// A refusal, or a link that ended.
    pub async fn release(&mut self) -> Result<(), BoardError> {
        self.board.release().await
    }
}
