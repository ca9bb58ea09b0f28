//! The `[trunk]` table of a rig file: a folding trunk that carries the cameras.

use std::f64::consts::PI;

use serde::{Deserialize, Serialize};
use vergence_protocol::AxisKind;
use vergence_vision::{Angle, Length};

use super::{RigError, contradiction};
use crate::axis::RigAxis;
use crate::linkage::{CornerLimits, TrunkBodies, TrunkCameras, TrunkLinks};
use crate::trunk::{RigTrunk, TRUNK_AXES};

/// Longest link or offset in millimetres.
const LONGEST: f64 = 10_000.0;

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
        };
        Self::of(&trunk, names)
    }
}

impl TrunkFile {
    /// The table of `trunk`, whose driven joints have axes with these `names`.
    pub(crate) fn of(trunk: &RigTrunk, names: [&str; TRUNK_AXES]) -> Self {
        let [front_corner, side_joint, rear_corner, rear_fold, front_fold] = names.map(str::to_owned);
        let length = |mm: f64| format!("{mm:?}mm");
        // Degrees where they are the same angle, so that people can read them.
        let angle = |rad: f64| {
            let degrees = (rad.to_degrees() * 1e9).round() / 1e9;
            if Angle::from_deg(degrees).rad().to_bits() == rad.to_bits() {
                format!("{degrees:?}deg")
            } else {
                format!("{rad:?}rad")
            }
        };
        let (links, cameras, limits) = (&trunk.links, &trunk.cameras, &trunk.limits);
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
            camera_along: length(cameras.along),
            camera_outward: length(cameras.outward),
            camera_angle: angle(cameras.angle),
            camera_diameter: length(2.0 * trunk.bodies.camera),
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
        let driven = [found[0], found[1], found[2]].map(|axis| axes[axis].range.map(crate::AxisPosition::value));
        let passive =
            [angle("passive_range", &self.passive_range[0])?, angle("passive_range", &self.passive_range[1])?];
        if passive[0] >= passive[1] {
            return Err(contradiction("[trunk] passive_range: the first angle must be below the second".into()));
        }
        Ok(RigTrunk {
            links,
            cameras: TrunkCameras {
                side,
                along: length("camera_along", &self.camera_along, -LONGEST)?,
                outward: length("camera_outward", &self.camera_outward, -LONGEST)?,
                angle: angle("camera_angle", &self.camera_angle)?,
            },
            bodies: TrunkBodies {
                link: length("link_width", &self.link_width, 0.0)? / 2.0,
                camera: length("camera_diameter", &self.camera_diameter, 0.0)? / 2.0,
            },
            limits: CornerLimits {
                driven,
                passive,
                speed: positive("speed", &self.speed)?,
                acceleration: positive("acceleration", &self.acceleration)?,
                passive_speed: positive("passive_speed", &self.passive_speed)?,
            },
            passive_play: not_negative("passive_play", &self.passive_play)?,
            axes: found,
        })
    }
}

fn joint(key: &str, name: &str, axes: &[RigAxis]) -> Result<usize, RigError> {
    let found = axes.iter().position(|axis| axis.name == name && axis.kind == AxisKind::Rotary);
    found.ok_or_else(|| {
        contradiction(format!("[trunk] {key}: the rig has no rotary axis '{name}'; name one of its axes"))
    })
}

fn length(key: &str, text: &str, least: f64) -> Result<f64, RigError> {
    let parsed: Length = text.parse().map_err(|error| contradiction(format!("[trunk] {key}: {error}")))?;
    let mm = parsed.mm();
    if (least..=LONGEST).contains(&mm) {
        return Ok(mm);
    }
    Err(contradiction(format!("[trunk] {key}: {mm} mm is not from {least} mm to {LONGEST} mm")))
}

fn angle(key: &str, text: &str) -> Result<f64, RigError> {
    let parsed: Angle = text.parse().map_err(|error| contradiction(format!("[trunk] {key}: {error}")))?;
    let rad = parsed.rad();
    if rad.abs() <= 2.0 * PI {
        return Ok(rad);
    }
    Err(contradiction(format!("[trunk] {key}: {text} is more than a turn")))
}

fn not_negative(key: &str, text: &str) -> Result<f64, RigError> {
    let rad = angle(key, text)?;
    if rad >= 0.0 { Ok(rad) } else { Err(contradiction(format!("[trunk] {key}: {text} is negative"))) }
}

fn positive(key: &str, text: &str) -> Result<f64, RigError> {
    let rad = angle(key, text)?;
    if rad > 0.0 {
        Ok(rad)
    } else {
        Err(contradiction(format!("[trunk] {key}: {text} must be above zero, in angle per second")))
    }
}
