//! Values of the `[trunk]` table: lengths and angles in text, the mounts of the cameras, and the tolerances of the drawing.

use std::f64::consts::PI;

use serde::{Deserialize, Serialize};
use vergence_vision::{Angle, Length};

use super::{RigError, contradiction};
use crate::linkage::CameraMount;
use crate::trunk::TrunkTolerance;

/// Longest link or offset in millimetres.
pub(super) const LONGEST: f64 = 10_000.0;

/// Where one camera sits: what differs from the mount that both have alike.
#[derive(Default, Deserialize, PartialEq, Serialize)]
#[serde(deny_unknown_fields, default)]
pub(super) struct MountFile {
    #[serde(skip_serializing_if = "Option::is_none")]
    along: Option<String>,
    #[serde(skip_serializing_if = "Option::is_none")]
    outward: Option<String>,
    #[serde(skip_serializing_if = "Option::is_none")]
    height: Option<String>,
    #[serde(skip_serializing_if = "Option::is_none")]
    angle: Option<String>,
    #[serde(skip_serializing_if = "Option::is_none")]
    tilt: Option<String>,
    #[serde(skip_serializing_if = "Option::is_none")]
    roll: Option<String>,
}

impl MountFile {
    pub(super) fn is_empty(&self) -> bool {
        *self == Self::default()
    }

    /// What `mount` has otherwise than `common`.
    pub(super) fn beside(common: &CameraMount, mount: &CameraMount) -> Self {
        let other =
            |text: fn(f64) -> String, common: f64, own: f64| (common.to_bits() != own.to_bits()).then(|| text(own));
        Self {
            along: other(length_text, common.along, mount.along),
            outward: other(length_text, common.outward, mount.outward),
            height: other(length_text, common.height, mount.height),
            angle: other(angle_text, common.angle, mount.angle),
            tilt: other(angle_text, common.tilt, mount.tilt),
            roll: other(angle_text, common.roll, mount.roll),
        }
    }

    /// The mount that this table `name` makes of `common`.
    pub(super) fn mount(&self, name: &str, common: &CameraMount) -> Result<CameraMount, RigError> {
        let far = |key: &str, text: &Option<String>, common: f64| {
            text.as_ref().map_or(Ok(common), |text| length(&format!("{name}.{key}"), text, -LONGEST))
        };
        let turned = |key: &str, text: &Option<String>, common: f64| {
            text.as_ref().map_or(Ok(common), |text| angle(&format!("{name}.{key}"), text))
        };
        Ok(CameraMount {
            along: far("along", &self.along, common.along)?,
            outward: far("outward", &self.outward, common.outward)?,
            height: far("height", &self.height, common.height)?,
            angle: turned("angle", &self.angle, common.angle)?,
            tilt: turned("tilt", &self.tilt, common.tilt)?,
            roll: turned("roll", &self.roll, common.roll)?,
        })
    }
}

/// How far the trunk may be from what the file states, one standard deviation each.
#[derive(Deserialize, Serialize)]
#[serde(deny_unknown_fields, default)]
pub(super) struct ToleranceFile {
    joint_zero: String,
    length: String,
    mount_position: String,
    mount_angle: String,
}

impl Default for ToleranceFile {
    fn default() -> Self {
        Self::of(&TrunkTolerance::default())
    }
}

impl ToleranceFile {
    pub(super) fn of(tolerance: &TrunkTolerance) -> Self {
        Self {
            joint_zero: angle_text(tolerance.joint_zero),
            length: length_text(tolerance.length),
            mount_position: length_text(tolerance.mount_position),
            mount_angle: angle_text(tolerance.mount_angle),
        }
    }

    /// Every tolerance must be positive: a calibration needs all of them.
    pub(super) fn tolerance(&self) -> Result<TrunkTolerance, RigError> {
        let above_zero = |key: &str, text: &str, value: f64| {
            if value > 0.0 {
                Ok(value)
            } else {
                Err(contradiction(format!("[trunk] tolerance.{key}: {text} must be above zero; make it small instead")))
            }
        };
        let turned = |key: &str, text: &str| above_zero(key, text, angle(&format!("tolerance.{key}"), text)?);
        let far = |key: &str, text: &str| above_zero(key, text, length(&format!("tolerance.{key}"), text, 0.0)?);
        Ok(TrunkTolerance {
            joint_zero: turned("joint_zero", &self.joint_zero)?,
            length: far("length", &self.length)?,
            mount_position: far("mount_position", &self.mount_position)?,
            mount_angle: turned("mount_angle", &self.mount_angle)?,
        })
    }
}

pub(super) fn length_text(mm: f64) -> String {
    format!("{mm:?}mm")
}

/// Degrees where they are the same angle, so that people can read them.
pub(super) fn angle_text(rad: f64) -> String {
    let degrees = (rad.to_degrees() * 1e9).round() / 1e9;
    if Angle::from_deg(degrees).rad().to_bits() == rad.to_bits() {
        format!("{degrees:?}deg")
    } else {
        format!("{rad:?}rad")
    }
}

pub(super) fn length(key: &str, text: &str, least: f64) -> Result<f64, RigError> {
    let parsed: Length = text.parse().map_err(|error| contradiction(format!("[trunk] {key}: {error}")))?;
    let mm = parsed.mm();
    if (least..=LONGEST).contains(&mm) {
        return Ok(mm);
    }
    Err(contradiction(format!("[trunk] {key}: {mm} mm is not from {least} mm to {LONGEST} mm")))
}

pub(super) fn angle(key: &str, text: &str) -> Result<f64, RigError> {
    let parsed: Angle = text.parse().map_err(|error| contradiction(format!("[trunk] {key}: {error}")))?;
    let rad = parsed.rad();
    if rad.abs() <= 2.0 * PI {
        return Ok(rad);
    }
    Err(contradiction(format!("[trunk] {key}: {text} is more than a turn")))
}

pub(super) fn not_negative(key: &str, text: &str) -> Result<f64, RigError> {
    let rad = angle(key, text)?;
    if rad >= 0.0 { Ok(rad) } else { Err(contradiction(format!("[trunk] {key}: {text} is negative"))) }
}

pub(super) fn positive(key: &str, text: &str) -> Result<f64, RigError> {
    let rad = angle(key, text)?;
    if rad > 0.0 {
        Ok(rad)
    } else {
        Err(contradiction(format!("[trunk] {key}: {text} must be above zero, in angle per second")))
    }
}
