//! Writing a rig file for a pair whose pose is fixed: what an extrinsic calibration ends in.

use serde::Serialize;
use vergence_vision::{Angle, KannalaBrandt, Left, Length, Right, Transform};

use crate::camera_file::{CameraTable, Provenance};

/// A calibrated pair.
#[derive(Clone, Copy, Debug)]
pub struct CalibratedPair<'a> {
    /// What the rig is called.
    pub name: &'a str,
    /// The left camera.
    pub left: &'a KannalaBrandt,
    /// The right camera.
    pub right: &'a KannalaBrandt,
    /// Where the right camera is.
    pub left_from_right: Transform<Left, Right>,
    /// Standard deviation of that rotation and translation.
    pub sigma: (Angle, Length),
    /// Where it comes from.
    pub provenance: &'a Provenance,
}

#[derive(Serialize)]
struct File<'a> {
    name: &'a str,
    calibration_sigma: Sigma,
    left: Side,
    right: Side,
    provenance: &'a Provenance,
}

#[derive(Serialize)]
struct Sigma {
    rotation: String,
    translation: String,
}

#[derive(Serialize)]
struct Side {
    camera: CameraTable,
    #[serde(skip_serializing_if = "Option::is_none")]
    at_zero: Option<Pose>,
}

#[derive(Serialize)]
struct Pose {
    origin: [String; 3],
    rotation_vector: [String; 3],
}

impl CalibratedPair<'_> {
    /// The rig file.
    ///
    /// # Errors
    /// Where TOML cannot say it, in words.
    pub fn to_toml(&self) -> Result<String, String> {
        let origin: [f64; 3] = self.left_from_right.origin().mm().into();
        let turn: [f64; 3] = self.left_from_right.rotation().scaled_axis().into();
        let at_zero = Pose {
            origin: origin.map(|mm| format!("{mm:?}mm")),
            rotation_vector: turn.map(|rad| format!("{rad:?}rad")),
        };
        let file = File {
            name: self.name,
            calibration_sigma: Sigma {
                rotation: format!("{:?}deg", self.sigma.0.deg()),
                translation: format!("{:?}mm", self.sigma.1.mm()),
            },
            left: Side { camera: CameraTable::of(self.left), at_zero: None },
            right: Side { camera: CameraTable::of(self.right), at_zero: Some(at_zero) },
            provenance: self.provenance,
        };
        toml::to_string(&file).map_err(|error| error.to_string())
    }
}
