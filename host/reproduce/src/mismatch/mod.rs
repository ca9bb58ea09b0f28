//! Worlds that are not as the calibration assumes, one mismatch at a time: what each costs, and whether the rig's own statement says so.
//!
//! Every trial is another bench, as [`Bench`](crate::Bench) builds it. Its lenses and its stage are calibrated from projected corners, by the same
//! functions as `vergence calibrate` and through the rig file that is written; clouds of matched points are then made by that file, by the
//! same function as `vergence depth --points`. Once the lenses are calibrated with one centre of projection, and once as their views
//! ask for.

mod page;
mod report;
mod table;
mod trial;
mod world;

use std::sync::atomic::{AtomicUsize, Ordering};

use rayon::prelude::*;
use serde_json::Value;
use vergence_calibration::LensModel;
use vergence_lens::BuiltIn;
use vergence_scene::LensChoice;

use crate::error::ReproduceError;

pub use page::mismatch_page;
pub use table::{Cell, MismatchTable, PaperShare, RowNote, Verdict};
pub use trial::{Sighting, Trial};

/// Ranges before the rig at which points are measured, in millimetres.
pub const RANGES_MM: [f64; 4] = [200.0, 350.0, 800.0, 3000.0];

/// A way in which the world differs from what the calibration assumes. All but the first are of a rig with traced lenses.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Mismatch {
    /// None: ideal lenses of the calibration's own family, and mechanics of screws.
    Nothing,
    /// Lenses traced from a published design.
    TracedLens,
    /// And every element of them off its place.
    Decentre,
    /// And a sensor that is not square to the axis.
    SensorTilt,
    /// And a bent target, of which the calibration is not told.
    BowedTarget,
    /// And a screw that drives its carriage unevenly, with the encoder on the motor.
    ScrewPitch,
    /// And play of the separation, which the encoder does not see.
    Play,
    /// And a rail that is not straight, so that the carriage yaws on its way.
    RailYaw,
    /// And cameras that expose row after row, while the separation changes, slower than the file says.
    RollingShutter,
    /// And lenses that were warmer when they measured than when they were calibrated.
    Focus,
}

/// How a lens is calibrated: with one centre, or as its views ask for.
pub const MODELS: [LensModel; 2] = [LensModel::Central, LensModel::ByEvidence];

/// What is tried.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct MismatchPlan {
    /// Number of rigs.
    pub seeds: u32,
    /// The design of all traced lenses.
    pub lens: BuiltIn,
}

impl MismatchPlan {
    /// So many rigs with traced lenses of this kind; `None` for ideal lenses, which have no elements to displace.
    #[must_use]
    pub const fn new(seeds: u32, lens: LensChoice) -> Option<Self> {
        match lens {
            LensChoice::Traced(lens) => Some(Self { seeds, lens }),
            LensChoice::Ideal => None,
        }
    }

    /// The command that tries it.
    #[must_use]
    pub fn command(&self) -> String {
        format!("vergence reproduce --mismatch --seeds {} --lens {}", self.seeds, self.lens.name())
    }
}

impl Mismatch {
    /// In the order of the tables.
    pub const ALL: [Self; 10] = [
        Self::Nothing,
        Self::TracedLens,
        Self::Decentre,
        Self::SensorTilt,
        Self::BowedTarget,
        Self::ScrewPitch,
        Self::Play,
        Self::RailYaw,
        Self::RollingShutter,
        Self::Focus,
    ];

    /// The name of its row.
    #[must_use]
    pub const fn as_str(self) -> &'static str {
        match self {
            Self::Nothing => "nothing",
            Self::TracedLens => "traced lens",
            Self::Decentre => "decentred elements",
            Self::SensorTilt => "sensor tilt",
            Self::BowedTarget => "bowed target",
            Self::ScrewPitch => "screw pitch",
            Self::Play => "unknown play",
            Self::RailYaw => "rail yaw",
            Self::RollingShutter => "rolling shutter",
            Self::Focus => "focus breathing",
        }
    }
}

/// Tries every mismatch on every rig, all in parallel; `progress` hears of the number of trials done and of all, from any thread. The same plan
/// gives the same table.
///
/// # Errors
/// Where a bench cannot be built or calibrated, or a design cannot be traced.
pub fn mismatches(
    plan: &MismatchPlan,
    progress: &(dyn Fn(usize, usize) + Sync),
) -> Result<MismatchTable, ReproduceError> {
    let seeds = u64::from(plan.seeds);
    let jobs: Vec<_> =
        Mismatch::ALL.into_iter().flat_map(|mismatch| (0..seeds).map(move |seed| (mismatch, seed))).collect();
    let done = AtomicUsize::new(0);
    progress(0, jobs.len());
    let trials = jobs
        .par_iter()
        .map(|&(mismatch, seed)| {
            let both = MODELS.map(|model| Trial::of(mismatch, plan.lens, model, seed));
            progress(done.fetch_add(1, Ordering::Relaxed) + 1, jobs.len());
            both
        })
        .collect::<Vec<_>>();
    let trials = trials.into_iter().flatten().collect::<Result<Vec<_>, ReproduceError>>()?;
    Ok(MismatchTable::of(*plan, &trials))
}

impl MismatchTable {
    /// The table for people, a line for each row, and what it says.
    #[must_use]
    pub fn lines(&self) -> Vec<String> {
        report::lines(self)
    }

    /// All figures for programs.
    #[must_use]
    pub fn json(&self) -> Value {
        report::json(self)
    }
}
