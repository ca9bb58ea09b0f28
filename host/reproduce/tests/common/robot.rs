//! A simulated robot with its controller, in virtual time of its own: what the command `vergence demo` moves.

use tokio::runtime::{Builder, Runtime};
use vergence_reproduce::DemoError;
use vergence_reproduce::corridor::{DrivenJoints, Joints, Standing};
use vergence_rig::Rig;

pub struct Robot {
    runtime: Runtime,
    pub joints: DrivenJoints,
}

impl Robot {
    pub fn start(rig: &Rig, seed: u64) -> Self {
        let runtime = Builder::new_current_thread().enable_time().start_paused(true).build().unwrap();
        let joints = runtime.block_on(DrivenJoints::start(rig, seed)).unwrap();
        Self { runtime, joints }
    }
}

impl Joints for Robot {
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
