//! The robot's folding trunk as simulated mechanics: five driven joints, three that follow, and what a controller does not know.
//!
//! Servos hold the driven joints through springs, the elasticity of links and brackets. The joints' true angles are those at
//! which the loop closes and the springs are strained least. Where the driven angles close the loop the springs are slack; where
//! they cannot, the strain pushes back on the servos. Each driven joint has play besides ([`Play`]).
//!
//! Simulated, not measured: stiffness, damping, friction, play and thickness of the links are assumed.

mod closing;
mod collision;
mod play;
mod servos;

use std::f64::consts::{PI, TAU};

use vergence_plant::servo::{Mechanism, ServoMoment};
use vergence_rig::linkage::{Loop, TrunkCameras, TrunkJoint, TrunkLinks, trunk};
use vergence_vision::{Base, Left, Right, Transform};

use closing::close;
pub use collision::Collision;
pub use play::Play;
pub use servos::{DrivenTrunk, FIRST_SERVO_ID, joint_settings, trunk_servos};

const JOINTS: usize = TrunkJoint::COUNT;
const DRIVEN: usize = TrunkJoint::DRIVEN.len();

/// Numbers of the trunk's mechanics, all assumed.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TrunkMechanics {
    /// Stiffness between a servo's output and its joint, in newton metres for each radian.
    pub stiffness: f64,
    /// Friction that grows with the velocity, in newton metres for each radian per second.
    pub damping: f64,
    /// Friction of each driven joint and of what follows it, in newton metres.
    pub friction: f64,
    /// Load on each driven joint, such as gravity, in newton metres towards larger joint angles.
    pub loads: [f64; DRIVEN],
    /// Radius of links and camera bodies, in millimetres.
    pub radius: f64,
}

impl Default for TrunkMechanics {
    fn default() -> Self {
        Self { stiffness: 60.0, damping: 0.1, friction: 0.05, loads: [0.0; DRIVEN], radius: 8.0 }
    }
}

/// The trunk with its servos' outputs at the driven joints A, B, C, rear fold and front fold, in this order. An output at `q` holds
/// its joint at `π - q`: an output shows the interior angle of its corner, and half a turn at a flat fold.
#[derive(Clone, Debug)]
pub struct Trunk {
    linkage: Loop<JOINTS>,
    cameras: TrunkCameras,
    mechanics: TrunkMechanics,
    play: [Play; DRIVEN],
    angles: [f64; JOINTS],
    /// Torque of each spring on its joint, in newton metres.
    strain: [f64; DRIVEN],
}

impl Trunk {
    /// The paper's trunk at rest, flat with all corners at 120 degrees (spider). `seed` decides the play of its joints.
    #[must_use]
    pub fn new(mechanics: TrunkMechanics, seed: u64) -> Self {
        Self::built((TrunkLinks::default(), TrunkCameras::default()), mechanics, Play::of_seed(seed))
    }

    /// A trunk that was built otherwise than the paper's: its links and mounts, its mechanics, the play of its joints. At rest, flat
    /// with all corners at 120 degrees.
    #[must_use]
    pub fn built(
        (links, cameras): (TrunkLinks, TrunkCameras),
        mechanics: TrunkMechanics,
        play: [Play; DRIVEN],
    ) -> Self {
        let corners = vergence_rig::linkage::Corners([120_f64.to_radians(); 6]);
        let (linkage, angles) = (trunk(&links), corners.trunk_angles());
        Self { linkage, cameras, mechanics, play, angles, strain: [0.0; DRIVEN] }
    }

    /// A trunk without play, for tests.
    #[must_use]
    pub fn tight(mechanics: TrunkMechanics) -> Self {
        Self::built((TrunkLinks::default(), TrunkCameras::default()), mechanics, [Play::NONE; DRIVEN])
    }

    /// Loads the driven joints from now on, in newton metres towards larger joint angles.
    pub fn set_loads(&mut self, loads: [f64; DRIVEN]) {
        self.mechanics.loads = loads;
    }

    /// The servos' outputs, in radians, that hold the trunk as it stands without play.
    #[must_use]
    pub fn outputs(&self) -> [f64; DRIVEN] {
        TrunkJoint::DRIVEN.map(|joint| PI - self.angles[joint.index()])
    }

    /// The true angles of all joints in radians, in the order of [`TrunkJoint`].
    #[must_use]
    pub fn angles(&self) -> &[f64; JOINTS] {
        &self.angles
    }

    /// The true interior angles of the corners A to F, in radians, from 0 to a whole turn.
    #[must_use]
    pub fn corners(&self) -> [f64; 6] {
        TrunkJoint::CORNERS.map(|joint| (PI - self.angles[joint.index()]).rem_euclid(TAU))
    }

    /// How far the loop is from closed: see [`Loop::closure_error`].
    #[must_use]
    pub fn closure_error(&self) -> f64 {
        self.linkage.closure_error(&self.angles)
    }

    /// The torque that each spring puts on its servo's output, in newton metres, towards larger outputs.
    #[must_use]
    pub fn strain(&self) -> [f64; DRIVEN] {
        self.strain.map(|torque| -torque)
    }

    /// True pose of the left camera. The base is the left half of the front end link: its frame before joint A, in the
    /// linkage's convention.
    #[must_use]
    pub fn left_from_base(&self) -> Transform<Left, Base> {
        Transform::from_isometry(self.cameras.front_from_left(&self.linkage, &self.angles).inverse())
    }

    /// True pose of the right camera, in the same base.
    #[must_use]
    pub fn right_from_base(&self) -> Transform<Right, Base> {
        let left_from_right = *self.left_from_right().isometry();
        Transform::from_isometry(left_from_right.inverse() * self.left_from_base().isometry())
    }

    /// True pose of the right camera in the left one's frame.
    #[must_use]
    pub fn left_from_right(&self) -> Transform<Left, Right> {
        self.cameras.left_from_right(&self.linkage, &self.angles)
    }

    /// Links that touch now.
    #[must_use]
    pub fn collisions(&self) -> Vec<Collision> {
        collision::find(&self.linkage, &self.angles, self.mechanics.radius)
    }
}

impl Mechanism for Trunk {
    /// Outputs beyond the fifth carry nothing; a missing one leaves its joint where it is.
    fn torques(&mut self, seconds: f64, outputs: &[ServoMoment], torques: &mut [f64]) {
        let mut held = TrunkJoint::DRIVEN.map(|joint| self.angles[joint.index()]);
        for (place, (held, output)) in held.iter_mut().zip(outputs).enumerate() {
            let load = self.strain[place] + self.mechanics.loads[place];
            *held = PI - output.angle + self.play[place].at(seconds, load);
        }
        self.angles = close(&self.linkage, &self.angles, &held);
        for (place, joint) in TrunkJoint::DRIVEN.into_iter().enumerate() {
            self.strain[place] = self.mechanics.stiffness * (self.angles[joint.index()] - held[place]);
        }
        for (place, (torque, output)) in torques.iter_mut().zip(outputs).take(DRIVEN).enumerate() {
            let TrunkMechanics { damping, friction, loads, .. } = self.mechanics;
            // Friction is smooth about rest: the motor's own friction holds it there.
            let drag = friction * (output.velocity / SMOOTH).tanh();
            *torque = -self.strain[place] - loads[place] - drag - damping * output.velocity;
        }
    }
}

/// Velocity below which friction of the joints fades, in radians per second.
const SMOOTH: f64 = 0.02;
