//! Names of places in an image.

use std::f64::consts::{PI, TAU};

/// Parts of the turn about the axis that have a name.
pub(super) const OCTANTS: usize = 8;

const NAMES: [&str; OCTANTS] =
    ["right", "lower right", "bottom", "lower left", "left", "upper left", "top", "upper right"];

/// The octant of the azimuth `phi`, in radians from right to down.
pub(super) fn octant(phi: f64) -> usize {
    let share = (phi + PI / OCTANTS as f64).rem_euclid(TAU) / TAU;
    ((share * OCTANTS as f64) as usize).min(OCTANTS - 1)
}

pub(super) fn name(octant: usize) -> &'static str {
    NAMES.get(octant).copied().unwrap_or("")
}

/// "a", "a and b", "a, b and c".
pub(super) fn list(names: &[String]) -> String {
    match names {
        [] => String::new(),
        [only] => only.clone(),
        [first @ .., last] => format!("{} and {last}", first.join(", ")),
    }
}
