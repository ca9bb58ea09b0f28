//! The `[trunk]` table of a rig file: a folding trunk that carries the cameras.

use serde::{Deserialize, Serialize};
use vergence_protocol::AxisKind;

use super::trunk_values::{
    LONGEST, MountFile, ToleranceFile, angle, angle_text, length, length_text, not_negative, positive,
};
use super::{RigError, contradiction};
use crate::axis::RigAxis;
use crate::linkage::{CameraMount, CornerLimits, TrunkBodies, TrunkCameras, TrunkLinks};
use crate::trunk::{RigTrunk, TRUNK_AXES, TRUNK_PARAMETERS, TrunkCovariance, TrunkTolerance};

/// Keys of the table; each has the value of the paper's robot where it is left out.
#[derive(Deserialize, Serialize)]
#[serde(deny_unknown_fields, default)]
pub(crate) struct TrunkFile {
    front_corner: String,
    side_joint: String,
    rear_corner: String,
    rear_fold: String,
    front_fold: String,
    side: String,
    half_end: String,
    fold_offset: String,
    link_width: String,
    passive_play: String,
    passive_range: [String; 2],
    speed: String,
    acceleration: String,
    passive_speed: String,
    camera_along: String,
    camera_outward: String,
    camera_angle: String,
    camera_diameter: String,
    #[serde(skip_serializing_if = "MountFile::is_empty")]
    left_mount: MountFile,
    #[serde(skip_serializing_if = "MountFile::is_empty")]
    right_mount: MountFile,
    tolerance: ToleranceFile,
    #[serde(skip_serializing_if = "Option::is_none")]
    calibration: Option<CalibrationFile>,
}

/// The result of a calibration.
#[derive(Deserialize, Serialize)]
#[serde(deny_unknown_fields)]
struct CalibrationFile {
    /// Lower triangle of the covariance of the parameters, row by row, in radians and millimetres.
    covariance: Vec<Vec<f64>>,
}

impl Default for TrunkFile {
    fn default() -> Self {
        let names = ["front_corner", "side_joint", "rear_corner", "rear_fold", "front_fold"];
        let trunk = RigTrunk {
            links: TrunkLinks::default(),
            cameras: TrunkCameras::default(),
            bodies: TrunkBodies::default(),
            limits: CornerLimits::default(),
            passive_play: 0.2_f64.to_radians(),
            axes: [0, 1, 2, 3, 4],
            tolerance: TrunkTolerance::default(),
            covariance: None,
        };
        Self::of(&trunk, names)
    }
}

impl TrunkFile {
    /// The table of `trunk`, whose driven joints have axes with these `names`.
    pub(crate) fn of(trunk: &RigTrunk, names: [&str; TRUNK_AXES]) -> Self {
        let [front_corner, side_joint, rear_corner, rear_fold, front_fold] = names.map(str::to_owned);
        let (length, angle) = (length_text, angle_text);
        let (links, cameras, limits) = (&trunk.links, &trunk.cameras, &trunk.limits);
        // What both mounts have alike; each has a table for the rest.
        let common = CameraMount { height: 0.0, tilt: 0.0, roll: 0.0, ..cameras.left };
        Self {
            front_corner,
            side_joint,
            rear_corner,
            rear_fold,
            front_fold,
            side: length(links.side),
            half_end: length(links.half_end),
            fold_offset: length(links.fold_offset),
            link_width: length(2.0 * trunk.bodies.link),
            passive_play: angle(trunk.passive_play),
            passive_range: limits.passive.map(angle),
            speed: angle(limits.speed),
            acceleration: angle(limits.acceleration),
            passive_speed: angle(limits.passive_speed),
            camera_along: length(common.along),
            camera_outward: length(common.outward),
            camera_angle: angle(common.angle),
            camera_diameter: length(2.0 * trunk.bodies.camera),
            left_mount: MountFile::beside(&common, &cameras.left),
            right_mount: MountFile::beside(&common, &cameras.right),
            tolerance: ToleranceFile::of(&trunk.tolerance),
            calibration: trunk.covariance.as_ref().map(|covariance| CalibrationFile {
                covariance: (0..TRUNK_PARAMETERS)
                    .map(|row| (0..=row).map(|column| covariance[(row, column)]).collect())
                    .collect(),
            }),
        }
    }

    /// The trunk, whose driven joints are among `axes`.
    pub(super) fn trunk(&self, axes: &[RigAxis]) -> Result<RigTrunk, RigError> {
        let joints = [
            ("front_corner", &self.front_corner),
            ("side_joint", &self.side_joint),
            ("rear_corner", &self.rear_corner),
            ("rear_fold", &self.rear_fold),
            ("front_fold", &self.front_fold),
        ];
        let mut found = [0; TRUNK_AXES];
        for (slot, (key, name)) in found.iter_mut().zip(joints) {
            *slot = joint(key, name, axes)?;
        }
        if axes.len() != TRUNK_AXES || (1..TRUNK_AXES).any(|one| found[..one].contains(&found[one])) {
            return Err(contradiction(format!(
                "[trunk] needs {TRUNK_AXES} rotary axes, one for each driven joint: front_corner, side_joint, rear_corner, \
                 rear_fold, front_fold; the file has {}",
                axes.len()
            )));
        }
        let side = length("side", &self.side, 1.0)?;
        let links = TrunkLinks {
            side,
            half_end: length("half_end", &self.half_end, 1.0)?,
            fold_offset: length("fold_offset", &self.fold_offset, -LONGEST)?,
        };
        let common = CameraMount {
            along: length("camera_along", &self.camera_along, -LONGEST)?,
            outward: length("camera_outward", &self.camera_outward, -LONGEST)?,
            angle: angle("camera_angle", &self.camera_angle)?,
            height: 0.0,
            tilt: 0.0,
            roll: 0.0,
        };
        let range = |axis: usize| axes[axis].range.map(crate::AxisPosition::value);
        let driven = [found[0], found[1], found[2]].map(range);
        let passive =
            [angle("passive_range", &self.passive_range[0])?, angle("passive_range", &self.passive_range[1])?];
        if passive[0] >= passive[1] {
            return Err(contradiction("[trunk] passive_range: the first angle must be below the second".into()));
        }
        Ok(RigTrunk {
            links,
            cameras: TrunkCameras {
                side,
                left: self.left_mount.mount("left_mount", &common)?,
                right: self.right_mount.mount("right_mount", &common)?,
            },
            bodies: TrunkBodies {
                link: length("link_width", &self.link_width, 0.0)? / 2.0,
                camera: length("camera_diameter", &self.camera_diameter, 0.0)? / 2.0,
            },
            limits: CornerLimits {
                driven,
                passive,
                folds: [found[3], found[4]].map(range),
                speed: positive("speed", &self.speed)?,
                acceleration: positive("acceleration", &self.acceleration)?,
                passive_speed: positive("passive_speed", &self.passive_speed)?,
            },
            passive_play: not_negative("passive_play", &self.passive_play)?,
            axes: found,
            tolerance: self.tolerance.tolerance()?,
            covariance: self.calibration.as_ref().map(CalibrationFile::matrix).transpose()?.map(Box::new),
        })
    }
}

impl CalibrationFile {
    /// The covariance, which must be symmetric by its form and positive.
    fn matrix(&self) -> Result<TrunkCovariance, RigError> {
        let place = "[trunk.calibration] covariance";
        let rows = &self.covariance;
        if rows.len() != TRUNK_PARAMETERS || rows.iter().enumerate().any(|(row, numbers)| numbers.len() != row + 1) {
            return Err(contradiction(format!(
                "{place}: it must have {TRUNK_PARAMETERS} rows of 1 to {TRUNK_PARAMETERS} numbers, its lower triangle"
            )));
        }
        let matrix = TrunkCovariance::from_fn(|row, column| rows[row.max(column)][row.min(column)]);
        // Scaled to a unit diagonal first: radians and millimetres differ by orders of magnitude.
        let scale = matrix.diagonal().map(|variance| 1.0 / variance.sqrt());
        let scaled = TrunkCovariance::from_fn(|row, column| matrix[(row, column)] * scale[row] * scale[column]);
        if scaled.iter().all(|value| value.is_finite()) && scaled.cholesky().is_some() {
            return Ok(matrix);
        }
        Err(contradiction(format!(
            "{place}: it is not positive definite; let 'vergence calibrate stage' write it anew"
        )))
    }
}

fn joint(key: &str, name: &str, axes: &[RigAxis]) -> Result<usize, RigError> {
    let found = axes.iter().position(|axis| axis.name == name && axis.kind == AxisKind::Rotary);
    found.ok_or_else(|| {
        contradiction(format!("[trunk] {key}: the rig has no rotary axis '{name}'; name one of its axes"))
    })
}
