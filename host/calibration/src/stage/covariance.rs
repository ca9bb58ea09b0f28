//! The covariance of a calibrated stage as that of the numbers in its rig file.
//!
//! The solver tilts directions and shifts lines along two vectors across each; a file states them along the axes of the base frame,
//! which need no convention of their own.

use nalgebra::{DMatrix, Vector3};
use vergence_rig::{CalibratedNumbers, InvalidCovariance, RigNumber};

use crate::extrinsics::Side;
use crate::stage::mechanism::{State, direction};
use crate::stage::twist::across;
use crate::stage::unknowns::{Ordinal, Unknown};

/// The covariance of the rig's numbers by that of the mechanism's unknowns and, after these, of the lenses where they were refined.
pub(super) fn of_numbers(
    state: &State,
    mechanism: &[Unknown],
    lens_numbers: &[RigNumber],
    covariance: &DMatrix<f64>,
) -> Result<CalibratedNumbers, InvalidCovariance> {
    let mut numbers = Vec::new();
    // For each number its derivative by each unknown.
    let mut rows: Vec<Vec<(usize, f64)>> = Vec::new();
    let mut nth = Ordinal::default();
    for (unknown_index, &unknown) in mechanism.iter().enumerate() {
        for (number, by) in moved_by(state, unknown, nth.next(unknown)) {
            let row = numbers.iter().position(|&known| known == number).unwrap_or_else(|| {
                numbers.push(number);
                rows.push(Vec::new());
                numbers.len() - 1
            });
            rows[row].push((unknown_index, by));
        }
    }
    for (lens, column) in lens_numbers.iter().zip(mechanism.len()..) {
        numbers.push(*lens);
        rows.push(vec![(column, 1.0)]);
    }
    let mut by_unknowns = DMatrix::zeros(numbers.len(), covariance.nrows());
    for (row, entries) in rows.iter().enumerate() {
        entries.iter().for_each(|&(column, by)| by_unknowns[(row, column)] = by);
    }
    let total = &by_unknowns * covariance * by_unknowns.transpose();
    CalibratedNumbers::new(numbers, (&total + total.transpose()) * 0.5)
}

/// The numbers that component `nth` of `unknown` moves, each with its derivative.
fn moved_by(state: &State, unknown: Unknown, nth: usize) -> Vec<(RigNumber, f64)> {
    let along = |vector: Vector3<f64>, number: &dyn Fn(usize) -> RigNumber| {
        (0..3).map(|component| (number(component), vector[component])).collect()
    };
    let across_screw = |side: Side, link: usize| {
        state.links(side).get(link).map_or(Vector3::zeros(), |link| across(&direction(&link.screw))[nth % 2])
    };
    match unknown {
        Unknown::Direction { side, link: screw, .. } => {
            along(across_screw(side, screw), &|component| RigNumber::ScrewDirection { side, screw, component })
        }
        Unknown::Line { side, link: screw, .. } => {
            along(across_screw(side, screw), &|component| RigNumber::ScrewLine { side, screw, component })
        }
        Unknown::Rotation => vec![(RigNumber::RightTurn { component: nth % 3 }, 1.0)],
        Unknown::Position => vec![(RigNumber::RightShift { component: nth % 3 }, 1.0)],
        // A file holds the scale in the shares of the screws; what is left is relative to it.
        Unknown::Scale { axis } => {
            vec![(RigNumber::Scale { axis }, 1.0 / state.scales.get(axis).copied().unwrap_or(1.0))]
        }
        Unknown::Reading { .. } | Unknown::Return { .. } => Vec::new(),
    }
}
