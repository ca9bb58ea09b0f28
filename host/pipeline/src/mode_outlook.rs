//! What a mode of the rig would offer, before it is entered: coverage, and how well walls and a target would be measured.

use nalgebra::Vector3;
use vergence_alignment::{MatchErrors, fuse_pose};
use vergence_rig::{DepthField, Mode, ModeFigures, Rig, RigPose, TaskState};
use vergence_vision::{Angle, Base, Length, Pixel, PixelPair, PlacedCamera, Point, StereoPair, Zones, ZonesError};

use crate::limits::PIXEL_SIGMA;
use crate::pose_source::{joints_suffice, with_fused};
use crate::zones::rig_zones;

/// Distance at which the matches of a prediction are put.
const SURROUNDINGS: Length = Length::from_mm(800.0);
/// Distance of their directions, in degrees: some hundred and fifty where both cameras see half of the horizon.
const SPACING: f64 = 10.0;

/// The prediction for one mode.
#[derive(Clone, Debug)]
pub struct ModeOutlook<'a> {
    /// Name of the mode.
    pub name: String,
    /// What both cameras cover.
    pub zones: Zones,
    field: DepthField<'a>,
}

impl<'a> ModeOutlook<'a> {
    /// Predicts for `mode` of `rig`. Where the joints would tell the pose too badly, matches all around at 800 mm are taken to tell
    /// it as they will when the mode is entered.
    ///
    /// # Errors
    /// [`ZonesError`] where the mode has no zones.
    pub fn of(rig: &'a Rig, mode: &Mode) -> Result<Self, ZonesError> {
        let values: Vec<f64> = mode.targets.iter().map(|target| target.value()).collect();
        let by_joints = rig.pose_read_at(&values);
        let pose = expected_pose(rig, by_joints);
        let zones = rig_zones(rig, &pose)?;
        Ok(Self { name: mode.name.clone(), zones, field: DepthField::of_pose(rig, pose, PIXEL_SIGMA) })
    }

    /// Standard deviation of the rotation that is expected in the mode.
    #[must_use]
    pub fn rotation_sigma(&self) -> Angle {
        self.field.pose().rotation_sigma
    }

    /// The figures in a state, with `change_s` seconds to enter the mode.
    #[must_use]
    pub fn figures(&self, state: &TaskState, change_s: f64) -> ModeFigures {
        let covered = self.zones.stereo.deg() + self.zones.mono.deg();
        let walls: [Option<Length>; 2] =
            std::array::from_fn(|side| self.wall_sigma(state.walls[side], if side == 0 { -1.0 } else { 1.0 }));
        let worse = |[left, right]: [Option<Length>; 2]| Some(Length::from_mm(left?.mm().max(right?.mm())));
        let target = state.target.and_then(|target| self.field.at(target.azimuth, Angle::from_rad(0.0), target.range));
        ModeFigures {
            blind_share: (1.0 - covered / 360.0).clamp(0.0, 1.0),
            wall_sigma: worse(walls),
            target_sigma: target.map(|predicted| predicted.sigma_range),
            change_s,
        }
    }

    /// Standard deviation of the distance of a wall, by the direction that measures it best.
    fn wall_sigma(&self, distance: Length, side: f64) -> Option<Length> {
        let across = |degrees: u32| {
            let azimuth = Angle::from_deg(side * f64::from(degrees));
            let range = Length::from_mm(distance.mm() / azimuth.rad().sin().abs());
            let predicted = self.field.at(azimuth, Angle::from_rad(0.0), range)?;
            Some(predicted.covariance[(0, 0)].max(0.0).sqrt())
        };
        (20..=90).step_by(5).filter_map(across).min_by(f64::total_cmp).map(Length::from_mm)
    }
}

/// The pose that joints and matches would tell together.
fn expected_pose(rig: &Rig, by_joints: RigPose) -> RigPose {
    if joints_suffice(rig, &by_joints) {
        return by_joints;
    }
    let pair =
        StereoPair { left: &rig.left_camera, right: &rig.right_camera, left_from_right: by_joints.left_from_right };
    let fused = fuse_pose(&expected_matches(rig, &by_joints), &pair, &by_joints.covariance(), MatchErrors::Stated);
    fused.map_or_else(|| by_joints.clone(), |fused| with_fused(&by_joints, &fused))
}

/// Exact matches in directions all around that both cameras see.
fn expected_matches(rig: &Rig, pose: &RigPose) -> Vec<(PixelPair, f64)> {
    let field = DepthField::of_pose(rig, pose.clone(), PIXEL_SIGMA);
    let [left, right] = field.cameras();
    let middle = field.middle().mm();
    let steps = |most: f64| {
        let count = (2.0 * most / SPACING).round() as u32;
        (0..=count).map(move |step| (f64::from(step) * SPACING - most).to_radians())
    };
    let directions = steps(90.0).flat_map(|azimuth| steps(60.0).map(move |elevation| [azimuth, elevation]));
    let matched = directions.filter_map(|[azimuth, elevation]| {
        let way = Vector3::new(azimuth.sin() * elevation.cos(), -elevation.sin(), azimuth.cos() * elevation.cos());
        let point = Point::<Base>::from_mm(middle + way * SURROUNDINGS.mm());
        let pixels = PixelPair { left: pixel(&left, &point)?, right: pixel(&right, &point)? };
        Some((pixels, PIXEL_SIGMA))
    });
    matched.collect()
}

fn pixel(camera: &PlacedCamera<'_>, point: &Point<Base>) -> Option<Pixel> {
    let in_camera = camera.base_from_camera.inverse() * *point;
    camera.lens.project_point(&in_camera).ok()
}
