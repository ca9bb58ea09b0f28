//! The angles at which the loop closes and the springs of the driven joints are strained least.

use nalgebra::{SMatrix, SVector};
use vergence_rig::linkage::{Loop, TrunkJoint};

use super::{DRIVEN, JOINTS};

type Joints = SVector<f64, JOINTS>;

/// Weight of the closure beside the springs.
const CLOSURE: f64 = 1e6;
/// Weight that holds passive joints where they are, so that a singular shape has an answer.
const HOLD: f64 = 1e-4;
const MOST_STEPS: usize = 12;
const SETTLED: f64 = 1e-10;
/// Steps that close what the weights leave open, with the least motion of all joints.
const CLOSING_STEPS: usize = 4;
/// Joint E is kept this far, in radians, from a straight line on the outer side: at the dead centre the loop could turn in on
/// itself as well. A stop of the real trunk does so (assumed).
const CONVEX: f64 = 1e-3;

/// The joints' angles, continued from those `before`, with the driven joints held at `held` by springs.
pub(super) fn close(linkage: &Loop<JOINTS>, before: &[f64; JOINTS], held: &[f64; DRIVEN]) -> [f64; JOINTS] {
    let mut angles = *before;
    let mut weights = Joints::repeat(HOLD);
    for (joint, held) in TrunkJoint::DRIVEN.into_iter().zip(held) {
        angles[joint.index()] = *held;
        weights[joint.index()] = 1.0;
    }
    keep_convex(&mut angles);
    for _ in 0..MOST_STEPS {
        let mut wanted = Joints::zeros();
        for (joint, held) in TrunkJoint::DRIVEN.into_iter().zip(held) {
            wanted[joint.index()] = held - angles[joint.index()];
        }
        let twists = linkage.twists(&angles);
        let residual = residual(linkage, &angles);
        let normal = SMatrix::from_diagonal(&weights) + twists.transpose() * twists * CLOSURE;
        let right = weights.component_mul(&wanted) - twists.transpose() * residual * CLOSURE;
        let Some(step) = normal.cholesky().map(|factors| factors.solve(&right)) else { break };
        // Long steps go wrong near a dead centre.
        let step = step * (0.2 / step.amax()).min(1.0);
        angles.iter_mut().zip(step.iter()).for_each(|(angle, by)| *angle += by);
        if step.amax() < SETTLED {
            break;
        }
    }
    for _ in 0..CLOSING_STEPS {
        let twists = linkage.twists(&angles);
        let gram = twists * twists.transpose() + SMatrix::<f64, 6, 6>::identity() * 1e-9;
        let Some(factors) = gram.cholesky() else { break };
        let step = -twists.transpose() * factors.solve(&residual(linkage, &angles));
        angles.iter_mut().zip(step.iter()).for_each(|(angle, by)| *angle += by);
    }
    angles
}

/// What is left of the loop: a turn, and a shift in scales.
fn residual(linkage: &Loop<JOINTS>, angles: &[f64; JOINTS]) -> SVector<f64, 6> {
    let closure = linkage.closure(angles);
    let turn = closure.rotation.scaled_axis();
    let shift = closure.translation.vector / linkage.scale();
    SVector::<f64, 6>::new(turn.x, turn.y, turn.z, shift.x, shift.y, shift.z)
}

/// Where E is straight, or beyond, it goes to the outer side, and D and F with it.
fn keep_convex(angles: &mut [f64; JOINTS]) {
    let [d, e, f] = [TrunkJoint::D, TrunkJoint::E, TrunkJoint::F].map(TrunkJoint::index);
    let missing = CONVEX - angles[e];
    if missing > 0.0 {
        angles[e] += missing;
        angles[d] -= missing / 2.0;
        angles[f] -= missing / 2.0;
    }
}
