//! A simulated rig whose lenses are not those that its file states, and the file that a calibration of them gives.

use vergence_calibration::{LensModel, stage_plan};
use vergence_rig::{AxisPosition, Rig};
use vergence_scene::{LensChoice, TrueLens};
use vergence_sim::Random;

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

impl LensedRig {
    /// The rig `drawn` with such lenses. Traced lenses are calibrated, with the stage, from corners of simulated targets that are projected with
    /// noise: nothing is rendered for it. The mechanics are as drawn. The same seed gives the same file.
    ///
    /// # Errors
    /// Where the axes cannot be calibrated, as those of a trunk.
    pub fn new(drawn: &Rig, lens: LensChoice, seed: u64) -> Result<Self, ReproduceError> {
        let bench = Bench { drawn: drawn.clone(), built: drawn.clone() };
        let conditions = Conditions { lens, ..Conditions::noise(Corners::Projected, NOISE_PX) };
        let eyes = Eyes::of(&bench, &conditions)?;
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
