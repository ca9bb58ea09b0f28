//! A simulated camera: photographs the simulated room from where the mechanics truly are.

use std::sync::Arc;

use nalgebra::{UnitQuaternion, Vector3};
use vergence_rig::{HostInstant, RigPose};
use vergence_scene::{Optics, Scene, View, render};
use vergence_vision::{Base, Camera as CameraFrame, KannalaBrandt, Left, Side, Transform, World};

use super::{Camera, Frame};
use crate::failure::Failure;
use crate::link::HostClock;
use crate::sim::SharedRig;

/// The room, and where the rig stands in it.
#[derive(Clone, Debug)]
pub struct Stage {
    /// What there is to see.
    pub scene: Scene,
    /// Where the rig's base stands.
    pub world_from_base: Transform<World, Base>,
}

/// One simulated camera.
pub struct SimulatedCamera {
    /// Which it is.
    pub side: Side,
    /// Lens and sensor geometry.
    pub lens: KannalaBrandt,
    /// Lens and sensor quality.
    pub optics: Optics,
    /// The room.
    pub stage: Arc<Stage>,
    /// The mechanics that carry it.
    pub rig: SharedRig,
    /// Stamps the exposure.
    pub clock: HostClock,
    /// Drives the noise; each frame has its own.
    pub seed: u64,
    /// Frames so far.
    pub frames: u64,
}

impl Stage {
    /// The fixed room; the middle of the bench at its nominal baseline of 145 mm stands in the middle of it.
    #[must_use]
    pub fn room() -> Self {
        let middle = Vector3::new(-72.5, 0.0, 0.0);
        Self { scene: Scene::room(), world_from_base: Transform::new(UnitQuaternion::identity(), middle) }
    }

    /// Where the left camera of a rig pose is.
    #[must_use]
    pub fn world_from_left(&self, base_from_left: Transform<Base, Left>) -> Transform<World, Left> {
        self.world_from_base * base_from_left
    }
}

impl Camera for SimulatedCamera {
    fn grab(&mut self) -> Result<Option<Frame>, Failure> {
        let pose = {
            let mut rig = self.rig.lock();
            rig.run_to_now();
            rig.true_pose()
        };
        Ok(Some(self.photograph(&pose)))
    }
}

impl SimulatedCamera {
    /// The frame of the last trigger pulse, stamped now, as a driver stamps what it has received; `None` before the
    /// first pulse.
    pub fn grab_triggered(&mut self) -> Option<Frame> {
        let pose = self.rig.lock().exposed_pose()?;
        Some(self.photograph(&pose))
    }

    fn photograph(&mut self, pose: &RigPose) -> Frame {
        let world_from_left = self.stage.world_from_left(pose.base_from_left);
        let world_from_camera: Transform<World, CameraFrame> = match self.side {
            Side::Left => world_from_left.renamed(),
            Side::Right => (world_from_left * pose.left_from_right).renamed(),
        };
        let view = View { scene: &self.stage.scene, camera: &self.lens, world_from_camera, optics: &self.optics };
        // A seed of its own for each camera and frame.
        let seed = self.seed.wrapping_mul(2).wrapping_add(self.side.index() as u64);
        let photograph = render(&view, seed.wrapping_add(self.frames << 32));
        self.frames += 1;
        Frame {
            image: photograph.image,
            name: format!("{}{}", self.side, self.frames),
            seq: u32::try_from(self.frames).ok(),
            exposed_at: Some(HostInstant { us: self.clock.now().0 as f64, error_us: 0.0 }),
        }
    }
}
