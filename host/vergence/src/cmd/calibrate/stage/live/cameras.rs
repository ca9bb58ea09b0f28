//! The board and the cameras of a rig that drives itself.

use vergence_board::{Board, HostClock, Port, fresh_session};
use vergence_calibration::TargetSpec;
use vergence_camera::{Camera, CameraError};
use vergence_rig::Rig;
use vergence_sim::{HeldTarget, TargetCamera};
use vergence_vision::Side;

use super::Options;
use crate::cli::Globals;
use crate::cmd::connect::{connect, port};
use crate::console::Console;
use crate::failure::Failure;
use crate::sim::{SharedRig, SimulatedRig, board_of, built};

/// The cameras of a rig.
pub enum RigCameras {
    /// Attached cameras, left before right.
    Attached(Vec<Box<dyn Camera>>),
    /// Simulated cameras.
    Simulated(Box<Simulator>),
}

/// Cameras on simulated mechanics, and a person who holds a target before them.
pub struct Simulator {
    rig: SharedRig,
    /// The rig as it was really built.
    pub built: Rig,
    target: vergence_scene::Target,
    seed: u64,
}

/// Connects to the board and opens the cameras.
///
/// # Errors
/// Those of the board and the cameras; simulated cameras on a real rig, or the other way round.
pub async fn open(
    options: &Options,
    cameras: &[String],
    nominal: &Rig,
    target: &TargetSpec,
    globals: &Globals,
    console: Console,
) -> Result<(Board, RigCameras), Failure> {
    match (port(globals)?, cameras) {
        (Port::Simulated, [only]) if only == "sim" => {
            let built = built(nominal, options.seed);
            let rig = SharedRig::new(SimulatedRig::new(&built, options.seed)?);
            let (session, progress) = (fresh_session()?, console.progress("homing"));
            let board_of_rig = board_of(&rig, nominal.clone(), session, globals.lease, progress).await?;
            let target = vergence_scene::Target { columns: target.columns, rows: target.rows, square: target.square };
            Ok((board_of_rig, RigCameras::Simulated(Box::new(Simulator { rig, built, target, seed: options.seed }))))
        }
        (Port::Simulated, _) => {
            Err(Failure::usage("a simulated rig has simulated cameras: use --port sim with --cameras sim"))
        }
        (_, [left, right]) => {
            let clock = HostClock::start();
            let attached = [left, right].map(|device| options.camera.open(device, clock));
            let attached = attached.into_iter().collect::<Result<_, CameraError>>()?;
            Ok((connect(globals, console, "homing").await?, RigCameras::Attached(attached)))
        }
        _ => Err(Failure::usage("name the left and the right camera: --cameras /dev/video0 /dev/video2")),
    }
}

impl RigCameras {
    /// The cameras at the present stage pose, the `index`th.
    pub fn here(&mut self, index: usize) -> Vec<Box<dyn Camera>> {
        match self {
            Self::Attached(cameras) => std::mem::take(cameras),
            Self::Simulated(simulator) => simulator.cameras(index),
        }
    }

    /// Keeps the attached cameras for the next stage pose.
    pub fn give_back(&mut self, cameras: Vec<Box<dyn Camera>>) {
        if let Self::Attached(own) = self {
            *own = cameras;
        }
    }
}

impl Simulator {
    fn cameras(&self, index: usize) -> Vec<Box<dyn Camera>> {
        let held = HeldTarget {
            left: self.built.left_camera,
            right: (self.built.right_camera, self.rig.lock().true_pose().left_from_right),
            both: true,
            target: self.target,
            // Another seed for each stage pose, so that the target is held elsewhere.
            seed: self.seed.wrapping_mul(1009).wrapping_add(index as u64),
        };
        let camera = |side| Box::new(TargetCamera::new(held, side)) as Box<dyn Camera>;
        vec![camera(Side::Left), camera(Side::Right)]
    }
}
