//! What the cameras of a rig cover in a pose.

use nalgebra::Vector3;
use vergence_rig::{Rig, RigPose};
use vergence_vision::{
    Angle, Base, BodyMask, Camera, KannalaBrandt, Length, PlacedCamera, PlanarCamera, Point, Transform, Zones,
    ZonesError, zones_exact,
};

/// Radius of the circle on which reports give the zones: that of the paper's precision bench.
pub const ZONE_RADIUS: Length = Length::from_mm(350.0);

/// Both cameras of a rig in one pose, and the point midway between them.
#[derive(Clone, Debug)]
pub struct RigView<'a> {
    /// The left and the right camera.
    pub cameras: [PlacedCamera<'a>; 2],
    /// The point midway between the optical centres.
    pub middle: Point<Base>,
}

impl<'a> RigView<'a> {
    /// The cameras of `rig` at `pose`; `masks` (left, right) say where the robot itself hides the view.
    #[must_use]
    pub fn new(rig: &'a Rig, pose: &RigPose, masks: [Option<&'a BodyMask>; 2]) -> Self {
        let camera = |lens: &'a KannalaBrandt, base_from_camera: Transform<Base, Camera>, body| PlacedCamera {
            lens,
            base_from_camera,
            body,
        };
        let base_from_right = pose.base_from_left * pose.left_from_right;
        let [left_mask, right_mask] = masks;
        Self {
            cameras: [
                camera(&rig.left_camera, pose.base_from_left.renamed(), left_mask),
                camera(&rig.right_camera, base_from_right.renamed(), right_mask),
            ],
            middle: Point::from_mm((pose.base_from_left.origin().mm() + base_from_right.origin().mm()) / 2.0),
        }
    }

    /// Both cameras from above: where the axes point, and the lenses' cones. Places are relative to the middle.
    #[must_use]
    pub fn from_above(&self) -> [PlanarCamera; 2] {
        self.cameras.each_ref().map(|camera| {
            let centre = camera.base_from_camera.origin().mm() - self.middle.mm();
            let axis = camera.base_from_camera.rotation() * Vector3::z();
            PlanarCamera {
                centre_mm: [centre.x, centre.z],
                axis: Angle::from_rad(axis.x.atan2(axis.z)),
                half_field: camera.lens.theta_max(),
            }
        })
    }

    /// Which cameras (left, right) see a place in the horizontal plane: millimetres right and forward of the middle.
    #[must_use]
    pub fn sees(&self, [x, forward]: [f64; 2]) -> [bool; 2] {
        let place = Point::from_mm(self.middle.mm() + Vector3::new(x, 0.0, forward));
        self.cameras.each_ref().map(|camera| camera.sees(&place))
    }
}

/// The zones on a circle of [`ZONE_RADIUS`] in the horizontal plane, around the middle between both cameras.
///
/// # Errors
/// Fails if a camera stands outside the circle.
pub fn rig_zones(rig: &Rig, pose: &RigPose) -> Result<Zones, ZonesError> {
    Ok(zones_exact(RigView::new(rig, pose, [None, None]).from_above(), ZONE_RADIUS)?.zones)
}
