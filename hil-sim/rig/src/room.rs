//! The simulated room, and cameras that photograph it from the mechanics.

use std::sync::Arc;

use image::RgbImage;
use nalgebra::{UnitQuaternion, Vector3};
use vergence_rig::RigPose;
use vergence_scene::{Lens, Optics, RayTable, Scene, View, render, render_quick, render_rolling};
use vergence_vision::{Base, Camera, KannalaBrandt, Left, Length, Pixel, Right, Side, Transform, World};

/// A furnished room with the rig in it.
#[derive(Clone, Debug)]
pub struct Room {
    /// Walls, furniture and lights.
    pub scene: Scene,
    /// Pose of the rig's base in the room.
    pub world_from_base: Transform<World, Base>,
}

impl Room {
    /// The room of [`Scene::room`] with the rig in its middle: half of the bench's nominal baseline of 145 mm is left of it.
    #[must_use]
    pub fn with_rig() -> Self {
        let middle = Vector3::new(-72.5, 0.0, 0.0);
        Self { scene: Scene::room(), world_from_base: Transform::new(UnitQuaternion::identity(), middle) }
    }

    /// Pose of the left camera in the room.
    #[must_use]
    pub fn world_from_left(&self, base_from_left: Transform<Base, Left>) -> Transform<World, Left> {
        self.world_from_base * base_from_left
    }

    /// Pose in the room of the camera on `side` of a rig.
    #[must_use]
    pub fn world_from_camera(&self, side: Side, pose: &RigPose) -> Transform<World, Camera> {
        self.world_from(side, (pose.base_from_left, pose.left_from_right))
    }

    /// The same with the cameras at these poses.
    pub(crate) fn world_from(
        &self,
        side: Side,
        (base_from_left, left_from_right): (Transform<Base, Left>, Transform<Left, Right>),
    ) -> Transform<World, Camera> {
        let world_from_left = self.world_from_left(base_from_left);
        match side {
            Side::Left => world_from_left.renamed(),
            Side::Right => (world_from_left * left_from_right).renamed(),
        }
    }
}

/// A camera on the mechanics that photographs the room.
#[derive(Clone, Debug)]
pub struct RoomCamera<L: Lens = KannalaBrandt> {
    /// Side of the rig.
    pub side: Side,
    /// Lens and sensor geometry: an ideal lens, or a traced one.
    pub lens: L,
    /// The room.
    pub room: Arc<Room>,
    /// Seed of the image noise.
    pub seed: u64,
}

impl<L: Lens> RoomCamera<L> {
    /// Image from a rig pose, the `number`th of this camera, all rows exposed at once.
    #[must_use]
    pub fn photograph(&self, pose: &RigPose, number: u32) -> RgbImage {
        render(&self.view(self.room.world_from_camera(self.side, pose), &Optics::default()), self.noise(number)).image
    }

    /// Image of a rolling shutter, the `number`th of this camera; `world_from_row` gives the camera's pose at the exposure
    /// of a row.
    #[must_use]
    pub fn photograph_rows(
        &self,
        number: u32,
        world_from_row: &(dyn Fn(u32) -> Transform<World, Camera> + Sync),
    ) -> RgbImage {
        render_rolling(&self.view(world_from_row(0), &Optics::default()), self.noise(number), world_from_row).image
    }

    /// What [`Self::photograph_quick`] needs of the lens.
    #[must_use]
    pub fn ray_table(&self) -> RayTable {
        RayTable::new(&self.lens, &Optics::default())
    }

    /// As [`Self::photograph_rows`], in real time: fewer rays, `table` is the camera's.
    #[must_use]
    pub fn photograph_quick(
        &self,
        table: &RayTable,
        number: u32,
        world_from_row: &(dyn Fn(u32) -> Transform<World, Camera> + Sync),
    ) -> RgbImage {
        render_quick(&self.view(world_from_row(0), &Optics::default()), table, self.noise(number), world_from_row)
    }

    /// How far from the camera's origin the place is that a pixel shows from a rig pose; `None` outside the field and where nothing is met.
    #[must_use]
    pub fn true_range(&self, pose: &RigPose, pixel: Pixel) -> Option<Length> {
        self.view(self.room.world_from_camera(self.side, pose), &Optics::default()).true_range(pixel)
    }

    fn view<'a>(&'a self, world_from_camera: Transform<World, Camera>, optics: &'a Optics) -> View<'a> {
        View { scene: &self.room.scene, camera: &self.lens, world_from_camera, optics }
    }

    /// Seed of the noise of one image: each camera and image has its own.
    fn noise(&self, number: u32) -> u64 {
        let camera = self.seed.wrapping_mul(2).wrapping_add(self.side.index() as u64);
        camera.wrapping_add(u64::from(number) << 32)
    }
}
