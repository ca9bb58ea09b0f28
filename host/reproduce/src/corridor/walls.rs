//! Distances to both walls of the corridor, from the points of one measurement.

use serde_json::{Value, json};
use vergence_rig::rounded;

use super::Station;

/// Width of the bins in which points vote for a wall, in millimetres.
const BIN: f64 = 10.0;
/// Least number of points of a wall.
const LEAST: usize = 8;

/// Part of the votes of the fullest bin that a bin farther away must have.
const ABOUT_AS_FULL: f64 = 0.35;

/// Distances from the robot's middle to the left and the right wall in millimetres; `None` where too few points tell.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Walls {
    /// Measured.
    pub measured: [Option<f64>; 2],
    /// True.
    pub truth: [f64; 2],
}

/// Finds on each side the plane along the corridor on which most points lie; what stands before a wall is nearer.
pub fn walls(station: &Station) -> Walls {
    let across: Vec<f64> = station.in_corridor().map(|point| point.mm().x - station.place.x).collect();
    let measured = [-1.0, 1.0].map(|side| {
        let mut distances: Vec<f64> = across.iter().map(|x| side * x).filter(|distance| *distance > 300.0).collect();
        distances.sort_by(f64::total_cmp);
        wall(&distances)
    });
    let half = station.plan().half_width;
    Walls { measured, truth: [half + station.place.x, half - station.place.x] }
}

/// The median of the points around the fullest bin near the farthest one that is about as full as any: a parcel's face may hold more
/// points than the wall behind it, but stands before it.
fn wall(distances: &[f64]) -> Option<f64> {
    let near = |centre: f64| distances.iter().copied().filter(move |distance| (distance - centre).abs() <= BIN);
    let votes: Vec<(f64, usize)> = distances.iter().map(|&centre| (centre, near(centre).count())).collect();
    let most = votes.iter().map(|(_, count)| *count).max()?;
    let full = |count: usize| count as f64 >= ABOUT_AS_FULL * most as f64;
    let farthest = votes.iter().rev().find(|(_, count)| full(*count)).map(|(centre, _)| *centre)?;
    let around = votes.iter().filter(|(centre, _)| (centre - farthest).abs() <= 3.0 * BIN);
    let (fullest, _) = around.max_by_key(|(_, count)| *count)?;
    let votes: Vec<f64> = near(*fullest).collect();
    (votes.len() >= LEAST).then(|| votes[votes.len() / 2])
}

impl Walls {
    /// For people.
    pub(super) fn in_words(&self) -> String {
        let told = |side: &str, number: usize| match self.measured[number] {
            Some(mm) => format!("{side} wall at {mm:.0} mm (truth {:.0})", self.truth[number]),
            None => format!("{side} wall not seen"),
        };
        format!("{}, {}", told("left", 0), told("right", 1))
    }

    /// For programs.
    pub(super) fn json(&self) -> Value {
        let side = |number: usize| {
            json!({
                "measured": self.measured[number].map(rounded),
                "error": self.measured[number].map(|mm| rounded(mm - self.truth[number])),
            })
        };
        json!({ "left": side(0), "right": side(1) })
    }
}
