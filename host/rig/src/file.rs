//! Parsing of the rig file: TOML with units in the values, where an unknown key is an error.

mod modes;
mod trunk;
mod trunk_values;

use nalgebra::{Unit, UnitQuaternion, Vector3};
use serde::Deserialize;
use vergence_protocol::{AxisKind, MAX_AXES};
use vergence_vision::{Angle, Frame, ImageSize, InvalidLens, KannalaBrandt, Length, Point, Transform};

use self::modes::ModesFile;
pub(crate) use self::trunk::TrunkFile;
use crate::axis::{AxisPosition, RigAxis};
use crate::calibration::{CalibrationTables, RigCalibration, SigmaFile};
use crate::camera_file::{CameraTable, Provenance};
use crate::chain::{Chain, Link, Screw};
use crate::mask::{CameraMask, mask_of};
use crate::pitch::PitchTable;
use crate::rig::Rig;
use crate::text::quantities;
use crate::trunk::RigTrunk;

/// The reason why a rig file is refused.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum RigError {
    /// The text is not TOML, a key is missing or unknown, or a value has the wrong form. The message names the line.
    #[error("{0}")]
    Syntax(String),
    /// The parameters of a camera describe no lens.
    #[error("[{camera}.camera]: {lens}")]
    Camera {
        /// `left` or `right`.
        camera: &'static str,
        /// The reason why the lens is refused.
        lens: InvalidLens,
    },
    /// A value is out of its range or contradicts another; the message names both.
    #[error("{0}")]
    Contradiction(String),
}

/// Largest position in micrometres or microradians. Positions and margins beyond them fit the wire's 32 bits.
const LONGEST: u32 = 100_000_000;

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct RigFile {
    name: String,
    #[serde(default)]
    axis: Vec<AxisFile>,
    #[serde(default)]
    modes: ModesFile,
    left: SideFile,
    right: SideFile,
    trunk: Option<TrunkFile>,
    repeatability: Option<SigmaFile>,
    calibration_sigma: Option<SigmaFile>,
    calibration: Option<CalibrationTables>,
    /// Information for people; nothing depends on it.
    #[serde(default)]
    #[allow(dead_code, reason = "checked for its form only")]
    provenance: Option<Provenance>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct AxisFile {
    name: String,
    kind: KindFile,
    range: [String; 2],
    calibrated: Option<[String; 2]>,
    counts_per_metre: Option<u32>,
    counts_per_revolution: Option<u32>,
    play: Option<String>,
    pitch_error: Option<Vec<[String; 2]>>,
    zero: Option<String>,
    #[serde(default)]
    reversed: bool,
}

#[derive(Clone, Copy, Deserialize)]
#[serde(rename_all = "lowercase")]
enum KindFile {
    Linear,
    Rotary,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct SideFile {
    camera: CameraTable,
    mask: Option<CameraMask>,
    #[serde(default)]
    at_zero: PoseFile,
    #[serde(default)]
    screw: Vec<ScrewFile>,
}

#[derive(Default, Deserialize, PartialEq)]
#[serde(deny_unknown_fields, default)]
struct PoseFile {
    #[serde(deserialize_with = "quantities")]
    origin: [Length; 3],
    #[serde(deserialize_with = "quantities")]
    rotation_vector: [Angle; 3],
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct ScrewFile {
    axis: String,
    share: f64,
    slide_along: Option<[f64; 3]>,
    turn_about: Option<[f64; 3]>,
    #[serde(default, deserialize_with = "quantities")]
    through: [Length; 3],
}

impl Rig {
    /// Parses and checks the content of a rig file.
    ///
    /// ```
    /// # use vergence_rig::{BENCH_TOML, Rig};
    /// let rig = Rig::from_toml(BENCH_TOML)?;
    /// let herbivore = rig.mode("herbivore").expect("a mode of the bench");
    /// assert_eq!(herbivore.targets[0].to_string(), "145.000 mm");
    /// # Ok::<(), vergence_rig::RigError>(())
    /// ```
    ///
    /// # Errors
    /// [`RigError`] names the key or value and what is wrong with it.
    pub fn from_toml(text: &str) -> Result<Self, RigError> {
        let file: RigFile = toml::from_str(text).map_err(|error| RigError::Syntax(error.to_string()))?;
        if file.axis.len() > MAX_AXES {
            return Err(contradiction(format!("{} axes; a board has at most {MAX_AXES}", file.axis.len())));
        }
        let axes = file.axis.iter().map(axis).collect::<Result<Vec<_>, _>>()?;
        for (index, axis) in axes.iter().enumerate() {
            if axes.iter().take(index).any(|other| other.name == axis.name) {
                return Err(contradiction(format!("two axes are called '{}'", axis.name)));
            }
        }
        if axes.iter().any(|axis| axis.name == modes::NUMBER) {
            return Err(contradiction(format!(
                "an axis cannot be called '{0}': in a mode, {0} is its number",
                modes::NUMBER
            )));
        }
        let trunk = trunk(&file, &axes)?;
        let rig = Self {
            name: file.name,
            modes: modes::modes(&file.modes, &axes)?,
            left_camera: camera("left", &file.left.camera)?,
            right_camera: camera("right", &file.right.camera)?,
            shutters: [&file.left, &file.right].map(|side| side.camera.shutter()),
            masks: [mask("left", &file.left)?, mask("right", &file.right)?],
            left_chain: chain("left", &file.left, &axes)?,
            right_chain: chain("right", &file.right, &axes)?,
            trunk,
            calibration: RigCalibration::Unknown,
            repeatability: file.repeatability.as_ref().map(SigmaFile::repeatability).transpose()?,
            axes,
        };
        let calibration = match (&file.calibration, &file.calibration_sigma) {
            (Some(_), Some(_)) => {
                return Err(contradiction("[calibration] beside [calibration_sigma]: leave one of them out".into()));
            }
            (Some(table), None) => table.calibration(&rig)?,
            (None, Some(sigma)) => sigma.calibration()?,
            (None, None) => RigCalibration::Unknown,
        };
        Ok(Self { calibration, ..rig })
    }
}

/// The trunk, in place of screws and of poses at zero.
fn trunk(file: &RigFile, axes: &[RigAxis]) -> Result<Option<Box<RigTrunk>>, RigError> {
    let Some(table) = &file.trunk else { return Ok(None) };
    for (name, side) in [("left", &file.left), ("right", &file.right)] {
        if !side.screw.is_empty() || side.at_zero != PoseFile::default() {
            return Err(contradiction(format!(
                "[[{name}.screw]] or [{name}.at_zero] beside [trunk]: the trunk carries both cameras; leave these out"
            )));
        }
    }
    table.trunk(axes).map(Box::new).map(Some)
}

fn contradiction(text: String) -> RigError {
    RigError::Contradiction(text)
}

fn position(kind: AxisKind, text: &str, place: &str) -> Result<AxisPosition, RigError> {
    let parsed = match kind {
        AxisKind::Linear => text.parse().map(AxisPosition::Linear),
        AxisKind::Rotary => text.parse().map(AxisPosition::Rotary),
    };
    parsed.map_err(|error| contradiction(format!("{place}: {error}")))
}

fn axis(file: &AxisFile) -> Result<RigAxis, RigError> {
    let name = &file.name;
    let (kind, counts, key) = match file.kind {
        KindFile::Linear => (AxisKind::Linear, file.counts_per_metre, "counts_per_metre"),
        KindFile::Rotary => (AxisKind::Rotary, file.counts_per_revolution, "counts_per_revolution"),
    };
    let other = if kind == AxisKind::Linear { file.counts_per_revolution } else { file.counts_per_metre };
    let counts_per_unit = match (counts, other) {
        (Some(counts), None) if counts > 0 => counts,
        _ => {
            return Err(contradiction(format!("axis '{name}' needs a positive {key}, and no scale of the other kind")));
        }
    };
    let place = format!("range of axis '{name}'");
    let range = interval(kind, &file.range, &place)?;
    let [low, high] = &file.range;
    if range.iter().any(|position| position.micro().0.unsigned_abs() > LONGEST) {
        return Err(contradiction(format!("{place}: {low} to {high} is more than 100 m or 100 rad from zero")));
    }
    let place = format!("calibrated range of axis '{name}'");
    let calibrated = file.calibrated.as_ref().map(|ends| interval(kind, ends, &place)).transpose()?;
    let place = format!("play of axis '{name}'");
    let play = file.play.as_ref().map_or(Ok(0.0), |play| position(kind, play, &place).map(AxisPosition::value))?;
    if !(0.0..=range[1].value() - range[0].value()).contains(&play) {
        return Err(contradiction(format!("{place} must not be negative, nor more than its range")));
    }
    let place = format!("zero of axis '{name}'");
    let zero = file.zero.as_ref().map(|zero| position(kind, zero, &place)).transpose()?;
    if zero.is_some_and(|zero| zero.micro().0.unsigned_abs() > LONGEST) {
        return Err(contradiction(format!("{place} is more than 100 m or 100 rad")));
    }
    let zero = zero.map_or(0.0, AxisPosition::value);
    let pitch = file.pitch_error.as_ref().map_or(Ok(PitchTable::default()), |entries| pitch(kind, entries, name))?;
    Ok(RigAxis {
        name: name.clone(),
        kind,
        range,
        calibrated,
        counts_per_unit,
        play,
        pitch,
        zero,
        reversed: file.reversed,
    })
}

/// Parses a table of pitch errors: positions by the encoder, and how much further the stage is.
fn pitch(kind: AxisKind, entries: &[[String; 2]], name: &str) -> Result<PitchTable, RigError> {
    let place = format!("pitch_error of axis '{name}'");
    let value = |text: &String| position(kind, text, &place).map(AxisPosition::value);
    let entries = entries.iter().map(|[at, error]| Ok([value(at)?, value(error)?])).collect::<Result<_, RigError>>()?;
    PitchTable::new(entries).map_err(|error| contradiction(format!("{place}: {error}")))
}

/// Parses the ends of a range, of which the first must be the lower.
fn interval(kind: AxisKind, [low, high]: &[String; 2], place: &str) -> Result<[AxisPosition; 2], RigError> {
    let ends = [position(kind, low, place)?, position(kind, high, place)?];
    if ends[0].value() >= ends[1].value() {
        return Err(contradiction(format!("{place}: {low} is not below {high}")));
    }
    Ok(ends)
}

fn camera(side: &'static str, table: &CameraTable) -> Result<KannalaBrandt, RigError> {
    table.camera().map_err(|lens| RigError::Camera { camera: side, lens })
}

/// The mask of a camera. Its shapes are checked here, a file when it is read.
fn mask(side: &str, SideFile { mask, camera, .. }: &SideFile) -> Result<Option<CameraMask>, RigError> {
    let [width, height] = camera.size;
    if let Some(CameraMask::Shapes(shapes)) = mask {
        let wrong = |error| contradiction(format!("[[{side}.mask]]: {error}"));
        mask_of(shapes, ImageSize { width, height }).map_err(wrong)?;
    }
    Ok(mask.clone())
}

fn chain<C: Frame>(side: &str, file: &SideFile, axes: &[RigAxis]) -> Result<Chain<C>, RigError> {
    let links = file.screw.iter().map(|screw| link(side, screw, axes)).collect::<Result<_, _>>()?;
    let rotation = UnitQuaternion::from_scaled_axis(Vector3::from(file.at_zero.rotation_vector.map(Angle::rad)));
    let at_zero = Transform::new(rotation, Vector3::from(file.at_zero.origin.map(Length::mm)));
    Ok(Chain { links, at_zero })
}

fn link(side: &str, file: &ScrewFile, axes: &[RigAxis]) -> Result<Link, RigError> {
    let place = format!("[[{side}.screw]] of axis '{}'", file.axis);
    let axis = axes
        .iter()
        .position(|axis| axis.name == file.axis)
        .ok_or_else(|| contradiction(format!("{place}: the rig has no such axis")))?;
    let direction = |xyz: [f64; 3]| {
        Unit::try_new(Vector3::from(xyz), 1e-9)
            .filter(|unit| unit.iter().all(|c| c.is_finite()))
            .ok_or_else(|| contradiction(format!("{place}: the direction must not be zero")))
    };
    let kind = axes.get(axis).map(|axis| axis.kind);
    let screw = match (file.slide_along, file.turn_about, kind) {
        (Some(along), None, Some(AxisKind::Linear)) => Screw::Slide { along: direction(along)? },
        (None, Some(about), Some(AxisKind::Rotary)) => {
            let through = Point::from_mm(Vector3::from(file.through.map(Length::mm)));
            Screw::Turn { about: direction(about)?, through }
        }
        _ => {
            let rule = "a linear axis needs slide_along, a rotary one turn_about, and not both";
            return Err(contradiction(format!("{place}: {rule}")));
        }
    };
    if !file.share.is_finite() {
        return Err(contradiction(format!("{place}: share must be a finite number")));
    }
    Ok(Link { axis, share: file.share, screw })
}
