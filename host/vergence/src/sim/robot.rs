//! A simulated robot that a computation on its own thread moves: time passes for it only while it is moved.

use tokio::runtime::{Builder, Runtime};
use vergence_reproduce::DemoError;
use vergence_reproduce::corridor::{DrivenJoints, Joints, Standing};
use vergence_rig::Rig;

use crate::failure::Failure;

/// A simulated robot with its armed board, in virtual time of its own.
pub struct SimulatedRobot {
    runtime: Runtime,
    joints: DrivenJoints,
}

impl SimulatedRobot {
    /// As [`DrivenJoints::start`]. Not to be called from asynchronous code.
    ///
    /// # Errors
    /// As there, and where no runtime starts.
    pub fn start(rig: &Rig, seed: u64) -> Result<Self, Failure> {
        let runtime = Builder::new_current_thread()
            .enable_time()
            .start_paused(true)
            .build()
            .map_err(|error| Failure::device(format!("the asynchronous runtime does not start: {error}")))?;
        let joints = runtime.block_on(DrivenJoints::start(rig, seed))?;
        Ok(Self { runtime, joints })
    }

    /// Disarms the board.
    ///
    /// # Errors
    /// A refusal, or a link that ended.
    pub fn release(mut self) -> Result<(), Failure> {
        Ok(self.runtime.block_on(self.joints.release())?)
    }
}

impl Joints for SimulatedRobot {
    fn go_to(&mut self, mode: &str) -> Result<Option<f64>, DemoError> {
        self.runtime.block_on(self.joints.go_to(mode)).map(Some)
    }

    fn walk(&mut self, seconds: f64) -> Result<(), DemoError> {
        self.runtime.block_on(self.joints.walk(seconds))
    }

    fn standing(&mut self) -> Result<Standing, DemoError> {
        self.runtime.block_on(self.joints.standing())
    }
}
