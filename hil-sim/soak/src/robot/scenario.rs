//! A scenario of a robot.

use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64Mcg;
use vergence_sim::TrunkMechanics;

use super::harm::HarmKind;

/// Largest load on a joint, such as gravity, in newton metres: a seventh of what its servo holds.
const LARGEST_LOAD: f64 = 0.5;
/// That where torque goes off in the scenario: friction carries it, or the trunk would fall, which no board can prevent.
const CARRIED_LOAD: f64 = 0.07;
/// Latest instant of a harm after the begin of a move, in microseconds.
const LATEST_HARM_US: u64 = 2_500_000;

/// One scenario.
#[derive(Clone, Debug, PartialEq)]
pub struct RobotScenario {
    /// The seed from which it was drawn.
    pub seed: u64,
    /// What goes wrong.
    pub kind: HarmKind,
    /// The axis that it goes wrong on, where it does on one.
    pub axis: usize,
    /// Modes through which the robot goes, by their places in the rig file; no two neighbours are alike.
    pub tour: Vec<usize>,
    /// The move of the tour in which it goes wrong, and when after its begin, in microseconds.
    pub harm: (usize, u64),
    /// The mechanics.
    pub mechanics: TrunkMechanics,
    /// Loads on the joints while the board is armed, in newton metres; of the mechanics where there are none.
    pub armed_loads: Option<[f64; 5]>,
}

impl RobotScenario {
    /// The scenario of a seed, for a rig with so many modes. Each kind of harm comes in turn.
    #[must_use]
    pub fn of(seed: u64, modes: usize) -> Self {
        let kind = HarmKind::ALL[(seed % HarmKind::ALL.len() as u64) as usize];
        Self::of_kind(seed, kind, modes)
    }

    /// The scenario of a seed, with another kind of harm.
    #[must_use]
    pub fn of_kind(seed: u64, kind: HarmKind, modes: usize) -> Self {
        let mut random = Pcg64Mcg::seed_from_u64(seed ^ 0x0819_a4e2);
        let mut tour: Vec<usize> = Vec::new();
        while tour.len() < 3 {
            let next = (random.random::<f64>() * modes as f64) as usize;
            if tour.last() != Some(&next) {
                tour.push(next);
            }
        }
        // Folds stand still in all modes: blocking one is no harm.
        let axes = if kind == HarmKind::Blocked { 3 } else { 5 };
        let mut share = || random.random::<f64>();
        let axis = (share() * f64::from(axes)) as usize;
        let harm = (1 + usize::from(share() < 0.5), (share() * LATEST_HARM_US as f64) as u64);
        let keeps_torque = matches!(kind, HarmKind::Nothing | HarmKind::Noise);
        let largest = if keeps_torque { LARGEST_LOAD } else { CARRIED_LOAD };
        let loads = std::array::from_fn(|_| largest * (2.0 * share() - 1.0));
        let mechanics = TrunkMechanics::default();
        let (mechanics, armed_loads) = match keeps_torque {
            true => (mechanics, Some(loads)),
            false => (TrunkMechanics { loads, ..mechanics }, None),
        };
        Self { seed, kind, axis, tour, harm, mechanics, armed_loads }
    }
}
