//! What the rays through the centres of the pixels meet, kept for the next image: while neither the camera nor what it sees moves, it is the same.

use vergence_vision::{Camera, Transform, World};

use crate::Scene;
use crate::light::Lighting;
use crate::quick_canvas::Canvas;
use crate::scene::Solid;
use crate::sight::Sight;
use crate::texture::Rgb;

/// What the rays meet, and of what that is.
#[derive(Clone, Debug)]
pub struct Glance {
    /// What the rays meet.
    pub canvas: Canvas,
    /// What may be seen from there.
    pub sight: Sight,
    /// The pose of the camera at the exposure of each row.
    poses: Vec<Transform<World, Camera>>,
    solids: Vec<Solid>,
    lighting: Lighting,
    backdrop: Rgb,
}

impl Glance {
    /// A canvas that shows this scene from where each row sees it.
    pub fn new(canvas: Canvas, sight: Sight, scene: &Scene, poses: Vec<Transform<World, Camera>>) -> Self {
        let (solids, lighting, backdrop) = (scene.solids.clone(), scene.lighting.clone(), scene.backdrop);
        Self { canvas, sight, poses, solids, lighting, backdrop }
    }

    /// Whether it is also what this scene shows from these poses of the rows.
    pub fn is_of(&self, scene: &Scene, poses: &[Transform<World, Camera>]) -> bool {
        self.poses == poses
            && self.backdrop.map(f32::to_bits) == scene.backdrop.map(f32::to_bits)
            && self.lighting == scene.lighting
            && self.solids == scene.solids
    }
}
