//! The trunk at the stage poses of a calibration, as a function of its parameters and of the true angles of its joints.
//!
//! Every joint angle of every stage pose is an unknown. The encoders say the driven ones within their play, and the loop must
//! close. Nothing here divides by the distance to a dead centre: where the passive joints do not follow the driven ones, the images
//! tell them, and the readings count for what they are.

use std::f64::consts::PI;

use nalgebra::{Isometry3, Matrix6xX, SVector};
use vergence_rig::linkage::{Loop, TrunkJoint, trunk};
use vergence_rig::{TRUNK_AXES, TRUNK_PARAMETER_NAMES, TRUNK_PARAMETERS, TrunkParameters, TrunkTolerance};

use crate::extrinsics::Kinematics;
use crate::reprojection::{POSE, difference};
use crate::schur_lm::Equations;

pub(crate) const JOINTS: usize = TrunkJoint::COUNT;
/// How well a loop is closed, in radians and in scales of the loop: far below every play, so that it bounds nothing else.
const CLOSED: f64 = 1e-4;
/// What is known of a passive joint besides, in radians: so little that it never counts beside an image.
const PASSIVE: f64 = 1.0;
/// Steps of differences: of angles in radians, of lengths in millimetres.
const STEPS: [f64; 2] = [1e-6, 1e-4];

/// The unknowns at one point.
#[derive(Clone, Debug)]
pub(crate) struct State {
    /// As of [`TrunkParameters::to_array`].
    pub parameters: [f64; TRUNK_PARAMETERS],
    /// The joints of the loop at each stage pose, in radians.
    pub angles: Vec<[f64; JOINTS]>,
}

/// Constants of the fit: drawing, readings, priors.
#[derive(Clone, Debug)]
pub(crate) struct Model {
    pub drawn: [f64; TRUNK_PARAMETERS],
    pub tolerance: TrunkTolerance,
    /// Interior angles of the driven joints by their encoders, at each stage pose.
    pub readings: Vec<[f64; TRUNK_AXES]>,
    /// Standard deviation of the reading of each driven joint, at each stage pose.
    pub reading_sigma: Vec<[f64; TRUNK_AXES]>,
    /// The joints at each stage pose as the drawing has them.
    pub start: Vec<[f64; JOINTS]>,
    /// The stage pose of each view.
    pub pose_of_view: Vec<usize>,
}

fn linkage(parameters: &TrunkParameters) -> Loop<JOINTS> {
    trunk(&parameters.links)
}

/// The place of a stage pose's first joint among the unknowns.
pub(crate) const fn first_joint(pose: usize) -> usize {
    TRUNK_PARAMETERS + pose * JOINTS
}

/// A step of a difference by parameter `index`.
fn step_of(index: usize) -> f64 {
    STEPS[usize::from(!TRUNK_PARAMETER_NAMES[index].1.is_angle())]
}

/// What is left of the loop: a turn, and a shift in scales.
fn closure(parameters: &TrunkParameters, angles: &[f64; JOINTS]) -> SVector<f64, 6> {
    let linkage = linkage(parameters);
    let left = linkage.closure(angles);
    let (turn, shift) = (left.rotation.scaled_axis(), left.translation.vector / linkage.scale());
    SVector::<f64, 6>::new(turn.x, turn.y, turn.z, shift.x, shift.y, shift.z)
}

/// Central difference of `of` at `numbers` by the number at `index`.
fn slope<const N: usize, const R: usize>(
    numbers: &[f64; N],
    index: usize,
    step: f64,
    of: impl Fn(&[f64; N], &[f64; N]) -> SVector<f64, R>,
) -> SVector<f64, R> {
    let (mut above, mut below) = (*numbers, *numbers);
    above[index] += step;
    below[index] -= step;
    of(&above, &below) / (2.0 * step)
}

impl State {
    fn trunk(&self) -> TrunkParameters {
        TrunkParameters::from_array(&self.parameters)
    }

    /// `left_from_right` at a stage pose.
    pub fn left_from_right(&self, pose: usize) -> Isometry3<f64> {
        relative(&self.trunk(), self.angles.get(pose).unwrap_or(&[0.0; JOINTS]))
    }

    /// How far the reading of each driven joint is from its true angle at a stage pose, in radians.
    pub fn reading_errors(&self, pose: usize, readings: &[f64; TRUNK_AXES]) -> [f64; TRUNK_AXES] {
        let angles = self.angles.get(pose).unwrap_or(&[0.0; JOINTS]);
        std::array::from_fn(|joint| {
            readings[joint] + self.parameters[joint] - (PI - angles[TrunkJoint::DRIVEN[joint].index()])
        })
    }
}

fn relative(parameters: &TrunkParameters, angles: &[f64; JOINTS]) -> Isometry3<f64> {
    *parameters.cameras.left_from_right(&linkage(parameters), angles).isometry()
}

impl Model {
    fn pose(&self, view: usize) -> usize {
        self.pose_of_view.get(view).copied().unwrap_or_default()
    }

    /// The unknowns as the drawing has them.
    pub fn nominal(&self) -> State {
        State { parameters: self.drawn, angles: self.start.clone() }
    }

    fn add_readings(&self, state: &State, pose: usize, sigma: f64, equations: &mut Equations<POSE>) {
        let (Some(readings), Some(sigmas)) = (self.readings.get(pose), self.reading_sigma.get(pose)) else { return };
        for (joint, error) in state.reading_errors(pose, readings).into_iter().enumerate() {
            let weight = sigma / sigmas[joint];
            let angle = first_joint(pose) + TrunkJoint::DRIVEN[joint].index();
            let mut shared = vec![[0.0]; angle + 1];
            shared[joint] = [weight];
            shared[angle] = [weight];
            equations.add_plain(&[error * weight], &shared, &[[0.0]; POSE]);
        }
    }

    fn add_closure(&self, state: &State, pose: usize, sigma: f64, equations: &mut Equations<POSE>) {
        let Some(angles) = state.angles.get(pose) else { return };
        let (parameters, weight, first) = (state.trunk(), sigma / CLOSED, first_joint(pose));
        let mut shared = vec![[0.0; 6]; first + JOINTS];
        // Lengths of the links: the mounts are no part of the loop.
        for (index, column) in shared.iter_mut().enumerate().take(8).skip(TRUNK_AXES) {
            let by = slope(&state.parameters, index, step_of(index), |above, below| {
                let [above, below] =
                    [above, below].map(|numbers| closure(&TrunkParameters::from_array(numbers), angles));
                above - below
            });
            *column = (by * weight).into();
        }
        for (joint, column) in shared[first..].iter_mut().enumerate() {
            let by = slope(angles, joint, STEPS[0], |above, below| {
                closure(&parameters, above) - closure(&parameters, below)
            });
            *column = (by * weight).into();
        }
        let residual = closure(&parameters, angles) * weight;
        equations.add_plain(&residual.into(), &shared, &[[0.0; 6]; POSE]);
        for joint in [TrunkJoint::D, TrunkJoint::E, TrunkJoint::F].map(TrunkJoint::index) {
            let mut shared = vec![[0.0]; first + joint + 1];
            shared[first + joint] = [sigma / PASSIVE];
            let away = self.start.get(pose).map_or(0.0, |start| angles[joint] - start[joint]);
            equations.add_plain(&[away * sigma / PASSIVE], &shared, &[[0.0]; POSE]);
        }
    }
}

impl Kinematics for Model {
    type State = State;

    fn dimension(&self) -> usize {
        first_joint(self.readings.len())
    }

    fn plus(&self, state: &State, step: &[f64]) -> State {
        let mut next = state.clone();
        let numbers = next.parameters.iter_mut().chain(next.angles.iter_mut().flatten());
        numbers.zip(step).for_each(|(number, by)| *number += by);
        next
    }

    fn left_from_right(&self, state: &State, view: usize) -> Isometry3<f64> {
        state.left_from_right(self.pose(view))
    }

    fn derivative(&self, state: &State, view: usize) -> Matrix6xX<f64> {
        let pose = self.pose(view);
        let mut columns = Matrix6xX::zeros(self.dimension());
        let Some(angles) = state.angles.get(pose) else { return columns };
        // Zeros act through the readings alone, and the sides through the closure: the right mount counts from its own corner.
        for index in 6..TRUNK_PARAMETERS {
            let by = slope(&state.parameters, index, step_of(index), |above, below| {
                let [above, below] =
                    [above, below].map(|numbers| relative(&TrunkParameters::from_array(numbers), angles));
                difference(&above, &below)
            });
            columns.set_column(index, &by);
        }
        let parameters = state.trunk();
        for joint in [TrunkJoint::A, TrunkJoint::F, TrunkJoint::FrontFold].map(TrunkJoint::index) {
            let by = slope(angles, joint, STEPS[0], |above, below| {
                difference(&relative(&parameters, above), &relative(&parameters, below))
            });
            columns.set_column(first_joint(pose) + joint, &by);
        }
        columns
    }

    fn add_prior(&self, state: &State, sigma: f64, equations: &mut Equations<POSE>) {
        for (index, (_, kind)) in TRUNK_PARAMETER_NAMES.iter().enumerate() {
            let weight = sigma / self.tolerance.of(*kind);
            let mut shared = vec![[0.0]; index + 1];
            shared[index] = [weight];
            equations.add_plain(&[(state.parameters[index] - self.drawn[index]) * weight], &shared, &[[0.0]; POSE]);
        }
        for pose in 0..self.readings.len() {
            self.add_readings(state, pose, sigma, equations);
            self.add_closure(state, pose, sigma, equations);
        }
    }
}
