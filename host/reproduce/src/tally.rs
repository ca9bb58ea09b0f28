//! From samples to the table of the bench.

use crate::bench::MODES;
use crate::measure::Sample;
use crate::method::{METHODS, Method};
use crate::one_seed::SeedResult;
use crate::undistorted::Undistorted;

/// The mean of |x| of a normal distribution of unit standard deviation: √(2 / π).
const MEAN_ABSOLUTE: f64 = 0.797_884_560_802_865_4;
/// Width of one field-angle bin, in degrees from straight ahead.
const FIELD_STEP_DEG: f64 = 10.0;
const FIELD_STEPS: usize = 4;

/// One method in one mode.
#[derive(Clone, Debug, PartialEq)]
pub struct Row {
    /// Such as `human`.
    pub mode: &'static str,
    /// Such as `midpoint`.
    pub method: &'static str,
    /// How large the errors are.
    pub figures: Figures,
    /// Mean over the seeds of the square of one corner's error in units of its covariance; ours alone states one.
    pub nees: Option<f64>,
    /// By the angle from straight ahead: where each step begins, in degrees, and its figures.
    pub field: Vec<(f64, Figures)>,
}

/// Errors of the depth, in millimetres.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Figures {
    /// How many corners.
    pub corners: usize,
    /// Mean of the absolute error.
    pub mean_abs_mm: f64,
    /// Mean of the absolute error over the depth, in per cent.
    pub rel_percent: f64,
    /// Standard deviation of the error.
    pub std_mm: f64,
    /// Mean of the error.
    pub bias_mm: f64,
    /// What the mean of the absolute error would be at the Cramér-Rao bound: √(2/π) √(mean variance), from pixels and
    /// calibration; only our method states a variance.
    pub crb_mm: Option<f64>,
    /// The same from pixels alone.
    pub crb_pixels_mm: Option<f64>,
}

/// Results over all seeds.
#[derive(Clone, Debug, PartialEq)]
pub struct Table {
    /// Every method in every mode where it has points.
    pub rows: Vec<Row>,
    /// Seeds that took part.
    pub seeds: usize,
    /// Root mean square of a corner's error in u or v, against the truth.
    pub corner_px: f64,
    /// The same as the rig itself estimates it: the mean over the seeds.
    pub stated_px: f64,
    /// Photographs, and those in which no target was found.
    pub photographs: [usize; 2],
    /// Corners that both cameras saw on the bench, and those that the epipolar gate of our method refused.
    pub corners: [usize; 2],
    /// What the undistorted pictures show, for each of [`MODES`].
    pub undistorted: Vec<Undistorted>,
}

impl Table {
    /// Over all seeds.
    #[must_use]
    pub fn of<'a>(seeds: impl IntoIterator<Item = &'a SeedResult>) -> Self {
        let seeds: Vec<&SeedResult> = seeds.into_iter().collect();
        let (mut squares, mut errors) = (0.0, 0usize);
        for error in seeds.iter().flat_map(|seed| seed.calibration_errors_px.iter().chain(&seed.measured.errors_px)) {
            squares += error * error;
            errors += 1;
        }
        let pairs = (0..MODES.len()).flat_map(|mode| METHODS.map(|method| (mode, method)));
        let sum = |of: fn(&SeedResult) -> [usize; 2]| {
            seeds.iter().map(|seed| of(seed)).fold([0, 0], |sum, next| [sum[0] + next[0], sum[1] + next[1]])
        };
        Self {
            rows: pairs.filter_map(|(mode, method)| row(&seeds, mode, method)).collect(),
            seeds: seeds.len(),
            corner_px: (squares / errors.max(1) as f64).sqrt(),
            stated_px: seeds.iter().map(|seed| seed.stated_px).sum::<f64>() / seeds.len().max(1) as f64,
            photographs: sum(|seed| seed.photographs),
            corners: sum(|seed| seed.measured.corners),
            undistorted: (0..MODES.len())
                .map(|mode| {
                    let of_mode = seeds.iter().filter_map(|seed| seed.measured.undistorted.get(mode));
                    of_mode.fold(Undistorted::default(), Undistorted::and)
                })
                .collect(),
        }
    }

    /// 95 % of all means of so many squares, of three degrees of freedom each, lie between these (E. Wilson and M.
    /// Hilferty, "The distribution of chi-square", 1931).
    #[must_use]
    pub fn nees_band(&self) -> [f64; 2] {
        const NORMAL_975: f64 = 1.959_964;
        let freedom = 3.0 * self.seeds.max(1) as f64;
        let spread = 2.0 / (9.0 * freedom);
        [-NORMAL_975, NORMAL_975].map(|z| 3.0 * (1.0 - spread + z * spread.sqrt()).powi(3))
    }

    /// The row of a method in a mode.
    #[must_use]
    pub fn row(&self, mode: &str, method: &str) -> Option<&Row> {
        self.rows.iter().find(|row| row.mode == mode && row.method == method)
    }
}

fn row(seeds: &[&SeedResult], mode: usize, method: Method) -> Option<Row> {
    let samples: Vec<&Sample> = seeds
        .iter()
        .flat_map(|seed| &seed.measured.samples)
        .filter(|sample| sample.mode == mode && sample.method == method)
        .collect();
    let figures = Figures::of(&samples)?;
    let field = (0..FIELD_STEPS).filter_map(|step| {
        let from = FIELD_STEP_DEG * step as f64;
        let inside = |sample: &&&Sample| (from..from + FIELD_STEP_DEG).contains(&sample.field_deg);
        Some((from, Figures::of(&samples.iter().filter(inside).copied().collect::<Vec<_>>())?))
    });
    let squares: Vec<f64> = seeds.iter().filter_map(|seed| seed.measured.nees.get(mode).copied().flatten()).collect();
    Some(Row {
        mode: MODES[mode],
        method: method.as_str(),
        figures,
        nees: (method == Method::Ours && !squares.is_empty())
            .then(|| squares.iter().sum::<f64>() / squares.len() as f64),
        field: field.collect(),
    })
}

impl Figures {
    fn of(samples: &[&Sample]) -> Option<Self> {
        if samples.is_empty() {
            return None;
        }
        let count = samples.len() as f64;
        let mean = |of: &dyn Fn(&Sample) -> f64| samples.iter().map(|sample| of(sample)).sum::<f64>() / count;
        let bias_mm = mean(&|sample| sample.error_mm);
        Some(Self {
            corners: samples.len(),
            mean_abs_mm: mean(&|sample| sample.error_mm.abs()),
            rel_percent: 100.0 * mean(&|sample| (sample.error_mm / sample.depth_mm).abs()),
            std_mm: mean(&|sample| (sample.error_mm - bias_mm).powi(2)).sqrt(),
            bias_mm,
            crb_mm: bound(samples, |variance| variance.iter().sum()),
            crb_pixels_mm: bound(samples, |variance| variance[0]),
        })
    }
}

/// The mean of the absolute error by the mean variance, where all samples state one.
fn bound(samples: &[&Sample], of: impl Fn(&[f64; 2]) -> f64) -> Option<f64> {
    let variances: Option<Vec<f64>> = samples.iter().map(|sample| sample.variance_mm2.as_ref().map(&of)).collect();
    let variances = variances?;
    Some(MEAN_ABSOLUTE * (variances.iter().sum::<f64>() / variances.len().max(1) as f64).sqrt())
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used, reason = "a test may fail")]

    use super::*;
    use crate::measure::Measured;

    fn seed(errors: &[f64], nees: f64) -> SeedResult {
        let sample = |&error_mm| Sample {
            mode: 0,
            method: Method::Ours,
            error_mm,
            depth_mm: 350.0,
            field_deg: 5.0,
            variance_mm2: Some([0.03, 0.01]),
        };
        let measured = Measured {
            samples: errors.iter().map(sample).collect(),
            nees: vec![Some(nees), None],
            errors_px: vec![0.3, -0.4],
            corners: [2, 0],
            undistorted: Vec::new(),
        };
        SeedResult { measured, calibration_errors_px: Vec::new(), photographs: [1, 0], stated_px: 0.1 }
    }

    #[test]
    fn figures_are_those_of_the_samples() {
        let table = Table::of(&[seed(&[0.1, -0.3], 2.0), seed(&[0.5], 5.0)]);
        let row = table.row("human", "ours").unwrap();
        assert!((row.figures.mean_abs_mm - 0.3).abs() < 1e-12 && (row.figures.bias_mm - 0.1).abs() < 1e-12);
        assert!((row.figures.rel_percent - 100.0 * 0.3 / 350.0).abs() < 1e-12);
        // √(2/π · 0.04)
        assert!((row.figures.crb_mm.unwrap() - 0.159_576_9).abs() < 1e-6);
        assert_eq!(row.nees, Some(3.5));
        assert!((table.corner_px - 0.125f64.sqrt()).abs() < 1e-12);
        assert_eq!(row.field.len(), 1);
        assert!(table.row("human", "midpoint").is_none());
    }

    /// Of 150 degrees of freedom: 117.985 and 185.800 (tables of χ²).
    #[test]
    fn the_band_is_that_of_chi_square() {
        let table = Table::of(&vec![seed(&[0.1], 3.0); 50]);
        let [low, high] = table.nees_band();
        assert!((low - 117.985 / 50.0).abs() < 2e-3 && (high - 185.800 / 50.0).abs() < 2e-3, "{low} {high}");
    }
}
