//! Whether the loop of a trunk closes as its joints read, and which reading is wrong where it does not.

use std::f64::consts::TAU;
use std::fmt;

use nalgebra::{DMatrix, DVector, SVector};
use vergence_vision::Angle;

use super::{RigTrunk, TRUNK_AXES, TRUNK_PARAMETERS, TrunkCovariance, TrunkParameters};

type Numbers = SVector<f64, TRUNK_PARAMETERS>;

/// A loop that is missed by more standard deviations than this is no matter of noise.
const MOST_MISSED: f64 = 4.0;
/// Standard deviation in radians of a reading of which nothing is believed.
const ANY: f64 = TAU;
/// Step of differences, in radians and millimetres.
const STEP: f64 = 1e-5;
/// Linearisations after which the nearest closed shape is not found, and a change that no longer matters.
const ROUNDS: usize = 30;
const SETTLED: f64 = 1e-6;

/// How the readings of a trunk's joints fit its closed loop.
#[derive(Clone, Debug, PartialEq)]
pub struct TrunkClosure {
    /// Distance from the readings to the nearest ones for which the loop closes, in standard deviations of the joints' errors: those of
    /// encoder, play and zero. 0 where the loop closes as read.
    pub missed: f64,
    /// Whether the shape is near a dead centre of the linkage, see [`RigTrunk::is_near_dead_centre`].
    pub is_near_dead_centre: bool,
    /// Where the loop is missed by more than noise: the axes of which one wrong reading explains it, each with the error it would have,
    /// the least error first. Empty where none explains it alone.
    pub suspects: Vec<(String, Angle)>,
}

/// The loop of a trunk does not close as its joints read: at least one reading is wrong.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[error(
    "the links of the trunk do not meet as its joints read, by {missed:.1} times what the joints are uncertain (noise is at most \
     {MOST_MISSED}): {}; check its servo and its zero, or calibrate the trunk with 'vergence calibrate stage'",
    Suspects(.suspects)
)]
pub struct OpenLoop {
    /// See [`TrunkClosure::missed`].
    pub missed: f64,
    /// See [`TrunkClosure::suspects`].
    pub suspects: Vec<(String, Angle)>,
}

struct Suspects<'a>(&'a [(String, Angle)]);

impl fmt::Display for Suspects<'_> {
    fn fmt(&self, text: &mut fmt::Formatter<'_>) -> fmt::Result {
        if self.0.is_empty() {
            return text.write_str("more than one reading is wrong");
        }
        text.write_str("most likely wrong is the reading of ")?;
        for (place, (axis, error)) in self.0.iter().enumerate() {
            let between = if place == 0 { "" } else { ", or of " };
            write!(text, "{between}'{axis}' by {:+.1}°", error.deg())?;
        }
        Ok(())
    }
}

impl TrunkClosure {
    /// The trunk with its driven joints read at `driven`; `covariance` is that of the trunk's numbers, with the errors of the readings
    /// on top of those of the zeros. `names` are those of the axes of the driven joints.
    pub(crate) fn of(
        trunk: &RigTrunk,
        driven: [f64; TRUNK_AXES],
        covariance: &TrunkCovariance,
        names: [&str; TRUNK_AXES],
    ) -> Self {
        let shape = Readings::new(trunk, driven);
        let missed = shape.nearest_closed(covariance).0;
        let suspects = if missed > MOST_MISSED { shape.suspects(covariance, names) } else { Vec::new() };
        Self { missed, is_near_dead_centre: trunk.is_near_dead_centre_at(driven), suspects }
    }

    /// Refuses a loop that is missed by more than noise.
    ///
    /// # Errors
    /// [`OpenLoop`], which names the readings most likely wrong.
    pub fn check(&self) -> Result<(), OpenLoop> {
        if self.missed <= MOST_MISSED {
            return Ok(());
        }
        Err(OpenLoop { missed: self.missed, suspects: self.suspects.clone() })
    }
}

/// What a closed loop asks of the readings.
#[derive(Clone, Copy)]
enum Asked {
    /// Flat, and corners D and F within reach: both folds alike.
    FoldsAlike,
    /// Flat, and D and F too far apart: both folds alike, and D and F as far apart as the links between them reach.
    WithinReach,
    /// Folded: the folds alike, and both hinges on one line, so that A and C are alike and the ends parallel.
    HingesInLine,
}

struct Readings {
    parameters: TrunkParameters,
    driven: [f64; TRUNK_AXES],
    asked: Asked,
}

impl Readings {
    fn new(trunk: &RigTrunk, driven: [f64; TRUNK_AXES]) -> Self {
        let parameters = trunk.parameters();
        let [a, b, c, folds @ ..] = driven;
        let asked = match RigTrunk::are_flat(folds) {
            false => Asked::HingesInLine,
            true if parameters.links.six_bar().beyond_reach([a, b, c]) > 0.0 => Asked::WithinReach,
            true => Asked::FoldsAlike,
        };
        Self { parameters, driven, asked }
    }

    /// What a closed loop asks to be zero, with the trunk's numbers off `by`; angles in radians, and distances in shares.
    fn open(&self, by: &Numbers) -> DVector<f64> {
        let off = TrunkParameters::from_array(&(Numbers::from(self.parameters.to_array()) + by).into());
        let [a, b, c, rear, front] = std::array::from_fn(|joint| self.driven[joint] + off.zeros[joint]);
        let folds = rear - front;
        match self.asked {
            Asked::FoldsAlike => DVector::from_column_slice(&[folds]),
            Asked::WithinReach => {
                let reach = (2.0 * off.links.side).powi(2);
                DVector::from_column_slice(&[folds, off.links.six_bar().beyond_reach([a, b, c]) / reach])
            }
            Asked::HingesInLine => DVector::from_column_slice(&[folds, a - c, a + b + c - TAU]),
        }
    }

    /// The likeliest errors of the numbers with which the loop closes, and how many standard deviations away they are: the design
    /// point of R. Rackwitz and B. Fiessler, Computers & Structures 9(5), 1978. Infinitely many where there is none.
    fn nearest_closed(&self, covariance: &TrunkCovariance) -> (f64, Numbers) {
        let mut by = Numbers::zeros();
        for _ in 0..ROUNDS {
            let open = self.open(&by);
            let slopes: Vec<DVector<f64>> = (0..TRUNK_PARAMETERS)
                .map(|number| {
                    let step = Numbers::ith(number, STEP);
                    (self.open(&(by + step)) - self.open(&(by - step))) / (2.0 * STEP)
                })
                .collect();
            let slopes = DMatrix::from_columns(&slopes);
            let spread = &slopes * covariance * slopes.transpose();
            let Some(factors) = spread.clone().cholesky() else { break };
            let force = factors.solve(&(&slopes * by - open));
            let next: Numbers = covariance * (slopes.transpose() * &force);
            let change = (next - by).amax();
            by = next;
            if change < SETTLED {
                return (force.dot(&(spread * &force)).max(0.0).sqrt(), by);
            }
        }
        (f64::INFINITY, by)
    }

    /// The readings of which one alone, if nothing of it is believed, brings the loop within noise; and the error it then has.
    fn suspects(&self, covariance: &TrunkCovariance, names: [&str; TRUNK_AXES]) -> Vec<(String, Angle)> {
        let mut found: Vec<(String, Angle)> = Vec::new();
        for (joint, name) in names.into_iter().enumerate() {
            let mut without = *covariance;
            without[(joint, joint)] += ANY.powi(2);
            let (missed, by) = self.nearest_closed(&without);
            if missed <= MOST_MISSED {
                found.push((name.to_owned(), Angle::from_rad(-by[joint])));
            }
        }
        found.sort_by(|one, other| one.1.rad().abs().total_cmp(&other.1.rad().abs()));
        found
    }
}
