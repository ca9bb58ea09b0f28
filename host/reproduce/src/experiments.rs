//! All experiments, one after the other, and their results.

use std::fmt;
use std::sync::atomic::{AtomicUsize, Ordering};

use rayon::prelude::*;
use serde_json::{Value, json};
use vergence_output::{ZonesOf, zones_plot};
use vergence_scene::LensChoice;
use vergence_vision::PAPER_FIELD;

use crate::bench::Bench;
use crate::causes::Column;
use crate::conditions::{Cause, Conditions, NOISE_PX};
use crate::drive::Drive;
use crate::error::ReproduceError;
use crate::matching::{Matching, MatchingTools, matchings};
use crate::one_seed::{SeedResult, one_seed};
use crate::page::{Findings, reproduction_page};
use crate::report;
use crate::tally::Table;
use crate::target_images::target_images;
use crate::target_shot::Corners;
use crate::zones::{ModeZones, mode_zones};

/// Seed of the simulated room and of the pictures.
const PICTURE_SEED: u64 = 1;

/// What is repeated, and how often.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Plan {
    /// Number of rigs.
    pub seeds: u32,
    /// Number of rigs that are also measured with twice the noise and with each kind of error alone; `None` for a fifth of
    /// them.
    pub noisy_seeds: Option<u32>,
    /// Where the corners come from.
    pub corners: Corners,
    /// The true lenses of the bench, which photograph the targets.
    pub lens: LensChoice,
    /// Samples for each point of the study of triangulation.
    pub samples: u32,
    /// Whether the simulated room is matched.
    pub matching: bool,
}

/// A rig of the precision bench and the stops of its stage.
pub struct DrivenRig {
    /// The seed that the rig was drawn by.
    pub seed: u64,
    /// The rig, as drawn and as built.
    pub bench: Bench,
    /// Where its stage came to stand.
    pub drive: Drive,
}

/// What the experiments are at.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Progress {
    /// Matches in the simulated room.
    Matching,
    /// Calibrations and measurements.
    Measuring {
        /// What they suffer from.
        errors: &'static str,
        /// Number of rigs that are measured.
        done: usize,
        /// Number of all rigs.
        rigs: usize,
    },
    /// The page.
    Drawing,
}

/// Results of all experiments.
pub struct Results {
    /// The lenses that photographed the targets.
    pub lens: LensChoice,
    /// The bench with corners of the class that the goals are for, and with twice the noise.
    pub tables: [Table; 2],
    /// Each kind of error alone, and all together.
    pub columns: Vec<Column>,
    /// Zones of all modes.
    pub zones: Vec<ModeZones>,
    /// Results of all matchers in all modes.
    pub matchings: Vec<Matching>,
    /// The page that shows all of it.
    pub html: String,
}

impl Plan {
    /// Number of rigs that are measured with more than the noise of the corners.
    fn noisy(&self) -> usize {
        self.noisy_seeds.unwrap_or(self.seeds.div_ceil(5)).min(self.seeds) as usize
    }

    /// The command as the page names it: what decides its bytes.
    fn command(&self) -> String {
        let corners = if self.corners == Corners::Rendered { "" } else { " --corners projected" };
        let matching = if self.matching { "" } else { " --no-matching" };
        format!(
            "vergence reproduce --seeds {} --noisy-seeds {} --samples {}{corners} --lens {}{matching}",
            self.seeds,
            self.noisy(),
            self.samples,
            self.lens
        )
    }
}

impl fmt::Display for Progress {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Matching => f.write_str("matching in the simulated room"),
            Self::Measuring { errors, done, rigs } => {
                write!(f, "measuring with {errors}, {done} of {rigs} rigs done")
            }
            Self::Drawing => f.write_str("drawing the page"),
        }
    }
}

/// Matches, calibrates, measures and draws the page, with the rigs that were driven; all rigs are computed in parallel.
/// `progress` is called from any thread.
///
/// # Errors
/// Where a simulated bench cannot be built or calibrated, or a picture cannot be drawn.
pub fn experiments(
    plan: &Plan,
    rigs: &[DrivenRig],
    tools: &MatchingTools<'_>,
    progress: &(dyn Fn(Progress) + Sync),
) -> Result<Results, ReproduceError> {
    let matchings = match plan.matching {
        false => Vec::new(),
        true => {
            progress(Progress::Matching);
            matchings(tools, PICTURE_SEED)?
        }
    };
    let few = rigs.get(..plan.noisy()).unwrap_or_default();
    let bench = |noise_px| Conditions { lens: plan.lens, ..Conditions::noise(plan.corners, noise_px) };
    let ordinary = all_seeds(rigs, "the usual noise", &bench(NOISE_PX), progress)?;
    let twice = all_seeds(few, "twice the noise", &bench(2.0 * NOISE_PX), progress)?;
    let column = |cause: Cause| {
        let table = match cause {
            Cause::Corners if plan.lens == LensChoice::Ideal => Table::of(ordinary.iter().take(few.len())),
            _ => Table::of(&all_seeds(few, cause.as_str(), &cause.alone(plan.corners, plan.lens), progress)?),
        };
        Ok(Column { cause, table })
    };
    let columns = Cause::ALL.into_iter().map(column).collect::<Result<Vec<_>, ReproduceError>>()?;
    let tables = [Table::of(&ordinary), Table::of(&twice)];
    progress(Progress::Drawing);
    let zones = mode_zones();
    let html = reproduction_page(&Findings {
        tables: tables.each_ref(),
        columns: &columns,
        rendered: plan.corners == Corners::Rendered,
        zones: &zones,
        zones_svg: &zones_of_herbivore(&zones),
        matchings: &matchings,
        targets: &target_images(PICTURE_SEED, plan.lens)?,
        lens: plan.lens,
        samples: plan.samples,
        command: plan.command(),
    })?;
    Ok(Results { lens: plan.lens, tables, columns, zones, matchings, html })
}

/// Computes all seeds in parallel, in the order of the rigs.
fn all_seeds(
    rigs: &[DrivenRig],
    errors: &'static str,
    conditions: &Conditions,
    progress: &(dyn Fn(Progress) + Sync),
) -> Result<Vec<SeedResult>, ReproduceError> {
    let measuring = |done| Progress::Measuring { errors, done, rigs: rigs.len() };
    progress(measuring(0));
    let done = AtomicUsize::new(0);
    rigs.par_iter()
        .map(|DrivenRig { seed, bench, drive }| {
            let result = one_seed(bench, drive, conditions, *seed);
            progress(measuring(done.fetch_add(1, Ordering::Relaxed) + 1));
            result
        })
        .collect()
}

/// Curves of the zones of the herbivore mode, as SVG.
fn zones_of_herbivore(zones: &[ModeZones]) -> String {
    let herbivore = zones.iter().find(|mode| mode.published.name == "herbivore");
    herbivore.map_or_else(String::new, |mode| {
        zones_plot(&ZonesOf {
            baseline: mode.published.baseline,
            separation: mode.published.separation,
            field: PAPER_FIELD,
            radius: mode.published.radius,
        })
    })
}

impl Results {
    /// Bench and matches for people, a line for each figure.
    #[must_use]
    pub fn lines(&self) -> Vec<String> {
        [
            vec![format!("lenses of the bench: {}; of the matches in the room: ideal", self.lens)],
            report::bench_lines(self.tables.each_ref()),
            report::cause_lines(&self.columns),
            report::matching_lines(&self.matchings),
        ]
        .concat()
    }

    /// All figures for programs.
    #[must_use]
    pub fn json(&self) -> Value {
        let [table, noisier] = &self.tables;
        json!({
            "lens": self.lens.to_string(),
            "bench": report::rows(table),
            "zones": report::zones(&self.zones),
            "corners": report::corners(table),
            "causes": report::causes(&self.columns, self.lens),
            "noisier": { "bench": report::rows(noisier), "corners": report::corners(noisier) },
            "matching": report::matchings(&self.matchings),
        })
    }
}
