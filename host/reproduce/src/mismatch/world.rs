//! The bench as it truly is, with one thing that its calibration does not assume.

use nalgebra::Vector3;
use vergence_calibration::stage_plan;
use vergence_lens::{BuiltIn, Displacement};
use vergence_rig::{AxisPosition, Rig, RigPose, Shutter};
use vergence_scene::{LensChoice, TrueLens};
use vergence_sim::{BentRail, Random};
use vergence_vision::{Angle, KannalaBrandt, Length};

use super::Mismatch;
use crate::bench::Bench;
use crate::drive::{STAGE_POSES, Standing, Stop};
use crate::error::ReproduceError;

/// Axes of the bench.
const BASELINE: usize = 0;
const SEPARATION: usize = 1;

/// Of every element across the axis, and about its vertex.
const DECENTRE: Length = Length::from_mm(0.01);
const ELEMENT_TILT: Angle = Angle::from_deg(0.05);
const SENSOR_TILT: Angle = Angle::from_deg(0.3);
/// How far the middle of the target stands out.
const BOW: Length = Length::from_mm(0.5);
/// The screw moves its carriage by so much more than it should, and back and forth by so many millimetres each turn, which is so many long.
const PITCH_SCALE: f64 = 1e-3;
const PITCH_MM: f64 = 0.03;
const TURN_MM: f64 = 2.0;
/// Width of the play of the separation.
const PLAY: Angle = Angle::from_deg(0.05);
/// How far the middle of the rail is off its ends: the carriage yaws by four times this over the rail's length, at each end.
const SAGITTA: Length = Length::from_mm(0.05);
/// From one row to the next in microseconds, how much longer the file says, and how fast the separation changes.
const LINE_US: f64 = 10.0;
const LINE_OFF: f64 = 0.01;
const SPEED: Angle = Angle::from_deg(30.0);
/// Growth of the focal length.
const BREATHING: f64 = 1e-3;

impl Mismatch {
    /// How large it is here.
    #[must_use]
    pub fn size(self) -> String {
        match self {
            Self::Nothing => "lenses of the calibration's own family, screws as it assumes".into(),
            Self::TracedLens => "lenses traced from the published design".into(),
            Self::Decentre => {
                format!(
                    "every element {:.0} µm off the axis and tilted by {:.2}°",
                    1e3 * DECENTRE.mm(),
                    ELEMENT_TILT.deg()
                )
            }
            Self::SensorTilt => format!("{:.1}° off square to the axis, another way for each eye", SENSOR_TILT.deg()),
            Self::BowedTarget => format!(
                "its middle {:.1} mm out of the plane of its ends, which nobody tells the calibration",
                BOW.mm()
            ),
            Self::ScrewPitch => format!(
                "{:.1} % too long and ±{:.0} µm within each turn of {TURN_MM:.0} mm, unseen by the encoder",
                1e2 * PITCH_SCALE,
                1e3 * PITCH_MM
            ),
            Self::Play => {
                format!("{:.2}° of the separation, anywhere in it at each stop, unseen by the encoder", PLAY.deg())
            }
            Self::RailYaw => {
                format!(
                    "the middle of the rail {:.2} mm off: the right camera yaws by ±{:.2}°",
                    SAGITTA.mm(),
                    yaw().deg()
                )
            }
            Self::RollingShutter => format!(
                "rows {:.1} % faster than the file says, while the separation changes by {:.0}° each second",
                1e2 * LINE_OFF,
                SPEED.deg()
            ),
            Self::Focus => format!("focal length {:.1} % longer than at the calibration", 1e2 * BREATHING),
        }
    }
}

/// How far the carriage yaws at an end of the rail, 160 mm long.
fn yaw() -> Angle {
    Angle::from_rad(4.0 * SAGITTA.mm() / 160.0)
}

/// A bench and everything that is true of it.
pub struct World {
    /// As drawn, which the calibration starts from, and as built.
    pub bench: Bench,
    /// The lenses while they are calibrated.
    pub calibrating: [TrueLens; 2],
    /// The lenses while they measure.
    pub measuring: [TrueLens; 2],
    /// How far the target of the calibration is bent.
    pub bow: Length,
    /// How fast each axis moves while the cameras expose, in millimetres or radians per second.
    pub speeds: [f64; 2],
    mismatch: Mismatch,
}

impl World {
    /// The bench of a seed, with this mismatch.
    ///
    /// # Errors
    /// Where it cannot be built, or the design cannot be traced.
    pub fn new(mismatch: Mismatch, lens: BuiltIn, seed: u64) -> Result<Self, ReproduceError> {
        let bench = Bench::new(seed)?;
        let Bench { mut drawn, mut built } = bench;
        if mismatch == Mismatch::RollingShutter {
            drawn.shutters = [Shutter::Rolling { line_us: LINE_US * (1.0 + LINE_OFF) }; 2];
            built.shutters = [Shutter::Rolling { line_us: LINE_US }; 2];
        }
        let kind = if mismatch == Mismatch::Nothing { LensChoice::Ideal } else { LensChoice::Traced(lens) };
        let eyes = |scale: f64| -> Result<[TrueLens; 2], ReproduceError> {
            let eye = |ideal, side| eye(ideal, scale, kind, displacement(mismatch, 2 * seed + side));
            Ok([eye(&built.left_camera, 0)?, eye(&built.right_camera, 1)?])
        };
        let warm = if mismatch == Mismatch::Focus { 1.0 + BREATHING } else { 1.0 };
        let (calibrating, measuring) = (eyes(1.0)?, eyes(warm)?);
        let mut speeds = [0.0; 2];
        if mismatch == Mismatch::RollingShutter {
            speeds[SEPARATION] = SPEED.rad();
        }
        let bow = if mismatch == Mismatch::BowedTarget { BOW } else { Length::from_mm(0.0) };
        Ok(Self { bench: Bench { drawn, built }, calibrating, measuring, bow, speeds, mismatch })
    }

    /// Sends the axes to `targets`.
    pub fn stand(&self, targets: &[AxisPosition], random: &mut Random) -> Standing {
        let mut standing = Standing::sent_to(&self.bench.drawn.axes, targets, random);
        let slack = random.between(-0.5, 0.5);
        match (self.mismatch, standing.values.as_mut_slice()) {
            (Mismatch::ScrewPitch, [baseline, ..]) => {
                *baseline += PITCH_SCALE * *baseline + PITCH_MM * (std::f64::consts::TAU * *baseline / TURN_MM).sin();
            }
            (Mismatch::Play, [_, separation, ..]) => *separation += slack * PLAY.rad(),
            _ => {}
        }
        standing
    }

    /// The stops of a calibration of the stage.
    pub fn calibration_stops(&self, random: &mut Random) -> Vec<Stop> {
        let plan = stage_plan(&self.bench.drawn.axes, STAGE_POSES);
        let stop = |targets: &Vec<AxisPosition>| {
            let standing = self.stand(targets, random);
            let truth = self.pose(&standing, 0.0).left_from_right;
            Stop { readings: standing.readings, truth }
        };
        plan.iter().map(stop).collect()
    }

    /// Where the cameras truly are, `seconds` after the middle of the exposure.
    pub fn pose(&self, standing: &Standing, seconds: f64) -> RigPose {
        let values: Vec<f64> =
            standing.values.iter().zip(self.speeds).map(|(value, speed)| value + speed * seconds).collect();
        let rig: &Rig = &self.bench.built;
        match self.mismatch {
            Mismatch::RailYaw => BentRail { axis: BASELINE, sagitta: Vector3::z() * SAGITTA.mm() }.pose(rig, &values),
            _ => rig.pose_at_values(&values),
        }
    }

    /// When a row of a camera is exposed, in seconds after the middle row.
    pub fn seconds_at_row(&self, row: f64, side: usize) -> f64 {
        let rows = [&self.bench.built.left_camera, &self.bench.built.right_camera][side].size().height;
        (row - 0.5 * (f64::from(rows) - 1.0)) * self.bench.built.shutters[side].line_us() * 1e-6
    }
}

fn displacement(mismatch: Mismatch, seed: u64) -> Option<Displacement> {
    let straight = Displacement {
        decentre: Length::from_mm(0.0),
        tilt: Angle::from_rad(0.0),
        sensor_tilt: Angle::from_rad(0.0),
        seed,
    };
    match mismatch {
        Mismatch::Decentre => Some(Displacement { decentre: DECENTRE, tilt: ELEMENT_TILT, ..straight }),
        Mismatch::SensorTilt => Some(Displacement { sensor_tilt: SENSOR_TILT, ..straight }),
        _ => None,
    }
}

/// A lens in the place of the ideal one, so many times as long.
fn eye(
    ideal: &KannalaBrandt,
    scale: f64,
    kind: LensChoice,
    displaced: Option<Displacement>,
) -> Result<TrueLens, ReproduceError> {
    let refused = |error: &dyn std::fmt::Display| ReproduceError::Rig(format!("{kind}: {error}"));
    let mut scaled = ideal.to_opencv();
    (scaled.fx, scaled.fy) = (scale * scaled.fx, scale * scaled.fy);
    let ideal = KannalaBrandt::from_opencv(scaled, ideal.theta_max(), ideal.size()).map_err(|error| refused(&error))?;
    match (kind.in_place_of(&ideal).map_err(|error| refused(&error))?, displaced) {
        (TrueLens::Traced(lens), Some(by)) => {
            lens.displaced(&by).map(TrueLens::Traced).map_err(|error| refused(&error))
        }
        (lens, _) => Ok(lens),
    }
}
