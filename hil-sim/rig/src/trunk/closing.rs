//! The angles at which the loop closes and the springs of the driven joints are strained least.

use nalgebra::{SMatrix, SVector};
use vergence_rig::linkage::{Loop, TrunkJoint};

use super::{DRIVEN, JOINTS};

type Joints = SVector<f64, JOINTS>;

/// Weight of the closure beside the springs.
const CLOSURE: f64 = 1e6;
/// Weight that holds passive joints where they are, so that a singular shape has an answer.
const HOLD: f64 = 1e-4;
const MOST_STEPS: usize = 40;
const SETTLED: f64 = 1e-10;
/// A loop that is not closed so far, by [`Loop::closure_error`], is no answer.
const CLOSED: f64 = 1e-9;
/// Steps that close what the weights leave open: a few, but at a dead centre each only quarters it.
const CLOSING_STEPS: usize = 40;
/// Keeps a singular shape solvable. Far below the square of what a joint is off a dead centre where the loop is closed to
/// [`CLOSED`], lest the last steps crawl.
const SINGULAR: f64 = 1e-13;
/// What is closed well enough.
const TIGHT: f64 = 1e-11;
/// Joint E is kept this far, in radians, from a straight line on the outer side: at the dead centre the loop could turn in on
/// itself as well. A stop of that joint, assumed, keeps it from going further.
const CONVEX: f64 = 1e-3;

/// The joints' angles, continued from those `before`, with the driven joints held at `held` by springs.
pub(super) fn close(linkage: &Loop<JOINTS>, before: &[f64; JOINTS], held: &[f64; DRIVEN]) -> [f64; JOINTS] {
    let e = TrunkJoint::E.index();
    let mut start = *before;
    keep_convex(&mut start);
    let mut wanted: [Option<f64>; JOINTS] = [None; JOINTS];
    for (joint, held) in TrunkJoint::DRIVEN.into_iter().zip(held) {
        wanted[joint.index()] = Some(*held);
    }
    let mut angles = settle(linkage, &start, &wanted);
    if angles[e] < 0.0 {
        // The stop of joint E holds against the driven joints' springs.
        wanted[e] = Some(CONVEX);
        angles = settle(linkage, &start, &wanted);
    }
    // Far from any shape that closes the search may fail: the links stay where they were, and the springs give more.
    if linkage.closure_error(&angles) < CLOSED { angles } else { *before }
}

/// The closed loop that is nearest to the angles wanted, by Gauss-Newton steps from `start`.
fn settle(linkage: &Loop<JOINTS>, start: &[f64; JOINTS], wanted: &[Option<f64>; JOINTS]) -> [f64; JOINTS] {
    let mut angles = *start;
    let weights = Joints::from_iterator(wanted.iter().map(|wanted| if wanted.is_some() { 1.0 } else { HOLD }));
    for _ in 0..MOST_STEPS {
        let missing = wanted.iter().zip(&angles).map(|(wanted, angle)| wanted.map_or(0.0, |wanted| wanted - angle));
        let missing = Joints::from_iterator(missing);
        let twists = linkage.twists(&angles);
        let normal = SMatrix::from_diagonal(&weights) + twists.transpose() * twists * CLOSURE;
        let right = weights.component_mul(&missing) - twists.transpose() * residual(linkage, &angles) * CLOSURE;
        let Some(step) = normal.cholesky().map(|factors| factors.solve(&right)) else { break };
        // Long steps go wrong near a dead centre.
        let step = step * (0.2 / step.amax()).min(1.0);
        angles.iter_mut().zip(step.iter()).for_each(|(angle, by)| *angle += by);
        if step.amax() < SETTLED {
            break;
        }
    }
    put_together(linkage, &mut angles);
    angles
}

/// Closes what is left with the least motion of all joints.
fn put_together(linkage: &Loop<JOINTS>, angles: &mut [f64; JOINTS]) {
    for _ in 0..CLOSING_STEPS {
        let left = residual(linkage, angles);
        if left.amax() < TIGHT {
            break;
        }
        let twists = linkage.twists(angles);
        let gram = twists * twists.transpose() + SMatrix::<f64, 6, 6>::identity() * SINGULAR;
        let Some(factors) = gram.cholesky() else { break };
        let step = -twists.transpose() * factors.solve(&left);
        angles.iter_mut().zip(step.iter()).for_each(|(angle, by)| *angle += by);
    }
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
