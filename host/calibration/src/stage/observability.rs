//! Which unknowns of the mechanism the stage poses determine, and which further pose would help most.

use nalgebra::{DMatrix, DVector, Matrix6};
use vergence_rig::{AxisPosition, Rig};

use crate::extrinsics::{ExtrinsicsCalibration, Fit};
use crate::stage::Tolerance;
use crate::stage::mechanism::State;
use crate::stage::model::Model;
use crate::stage::result::grid;
use crate::stage::unknowns::Unknown;

/// A combination of unknowns is undetermined if its standard deviation from the data exceeds this share of its
/// tolerance.
const LEARNED: f64 = 0.5;
/// Units of the right camera's pose at zero, which no drawing states: one degree, one millimetre.
const AT_ZERO: (f64, f64) = (0.017_453_292_519_943_295, 1.0);
/// An axis whose readings differ by less than this share of its range has not moved.
const MOVED: f64 = 0.01;

/// Observability of a mechanism from stage poses.
#[derive(Clone, Debug, PartialEq)]
pub struct Observability {
    /// Combinations of unknowns that the corners do not determine, the worst first; empty is good.
    pub weak: Vec<WeakDirection>,
    /// Names of axes that stood still.
    pub never_moved: Vec<String>,
    /// Number of unknowns of the mechanism.
    pub unknowns: usize,
    /// Number of combinations of them that the corners determine.
    pub determined: usize,
    /// Ratio of the best and the worst determined combination's information, each in units of its tolerance.
    pub condition: f64,
    /// The most informative further stage pose, among the corners and middles of the axes' ranges.
    pub next_pose: Vec<AxisPosition>,
}

/// A combination of unknowns that the corners do not determine.
#[derive(Clone, Debug, PartialEq)]
pub struct WeakDirection {
    /// Names of the unknowns that take part, the largest share first.
    pub unknowns: Vec<String>,
    /// Standard deviation from the corners alone, in tolerances (infinite: undetermined).
    pub sigma: f64,
}

impl std::fmt::Display for Observability {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let next: Vec<String> = self.next_pose.iter().map(ToString::to_string).collect();
        if self.weak.is_empty() {
            write!(f, "every unknown is determined; a pose at ({}) would tell most", next.join(", "))?;
            return Ok(());
        }
        for axis in &self.never_moved {
            write!(f, "'{axis}' never moved: add a pose with another {axis}; ")?;
        }
        let weak: Vec<String> = self.weak.iter().map(|weak| weak.unknowns.join(" with ")).collect();
        write!(f, "not determined: {}; add a pose at ({})", weak.join("; "), next.join(", "))
    }
}

/// Observability from the information of `fit`.
pub(crate) fn observability(
    rig: &Rig,
    model: &Model,
    fit: &Fit<State>,
    alone: &[ExtrinsicsCalibration],
) -> Observability {
    let mechanism: Vec<Unknown> = model.unknowns.iter().copied().filter(|unknown| unknown.is_mechanical()).collect();
    let units =
        DVector::from_iterator(mechanism.len(), mechanism.iter().map(|&unknown| unit(unknown, model.tolerance)));
    let scaled =
        |matrix: DMatrix<f64>| DMatrix::from_fn(units.len(), units.len(), |i, j| matrix[(i, j)] * units[i] * units[j]);
    let information = scaled(marginal(&fit.information, mechanism.len()) / (fit.sigma * fit.sigma));
    let held = DVector::from_iterator(
        mechanism.len(),
        mechanism.iter().map(|&unknown| f64::from(u8::from(model.tolerance.is_some() && is_drawn(unknown)))),
    );
    let eigen = information.clone().symmetric_eigen();
    let mut order: Vec<usize> = (0..units.len()).collect();
    // Information of the corners: the total less that of the drawing.
    let learned: Vec<f64> =
        order.iter().map(|&i| eigen.eigenvalues[i] - eigen.eigenvectors.column(i).map(|x| x * x).dot(&held)).collect();
    order.sort_by(|&a, &b| learned[a].total_cmp(&learned[b]));
    let names: Vec<String> = rig.axes.iter().map(|axis| axis.name.clone()).collect();
    let weak: Vec<WeakDirection> = order
        .iter()
        .filter(|&&i| learned[i] < 1.0 / (LEARNED * LEARNED))
        .map(|&i| WeakDirection {
            unknowns: in_words(&eigen.eigenvectors.column(i).into_owned(), &mechanism, &names),
            sigma: if learned[i] > 1e-9 { learned[i].sqrt().recip() } else { f64::INFINITY },
        })
        .collect();
    let best = order.last().map_or(0.0, |&i| learned[i]);
    let worst = order.get(weak.len()).map_or(best, |&i| learned[i]);
    Observability {
        never_moved: never_moved(rig, model),
        unknowns: units.len(),
        determined: units.len() - weak.len(),
        condition: best / worst,
        next_pose: next_pose(rig, &fit.shared.state, &mechanism, &units, &information, alone),
        weak,
    }
}

/// The tolerance of an unknown, the unit of its scaled information.
fn unit(unknown: Unknown, tolerance: Option<Tolerance>) -> f64 {
    let tolerance = tolerance.unwrap_or_default();
    match unknown {
        Unknown::Direction { .. } => tolerance.direction.rad(),
        Unknown::Line { .. } => tolerance.position.mm(),
        Unknown::Rotation => AT_ZERO.0,
        Unknown::Position => AT_ZERO.1,
        Unknown::Scale { .. } | Unknown::Reading { .. } | Unknown::Return { .. } => tolerance.scale,
    }
}

/// Whether the drawing gives a prior for it.
fn is_drawn(unknown: Unknown) -> bool {
    matches!(unknown, Unknown::Direction { .. } | Unknown::Line { .. } | Unknown::Scale { .. })
}

/// The information of the first `count` unknowns when all others are unknown too.
fn marginal(information: &DMatrix<f64>, count: usize) -> DMatrix<f64> {
    let others = information.nrows() - count;
    let own = information.view((0, 0), (count, count)).into_owned();
    let coupling = information.view((0, count), (count, others)).into_owned();
    let rest = information.view((count, count), (others, others)).into_owned();
    match (others > 0).then(|| rest.cholesky()).flatten() {
        Some(factor) => own - &coupling * factor.solve(&coupling.transpose()),
        None => own,
    }
}

/// The unknowns that make up most of `direction`, each once, the largest part first.
fn in_words(direction: &DVector<f64>, mechanism: &[Unknown], names: &[String]) -> Vec<String> {
    const PART: f64 = 0.05;
    let mut parts: Vec<(Unknown, f64)> = Vec::new();
    for (&unknown, component) in mechanism.iter().zip(direction.iter()) {
        match parts.iter_mut().find(|(known, _)| *known == unknown) {
            Some((_, part)) => *part += component * component,
            None => parts.push((unknown, component * component)),
        }
    }
    parts.sort_by(|a, b| b.1.total_cmp(&a.1));
    parts.iter().filter(|(_, part)| *part >= PART).map(|(unknown, _)| unknown.words(names)).collect()
}

fn never_moved(rig: &Rig, model: &Model) -> Vec<String> {
    let moved = |index: usize, range: f64| {
        let values = model.readings.iter().filter_map(|readings| readings.get(index));
        let (low, high) = values.fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), &v| (low.min(v), high.max(v)));
        high - low > MOVED * range
    };
    let still = rig.axes.iter().enumerate().filter(|(index, axis)| {
        let [low, high] = axis.range.map(AxisPosition::value);
        !moved(*index, high - low)
    });
    still.map(|(_, axis)| axis.name.clone()).collect()
}

/// The pose of [`grid`] that makes the determinant of the information largest (D-optimal design, V. Fedorov, *Theory of
/// Optimal Experiments*, 1972), if it gave as much information on its relative pose as the existing ones do on average.
fn next_pose(
    rig: &Rig,
    state: &State,
    mechanism: &[Unknown],
    units: &DVector<f64>,
    information: &DMatrix<f64>,
    alone: &[ExtrinsicsCalibration],
) -> Vec<AxisPosition> {
    let alone_information: Matrix6<f64> =
        alone.iter().filter_map(|pose| pose.noise_covariance.try_inverse()).sum::<Matrix6<f64>>()
            / (alone.len().max(1) as f64);
    let gain = |values: &Vec<f64>| {
        let derivative = state.derivative(values, mechanism, None) * DMatrix::from_diagonal(units);
        let total = information + derivative.transpose() * alone_information * &derivative;
        // An information of one in units of the tolerance stands in for undetermined combinations.
        let regular = total + DMatrix::identity(units.len(), units.len());
        regular.cholesky().map_or(f64::NEG_INFINITY, |factor| factor.l().diagonal().iter().map(|x| x.ln()).sum())
    };
    let best = grid(&rig.axes).into_iter().max_by(|a, b| gain(a).total_cmp(&gain(b))).unwrap_or_default();
    best.iter().zip(&rig.axes).map(|(&value, axis)| AxisPosition::from_value(axis.kind, value)).collect()
}
