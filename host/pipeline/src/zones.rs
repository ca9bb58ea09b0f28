//! What the cameras of a rig cover in a pose.

use nalgebra::Vector3;
use vergence_rig::{Rig, RigPose};
use vergence_vision::{Angle, Length, PlanarCamera, Zones, ZonesError, zones_exact};

/// Radius of the circle on which reports give the zones: that of the paper's precision bench.
pub const ZONE_RADIUS: Length = Length::from_mm(350.0);

/// The zones on a circle of [`ZONE_RADIUS`] in the horizontal plane, around the middle between both cameras.
///
/// # Errors
/// Fails if a camera stands outside the circle.
pub fn rig_zones(rig: &Rig, pose: &RigPose) -> Result<Zones, ZonesError> {
    let base_from_right = pose.base_from_left * pose.left_from_right;
    let centres = [pose.base_from_left.origin().mm(), base_from_right.origin().mm()];
    let axes = [pose.base_from_left.rotation(), base_from_right.rotation()].map(|r| r * Vector3::z());
    let middle = (centres[0] + centres[1]) / 2.0;
    let half_fields = [rig.left_camera.theta_max(), rig.right_camera.theta_max()];
    let camera = |index: usize| {
        let (centre, axis) = (centres[index] - middle, axes[index]);
        PlanarCamera {
            centre_mm: [centre.x, centre.z],
            axis: Angle::from_rad(axis.x.atan2(axis.z)),
            half_field: half_fields[index],
        }
    };
    Ok(zones_exact([camera(0), camera(1)], ZONE_RADIUS)?.zones)
}
