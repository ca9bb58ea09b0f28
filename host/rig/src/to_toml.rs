//! Printing of rig files, as calibrations write them.

use std::collections::BTreeMap;

use serde::Serialize;
use vergence_protocol::AxisKind;
use vergence_vision::{Angle, Frame, KannalaBrandt, Length};

use crate::axis::{AxisPosition, RigAxis};
use crate::calibration::{CalibrationTables, RigCalibration};
use crate::camera_file::{CameraTable, Provenance};
use crate::chain::{Chain, Link, Screw};
use crate::exposure::Shutter;
use crate::file::TrunkFile;
use crate::mask::CameraMask;
use crate::rig::Rig;

#[derive(Serialize)]
struct File<'a> {
    name: &'a str,
    axis: Vec<Axis<'a>>,
    modes: BTreeMap<&'a str, ModeTable<'a>>,
    #[serde(skip_serializing_if = "Option::is_none")]
    repeatability: Option<Sigma>,
    #[serde(skip_serializing_if = "Option::is_none")]
    calibration_sigma: Option<Sigma>,
    #[serde(skip_serializing_if = "Option::is_none")]
    calibration: Option<CalibrationTables>,
    #[serde(skip_serializing_if = "Option::is_none")]
    trunk: Option<TrunkFile>,
    left: Side<'a>,
    right: Side<'a>,
    provenance: &'a Provenance,
}

#[derive(Serialize)]
struct Axis<'a> {
    name: &'a str,
    kind: &'static str,
    range: [String; 2],
    #[serde(skip_serializing_if = "Option::is_none")]
    calibrated: Option<[String; 2]>,
    #[serde(skip_serializing_if = "Option::is_none")]
    counts_per_metre: Option<u32>,
    #[serde(skip_serializing_if = "Option::is_none")]
    counts_per_revolution: Option<u32>,
    #[serde(skip_serializing_if = "Option::is_none")]
    play: Option<String>,
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pitch_error: Vec<[String; 2]>,
    #[serde(skip_serializing_if = "Option::is_none")]
    zero: Option<String>,
    #[serde(skip_serializing_if = "std::ops::Not::not")]
    reversed: bool,
}

#[derive(Serialize)]
struct ModeTable<'a> {
    number: u8,
    #[serde(flatten)]
    positions: BTreeMap<&'a str, String>,
}

#[derive(Serialize)]
struct Sigma {
    rotation: String,
    translation: String,
}

#[derive(Serialize)]
struct Side<'a> {
    #[serde(skip_serializing_if = "Option::is_none")]
    mask: Option<&'a CameraMask>,
    camera: CameraTable,
    #[serde(skip_serializing_if = "Option::is_none")]
    at_zero: Option<Pose>,
    #[serde(skip_serializing_if = "Vec::is_empty")]
    screw: Vec<ScrewTable<'a>>,
}

#[derive(Serialize)]
struct Pose {
    origin: [String; 3],
    rotation_vector: [String; 3],
}

#[derive(Serialize)]
struct ScrewTable<'a> {
    axis: &'a str,
    share: f64,
    #[serde(skip_serializing_if = "Option::is_none")]
    slide_along: Option<[f64; 3]>,
    #[serde(skip_serializing_if = "Option::is_none")]
    turn_about: Option<[f64; 3]>,
    #[serde(skip_serializing_if = "Option::is_none")]
    through: Option<[String; 3]>,
}

impl Rig {
    /// Prints the rig file from which [`Rig::from_toml`] makes this rig, with its `provenance`.
    ///
    /// # Errors
    /// The message of the TOML writer.
    pub fn to_toml(&self, provenance: &Provenance) -> Result<String, String> {
        let name = |axis: &usize| self.axes.get(*axis).map_or("", |axis| axis.name.as_str());
        let positions = |targets: &[AxisPosition]| -> BTreeMap<&str, String> {
            self.axes.iter().zip(targets).map(|(axis, &target)| (axis.name.as_str(), position(target))).collect()
        };
        let file = File {
            name: &self.name,
            axis: self.axes.iter().map(axis).collect(),
            modes: self
                .modes
                .iter()
                .map(|mode| {
                    let positions = positions(&mode.targets);
                    (mode.name.as_str(), ModeTable { number: mode.number.0, positions })
                })
                .collect(),
            repeatability: self
                .repeatability
                .map(|found| Sigma { rotation: angle(found.rotation), translation: length(found.translation) }),
            calibration_sigma: match self.calibration {
                RigCalibration::Sigmas { rotation, translation } => {
                    Some(Sigma { rotation: angle(rotation), translation: length(translation) })
                }
                _ => None,
            },
            calibration: CalibrationTables::of(self),
            trunk: self.trunk.as_ref().map(|trunk| TrunkFile::of(trunk, trunk.axes.map(|axis| name(&axis)))),
            left: Side {
                mask: self.masks[0].as_ref(),
                ..side(table(&self.left_camera, self.shutters[0]), &self.left_chain, &name, self.trunk.is_none())
            },
            right: Side {
                mask: self.masks[1].as_ref(),
                ..side(table(&self.right_camera, self.shutters[1]), &self.right_chain, &name, self.trunk.is_none())
            },
            provenance,
        };
        toml::to_string(&file).map_err(|error| error.to_string())
    }
}

fn table(camera: &KannalaBrandt, shutter: Shutter) -> CameraTable {
    CameraTable::of(camera).with_shutter(shutter)
}

fn axis(axis: &RigAxis) -> Axis<'_> {
    let scale_of = |kind: AxisKind| (axis.kind == kind).then_some(axis.counts_per_unit);
    Axis {
        name: &axis.name,
        kind: if axis.kind == AxisKind::Linear { "linear" } else { "rotary" },
        range: axis.range.map(position),
        calibrated: axis.calibrated.map(|ends| ends.map(position)),
        counts_per_metre: scale_of(AxisKind::Linear),
        counts_per_revolution: scale_of(AxisKind::Rotary),
        pitch_error: axis
            .pitch
            .entries()
            .iter()
            .map(|entry| entry.map(|value| position(AxisPosition::from_value(axis.kind, value))))
            .collect(),
        zero: (axis.zero != 0.0).then(|| position(AxisPosition::from_value(axis.kind, axis.zero))),
        reversed: axis.reversed,
        play: (axis.play > 0.0).then(|| position(AxisPosition::from_value(axis.kind, axis.play))),
    }
}

fn side<'a, C: Frame>(
    camera: CameraTable,
    chain: &Chain<C>,
    name: &impl Fn(&usize) -> &'a str,
    is_placed: bool,
) -> Side<'a> {
    let at_zero = chain.at_zero();
    let (origin, turn): ([f64; 3], [f64; 3]) = (at_zero.origin().mm().into(), at_zero.rotation().scaled_axis().into());
    let screw = |Link { axis, share, screw }: &Link| {
        let (slide_along, turn_about, through) = match screw {
            Screw::Slide { along } => (Some(along.into_inner().into()), None, None),
            Screw::Turn { about, through } => {
                let point: [f64; 3] = through.mm().into();
                (None, Some(about.into_inner().into()), Some(point.map(|mm| length(Length::from_mm(mm)))))
            }
        };
        ScrewTable { axis: name(axis), share: *share, slide_along, turn_about, through }
    };
    Side {
        mask: None,
        camera,
        at_zero: is_placed.then(|| Pose {
            origin: origin.map(|mm| length(Length::from_mm(mm))),
            rotation_vector: turn.map(|rad| format!("{rad:?}rad")),
        }),
        screw: chain.links().iter().map(screw).collect(),
    }
}

fn position(position: AxisPosition) -> String {
    match position {
        AxisPosition::Linear(value) => length(value),
        AxisPosition::Rotary(value) => angle(value),
    }
}

fn length(length: Length) -> String {
    format!("{:?}mm", length.mm())
}

/// Prints an angle in degrees where that gives the same angle to the last bit, otherwise in radians.
fn angle(angle: Angle) -> String {
    let degrees = (angle.deg() * 1e9).round() / 1e9;
    if Angle::from_deg(degrees).rad().to_bits() == angle.rad().to_bits() {
        format!("{degrees:?}deg")
    } else {
        format!("{:?}rad", angle.rad())
    }
}
