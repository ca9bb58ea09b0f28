//! A simulated rig whose lenses are not those that its file states, and the file that a calibration of them gives.

use vergence_calibration::{LensModel, stage_plan};
use vergence_lens::Displacement;
use vergence_rig::{AxisPosition, Rig};
use vergence_scene::{LensChoice, TrueLens};
use vergence_sim::Random;
use vergence_vision::{Angle, Length};

use crate::bench::Bench;
use crate::chain::calibrate;
use crate::conditions::{Conditions, NOISE_PX};
use crate::drive::{Drive, STAGE_POSES, Standing, Stop};
use crate::error::ReproduceError;
use crate::eyes::Eyes;
use crate::target_shot::Corners;

/// A rig to simulate: its lenses, and what measures with it knows.
pub struct LensedRig {
    /// The left and the right lens, in the place of the ideal ones of the rig's drawing.
    pub lenses: [TrueLens; 2],
    /// The rig by which clouds are made: as drawn where the lenses are ideal, otherwise as calibrated.
    pub known: Rig,
    /// The file of the calibrated rig; `None` where the drawing is known already.
    pub file: Option<String>,
}

/// How far the elements of a badly mounted lens are off.
struct Mounting {
    decentre_mm: f64,
    tilt_deg: f64,
    sensor_tilt_deg: f64,
}

/// The worst on which calibrations count: docs/measured/lenses.md, "What lenses have before any view".
const BADLY_MOUNTED: Mounting = Mounting { decentre_mm: 0.01, tilt_deg: 0.05, sensor_tilt_deg: 0.4 };

impl Mounting {
    fn times(&self, share: f64, seed: u64) -> Displacement {
        Displacement {
            decentre: Length::from_mm(share * self.decentre_mm),
            tilt: Angle::from_deg(share * self.tilt_deg),
            sensor_tilt: Angle::from_deg(share * self.sensor_tilt_deg),
            seed,
        }
    }
}

impl LensedRig {
    /// The rig `drawn` with such lenses. Traced lenses are calibrated, with the stage, from corners of simulated targets that are projected with
    /// noise: nothing is rendered for it. The mechanics are as drawn. The same seed gives the same file.
    ///
    /// # Errors
    /// Where the axes cannot be calibrated, as those of a trunk.
    pub fn new(drawn: &Rig, lens: LensChoice, seed: u64) -> Result<Self, ReproduceError> {
        Self::with_eyes(drawn, lens, seed, Ok)
    }

    /// The same with lenses as they are mounted: their elements are displaced by a share, anywhere between none and all, of the worst on which
    /// calibrations count before any view.
    ///
    /// # Errors
    /// As [`Self::new`].
    pub fn mounted(drawn: &Rig, lens: LensChoice, seed: u64) -> Result<Self, ReproduceError> {
        let mut random = Random::new(seed ^ 0x006d_6f75_6e74_6564);
        let mut mounted = |lens: TrueLens| match lens {
            TrueLens::Traced(lens) => {
                let by = BADLY_MOUNTED.times(random.between(0.0, 1.0), random.seed());
                lens.displaced(&by).map(TrueLens::Traced)
            }
            ideal @ TrueLens::Ideal(_) => Ok(ideal),
        };
        Self::with_eyes(drawn, lens, seed, |[left, right]| {
            let both = mounted(left).and_then(|left| Ok([left, mounted(right)?]));
            both.map_err(|error| ReproduceError::Rig(format!("{lens}: {error}")))
        })
    }

    fn with_eyes(
        drawn: &Rig,
        lens: LensChoice,
        seed: u64,
        made: impl FnOnce([TrueLens; 2]) -> Result<[TrueLens; 2], ReproduceError>,
    ) -> Result<Self, ReproduceError> {
        let bench = Bench { drawn: drawn.clone(), built: drawn.clone() };
        let conditions = Conditions { lens, ..Conditions::noise(Corners::Projected, NOISE_PX) };
        let mut eyes = Eyes::of(&bench, &conditions)?;
        eyes.lenses = made(eyes.lenses)?;
        if lens == LensChoice::Ideal {
            return Ok(Self { lenses: eyes.lenses, known: bench.drawn, file: None });
        }
        let [mut random, mut returns] = [seed, seed ^ 0x7265_7475_726e].map(Random::new);
        let plan = stage_plan(&drawn.axes, STAGE_POSES);
        let stop = |targets: &Vec<AxisPosition>| {
            let Standing { readings, values } = Standing::sent_to(&drawn.axes, targets, &mut random);
            Stop { readings, truth: drawn.pose_at_values(&values).left_from_right }
        };
        let drive = Drive { calibration: plan.iter().map(stop).collect(), modes: Vec::new() };
        let calibrated = calibrate(&bench, &drive, &eyes, LensModel::default(), &mut random, &mut returns)?;
        Ok(Self { lenses: eyes.lenses, known: calibrated.rig, file: Some(calibrated.file) })
    }
}
