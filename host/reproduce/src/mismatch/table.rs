//! From trials to one table, and what it says of each mismatch.

use vergence_calibration::LensModel;

use super::trial::{Trial, mean_absolute};
use super::{MODELS, Mismatch, MismatchPlan, RANGES_MM};
use crate::bench::MODES;
use crate::causes::PUBLISHED;
use crate::method::Method;

/// A mean error above this many times that of the rig with nothing but its lenses costs accuracy.
const COSTS: f64 = 1.25;
/// So many standard deviations bound the NEES of an honest file: dozens of cells are compared.
const BAND_SIGMAS: f64 = 3.0;
/// Of the ranges, the one of the paper's precision bench.
const PAPER_RANGE: usize = 1;

/// One mismatch, model, mode and range.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Cell {
    /// What was wrong.
    pub mismatch: Mismatch,
    /// How the lenses were calibrated.
    pub model: LensModel,
    /// Index into [`MODES`].
    pub mode: usize,
    /// Index into [`RANGES_MM`].
    pub range: usize,
    /// Points measured.
    pub points: usize,
    /// Mean absolute error of the depth.
    pub mean_abs_mm: f64,
    /// What the files state that mean to be: the statistical bound, if nothing but noise is in it.
    pub stated_mm: f64,
    /// Mean squared error in units of the stated covariance: 3 of an honest file.
    pub nees: f64,
}

/// What the rigs of a mismatch and model say themselves.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RowNote {
    /// What was wrong.
    pub mismatch: Mismatch,
    /// How the lenses were calibrated.
    pub model: LensModel,
    /// Standard deviation of corners as calibrations find it, in pixels.
    pub corner_px: f64,
    /// In how many clouds of how many they warned that images disagree with lenses or encoders.
    pub warned: [usize; 2],
    /// Matches that made no point, of how many.
    pub refused: [usize; 2],
}

/// What becomes of a mismatch, where the views choose the model of the lens.
#[derive(Clone, Debug, PartialEq)]
pub enum Verdict {
    /// The points are as good as without it, and as far as so many rigs tell their covariance holds.
    Harmless,
    /// The points are worse, by this factor at worst, and as far as so many rigs tell their covariance says so.
    Stated(f64),
    /// The covariance does not hold.
    NotCaught {
        /// The places.
        at: Vec<Cell>,
        /// In how many clouds of how many the rig warned that images disagree with lenses or encoders.
        warned: [usize; 2],
    },
}

/// What a lens alone would explain of an error that the paper published.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PaperShare {
    /// The mode.
    pub mode: &'static str,
    /// The error that the paper published, of the pseudo-intersection at 350 mm.
    pub published_mm: f64,
    /// The mean absolute error of traced lenses that are calibrated with one centre.
    pub central_mm: f64,
    /// The bound of noise, by the lenses that the views ask for.
    pub bound_mm: f64,
}

/// All of it.
#[derive(Clone, Debug, PartialEq)]
pub struct MismatchTable {
    /// What was tried.
    pub plan: MismatchPlan,
    /// Every cell that has points.
    pub cells: Vec<Cell>,
    /// What the rigs of each mismatch and model say themselves.
    pub notes: Vec<RowNote>,
    /// An honest NEES lies between these.
    pub band: [f64; 2],
}

impl MismatchTable {
    /// Over all trials.
    #[must_use]
    pub fn of(plan: MismatchPlan, trials: &[Trial]) -> Self {
        let rows = || Mismatch::ALL.into_iter().flat_map(|mismatch| MODELS.map(|model| (mismatch, model)));
        let mut cells = Vec::new();
        let mut notes = Vec::new();
        for (mismatch, model) in rows() {
            let of_row = || trials.iter().filter(move |trial| trial.mismatch == mismatch && trial.model == model);
            for (mode, range) in (0..MODES.len()).flat_map(|mode| (0..RANGES_MM.len()).map(move |range| (mode, range)))
            {
                let sightings = of_row().flat_map(|trial| &trial.sightings);
                let here: Vec<_> = sightings.filter(|seen| seen.mode == mode && seen.range == range).collect();
                if here.is_empty() {
                    continue;
                }
                let mean = |of: &dyn Fn(usize) -> f64| (0..here.len()).map(of).sum::<f64>() / here.len() as f64;
                cells.push(Cell {
                    mismatch,
                    model,
                    mode,
                    range,
                    points: here.len(),
                    mean_abs_mm: mean(&|i| here[i].error_mm.abs()),
                    stated_mm: mean_absolute(mean(&|i| here[i].sigma_mm.powi(2)).sqrt()),
                    nees: mean(&|i| here[i].square),
                });
            }
            let warned = of_row().flat_map(|trial| trial.warned).filter(|warned| *warned).count();
            let count = of_row().count();
            let corner_px = of_row().map(|trial| trial.corner_px).sum::<f64>() / count.max(1) as f64;
            let seen: usize = of_row().flat_map(|trial| trial.seen).sum();
            let made: usize = of_row().map(|trial| trial.sightings.len()).sum();
            let (warned, refused) = ([warned, count * MODES.len()], [seen.saturating_sub(made), seen]);
            notes.push(RowNote { mismatch, model, corner_px, warned, refused });
        }
        Self { plan, cells, notes, band: band(plan.seeds) }
    }

    /// The cell at a place; `None` where it has no points.
    #[must_use]
    pub fn cell(&self, mismatch: Mismatch, model: LensModel, mode: usize, range: usize) -> Option<&Cell> {
        self.cells
            .iter()
            .find(|cell| cell.mismatch == mismatch && cell.model == model && cell.mode == mode && cell.range == range)
    }

    /// What becomes of a mismatch.
    #[must_use]
    pub fn verdict(&self, mismatch: Mismatch) -> Verdict {
        let chosen =
            || self.cells.iter().filter(|cell| cell.mismatch == mismatch && cell.model == LensModel::default());
        let missed: Vec<Cell> = chosen().filter(|cell| cell.nees > self.band[1]).copied().collect();
        if !missed.is_empty() {
            let of = |note: &&RowNote| note.mismatch == mismatch && note.model == LensModel::default();
            return Verdict::NotCaught {
                at: missed,
                warned: self.notes.iter().find(of).map_or([0; 2], |note| note.warned),
            };
        }
        let lenses_alone = if mismatch == Mismatch::TracedLens { Mismatch::Nothing } else { Mismatch::TracedLens };
        let costs = chosen().filter_map(|cell| {
            let without = self.cell(lenses_alone, cell.model, cell.mode, cell.range)?;
            Some(cell.mean_abs_mm / without.mean_abs_mm)
        });
        match costs.fold(1.0, f64::max) {
            most if most > COSTS => Verdict::Stated(most),
            _ => Verdict::Harmless,
        }
    }

    /// What the traced lenses alone would explain of the paper's errors.
    #[must_use]
    pub fn paper(&self) -> Vec<PaperShare> {
        let theirs = PUBLISHED.iter().filter(|published| published.method == Method::PseudoIntersection);
        let share = |published: &crate::causes::Published| {
            let mode = MODES.iter().position(|mode| *mode == published.mode)?;
            let cell = |model| self.cell(Mismatch::TracedLens, model, mode, PAPER_RANGE);
            Some(PaperShare {
                mode: published.mode,
                published_mm: published.mm,
                central_mm: cell(LensModel::Central)?.mean_abs_mm,
                bound_mm: cell(LensModel::default())?.stated_mm,
            })
        };
        theirs.filter_map(share).collect()
    }
}

impl PaperShare {
    /// The part of the published error that is there with such a lens and this noise.
    #[must_use]
    pub fn share(&self) -> f64 {
        self.central_mm / self.published_mm
    }

    /// What is left, were the rest independent of it: √(published² - that²); zero where it is more than all.
    #[must_use]
    pub fn rest_mm(&self) -> f64 {
        (self.published_mm.powi(2) - self.central_mm.powi(2)).max(0.0).sqrt()
    }
}

impl Verdict {
    /// The sentence of the page.
    #[must_use]
    pub fn sentence(&self) -> String {
        match self {
            Self::Harmless => {
                "harmless: points are as good as without it, and the NEES of so many rigs is as an honest one.".into()
            }
            Self::Stated(factor) => {
                format!(
                    "costs accuracy, up to {factor:.1} times the error without it; the NEES of so many rigs is as an honest one."
                )
            }
            Self::NotCaught { at, warned: [warned, clouds] } => {
                let place = |cell: &Cell| {
                    let stated = cell.mean_abs_mm / cell.stated_mm;
                    format!(
                        "{:.0} mm (depth error {stated:.1} times as stated, NEES {:.0})",
                        RANGES_MM[cell.range], cell.nees
                    )
                };
                let of_mode = |mode: usize| {
                    let places: Vec<_> = at.iter().filter(|cell| cell.mode == mode).map(place).collect();
                    (!places.is_empty()).then(|| format!("in {} mode at {}", MODES[mode], places.join(", ")))
                };
                let places: Vec<_> = (0..MODES.len()).filter_map(of_mode).collect();
                let warning = match warned {
                    0 => "no cloud comes with a warning".into(),
                    _ => format!("{warned} of {clouds} clouds warn that the images disagree with lenses or encoders"),
                };
                format!("NOT caught {}: the stated covariance is too small; {warning}.", places.join("; "))
            }
        }
    }
}

/// The mean of so many sums of three squared normal errors lies between these (the approximation of E. Wilson and M. Hilferty, PNAS 17, 1931).
/// Points of one rig share its calibration: a rig counts as one draw.
fn band(seeds: u32) -> [f64; 2] {
    let spread = 2.0 / (9.0 * 3.0 * f64::from(seeds.max(1)));
    [-BAND_SIGMAS, BAND_SIGMAS].map(|sigmas| 3.0 * (1.0 - spread + sigmas * spread.sqrt()).max(0.0).powi(3))
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used, reason = "a test may fail")]

    use vergence_lens::BuiltIn;

    use super::*;
    use crate::mismatch::trial::Sighting;

    fn trial(mismatch: Mismatch, model: LensModel, error_mm: f64, square: f64) -> Trial {
        let places = (0..MODES.len()).flat_map(|mode| (0..RANGES_MM.len()).map(move |range| (mode, range)));
        let sighting = |(mode, range)| Sighting { mode, range, error_mm, sigma_mm: 0.25, square };
        Trial {
            mismatch,
            model,
            sightings: places.map(sighting).collect(),
            seen: [RANGES_MM.len(); MODES.len()],
            warned: [false, true],
            corner_px: 0.1,
        }
    }

    #[test]
    fn a_mismatch_is_harmless_or_stated_or_not_caught() {
        let plan = MismatchPlan { seeds: 1, lens: BuiltIn::Sigma8 };
        let chosen = LensModel::default();
        let table = MismatchTable::of(
            plan,
            &[
                trial(Mismatch::Nothing, chosen, 0.1, 3.0),
                trial(Mismatch::TracedLens, chosen, 0.2, 3.0),
                trial(Mismatch::Play, chosen, 0.24, 3.0),
                trial(Mismatch::RailYaw, chosen, -0.5, 3.0),
                trial(Mismatch::Focus, chosen, 0.2, 40.0),
                // Another model does not count.
                trial(Mismatch::Play, LensModel::Central, 5.0, 400.0),
            ],
        );
        assert_eq!(table.verdict(Mismatch::Play), Verdict::Harmless);
        let Verdict::Stated(factor) = table.verdict(Mismatch::RailYaw) else { panic!("it is stated") };
        assert!((factor - 2.5).abs() < 1e-12);
        let verdict = table.verdict(Mismatch::Focus);
        let Verdict::NotCaught { at, warned } = &verdict else { panic!("it is not caught") };
        assert_eq!((at.len(), *warned), (MODES.len() * RANGES_MM.len(), [1, 2]));
        let sentence = verdict.sentence();
        assert!(sentence.contains("in human mode at 200 mm (depth error 1.0 times as stated, NEES 40)"), "{sentence}");
        assert!(sentence.contains("1 of 2 clouds warn"), "{sentence}");
        let all = MODES.len() * RANGES_MM.len();
        assert!(table.notes.iter().all(|note| note.refused[0] == 0 && [0, all].contains(&note.refused[1])));
        let cell = table.cell(Mismatch::Nothing, chosen, 0, 0).unwrap();
        assert!((cell.stated_mm - 0.25 * 0.797_884_560_8).abs() < 1e-9, "{cell:?}");
    }

    #[test]
    fn what_a_lens_leaves_of_a_published_error_is_the_rest_of_its_square() {
        let share = PaperShare { mode: "human", published_mm: 1.0, central_mm: 0.6, bound_mm: 0.2 };
        assert!((share.share() - 0.6).abs() < 1e-12 && (share.rest_mm() - 0.8).abs() < 1e-12);
        assert!(PaperShare { central_mm: 1.2, ..share }.rest_mm() == 0.0);
    }

    /// Of 15 degrees of freedom 0.135 % lie above 35.6 (tables of χ²: 0.1 % above 37.7, 0.5 % above 32.8).
    #[test]
    fn the_band_is_that_of_chi_square() {
        let [low, high] = band(5);
        assert!((32.8..37.7).contains(&(5.0 * high)) && low > 0.3 && low < 1.2, "{low} {high}");
    }
}
