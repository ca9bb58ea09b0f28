//! What runs found, their means over seeds, and the bands in which those of honest ones lie.

use crate::common::count;

/// The square of three standard deviations.
const FAR: f64 = 9.0;
/// By how much the NEES of the ranges of single places differ, as a standard deviation: places show more edges or fewer.
const PLACES: f64 = 0.3;
/// How far their mean over many places may be from one. Errors are stated for rooms of all kinds: in the corridor, which has few edges, the mean is 0.75,
/// in the furnished room 1.2 (docs/measured/moving.md).
const SCENES: f64 = 0.2;

/// What a run found.
#[derive(Default)]
pub struct Found {
    /// Squared error of each range over its variance, of right matches: of one.
    pub ranges: Vec<f64>,
    /// Those of points beside an edge, and the others.
    pub beside_edges: Vec<f64>,
    pub elsewhere: Vec<f64>,
    /// Probability that each match is wrong or off by more than three sigma, by its score.
    pub doubts: Vec<f64>,
    /// Squared error of each point across the epipolar plane over its variance: of one. The truth is what the left pixel shows, so that nothing is off at right angles to both.
    pub across: Vec<f64>,
    /// Matches that are not right.
    pub wrong: u64,
    pub at_edges: u64,
    /// Squared error of each pose over its covariance: of six.
    pub poses: Vec<f64>,
    /// Exposures while the stages moved.
    pub moving: u64,
}

pub fn mean(values: &[f64]) -> f64 {
    values.iter().sum::<f64>() / values.len() as f64
}

/// The mean over seeds of the mean of each, and half the width of its 95 % band by their scatter: points of a seed share their calibration.
fn over_seeds(all: &[Found], of: impl Fn(&Found) -> Vec<f64>) -> [f64; 2] {
    let means: Vec<f64> = all.iter().map(|found| mean(&of(found))).collect();
    let whole = mean(&means);
    let variance = means.iter().map(|value| (value - whole).powi(2)).sum::<f64>() / (means.len() as f64 - 1.0).max(1.0);
    [whole, 1.96 * (variance / means.len() as f64).sqrt()]
}

/// Squared errors over their variance: of ranges, of places across the epipolar plane, of poses.
pub struct Nees {
    pub range: [f64; 2],
    pub across: [f64; 2],
    pub pose: [f64; 2],
    pub wrong: f64,
    /// Part of the ranges that lies beyond three sigma, and what scores let expect.
    pub beyond: f64,
    pub doubt: f64,
}

pub fn tell(name: &str, all: &[Found], freedom: usize) -> Nees {
    let points: usize = all.iter().map(|found| found.ranges.len()).sum();
    let wrong: u64 = all.iter().map(|found| found.wrong).sum();
    let edges: u64 = all.iter().map(|found| found.at_edges).sum();
    let beyond = |of: fn(&Found) -> &Vec<f64>| {
        let all: Vec<f64> = all.iter().flat_map(of).copied().collect();
        all.iter().filter(|nees| **nees > FAR).count() as f64 / all.len() as f64
    };
    let nees = Nees {
        range: over_seeds(all, |found| found.ranges.clone()),
        across: over_seeds(all, |found| found.across.clone()),
        pose: over_seeds(all, |found| found.poses.clone()),
        wrong: wrong as f64 / (points as f64 + wrong as f64),
        beyond: beyond(|found| &found.ranges),
        doubt: mean(&all.iter().flat_map(|found| &found.doubts).copied().collect::<Vec<f64>>()),
    };
    let seeds = all.len();
    println!(
        "{name}, {seeds} seeds: {points} right points, {wrong} wrong, {edges} at edges; {:.4} beyond 3 sigma, {:.4} by scores",
        nees.beyond, nees.doubt
    );
    for (what, of) in [
        ("beside edges", (|found| &found.beside_edges) as fn(&Found) -> &Vec<f64>),
        ("elsewhere", |found| &found.elsewhere),
    ] {
        let all: Vec<f64> = all.iter().flat_map(of).copied().collect();
        println!("  {what}: {} points, NEES of range {:.2}, {:.4} beyond 3 sigma", all.len(), mean(&all), beyond(of));
    }
    for (what, of, [mean, half]) in [
        ("range", "1", nees.range),
        ("place across the epipolar plane", "1", nees.across),
        ("pose", &freedom.to_string(), nees.pose),
    ] {
        println!("  NEES of {what}: {mean:.3} ± {half:.3} of {of}");
    }
    nees
}

/// Whether matches are right, ranges as uncertain as stated, and no more of them far off than scores say, as far as so many places tell.
pub fn check(nees: &Nees) {
    assert!(nees.wrong < 0.01, "{} of the matches are wrong", nees.wrong);
    let chance = 1.96 * PLACES / f64::from(count("VERGENCE_SEEDS", 1)).sqrt();
    let most = SCENES + chance;
    assert!((nees.range[0] - 1.0).abs() < most, "{:?} is not within 1 ± {most}", nees.range);
    assert!(nees.beyond < nees.doubt + 0.05 * chance, "{} beyond three sigma, {} by scores", nees.beyond, nees.doubt);
}

/// Half the band in which the mean of honest poses of this freedom lies in 95 of 100 cases: each is χ² with this mean and twice the variance.
pub fn band(freedom: f64) -> f64 {
    1.96 * (2.0 * freedom / f64::from(count("VERGENCE_SEEDS", 1))).sqrt()
}
