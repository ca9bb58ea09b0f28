//! Where the simulated rig stands while it is calibrated and while it measures.

use vergence_calibration::stage_plan;
use vergence_protocol::Mode;
use vergence_rig::AxisPosition;
use vergence_vision::{Left, Right, Transform};

use crate::bench::{Bench, MODES};

/// Stage poses of a calibration.
const STAGE_POSES: usize = 6;

/// Where the stage came to stand.
#[derive(Clone, Debug)]
pub struct Stop {
    /// What the encoders read.
    pub readings: Vec<AxisPosition>,
    /// Where the right camera really is.
    pub truth: Transform<Left, Right>,
}

/// All stops of one seed.
#[derive(Clone, Debug)]
pub struct Drive {
    /// Where the stage is calibrated.
    pub calibration: Vec<Stop>,
    /// Where the bench measures, one for each of [`MODES`].
    pub modes: Vec<Stop>,
}

/// The targets of all axes at every stop, in the order in which the stage drives to them, and the mode of each.
#[derive(Clone, Debug, PartialEq)]
pub struct Route {
    /// The poses of a stage calibration.
    pub calibration: Vec<(Mode, Vec<AxisPosition>)>,
    /// The modes that the bench compares.
    pub modes: Vec<(Mode, Vec<AxisPosition>)>,
}

impl Route {
    /// The route of a bench.
    #[must_use]
    pub fn of(bench: &Bench) -> Self {
        let drawn = &bench.drawn;
        let modes = MODES.iter().filter_map(|name| drawn.mode(name));
        Self {
            calibration: stage_plan(&drawn.axes, STAGE_POSES).into_iter().map(|targets| (Mode(0), targets)).collect(),
            modes: modes.map(|mode| (mode.number, mode.targets.clone())).collect(),
        }
    }
}
