//! The servos of a robot with the trunk that they hold, and their board's settings, all as the rig file says.

use vergence_control::AxisSettings;
use vergence_control::joints::origaker;
use vergence_dynamixel::Id;
use vergence_dynamixel::units::Baud;
use vergence_plant::servo::{AnyMechanism, Mechanism, Servo, ServoBus, ServoModel, ServoMoment};
use vergence_rig::Rig;

use super::{DRIVEN, Play, Trunk, TrunkMechanics};
use crate::SimError;

/// Number of the servo of the first axis; those of the others follow.
pub const FIRST_SERVO_ID: u8 = 13;

/// How a servo sits at its joint: the joint's angle is `zero` plus what the servo shows, in its direction.
#[derive(Clone, Copy, Debug)]
struct Seat {
    zero: f64,
    direction: f64,
}

/// The trunk as its servos move it, in the order of [`vergence_rig::linkage::TrunkJoint::DRIVEN`].
#[derive(Clone, Debug)]
pub struct DrivenTrunk {
    trunk: Trunk,
    seats: [Seat; DRIVEN],
}

impl DrivenTrunk {
    /// The trunk.
    #[must_use]
    pub const fn trunk(&self) -> &Trunk {
        &self.trunk
    }

    /// The trunk, to change it.
    pub const fn trunk_mut(&mut self) -> &mut Trunk {
        &mut self.trunk
    }
}

impl Mechanism for DrivenTrunk {
    fn torques(&mut self, seconds: f64, outputs: &[ServoMoment], torques: &mut [f64]) {
        let joint = |(seat, output): (&Seat, &ServoMoment)| ServoMoment {
            angle: seat.zero + seat.direction * output.angle,
            velocity: seat.direction * output.velocity,
        };
        let joints: Vec<ServoMoment> = self.seats.iter().zip(outputs).map(joint).collect();
        self.trunk.torques(seconds, &joints, torques);
        torques.iter_mut().zip(&self.seats).for_each(|(torque, seat)| *torque *= seat.direction);
    }
}

/// Settings of the board of a robot's joints.
///
/// # Errors
/// [`SimError::Axes`] where an axis reads no servo of the X series.
pub fn joint_settings(rig: &Rig) -> Result<Vec<AxisSettings>, SimError> {
    let joint = |(id, axis): (u8, &vergence_rig::RigAxis)| {
        let ends = axis.range.map(|end| axis.wire_position(end));
        let settings = origaker::joint(id.into(), [ends[0].min(ends[1]), ends[0].max(ends[1])]);
        if settings.counts_per_unit == axis.counts_per_unit {
            return Ok(settings);
        }
        let why = format!("the servo of axis '{}' has {} counts in a revolution", axis.name, settings.counts_per_unit);
        Err(SimError::Axes { rig: rig.name.clone(), why })
    };
    (FIRST_SERVO_ID..).zip(&rig.axes).map(joint).collect()
}

/// The servos of a robot at rest in spider, with a trunk of such mechanics. `seed` decides the play of its joints, which the rig file
/// does not know.
///
/// # Errors
/// [`SimError::NoTrunk`] of a rig without one.
pub fn trunk_servos(rig: &Rig, mechanics: TrunkMechanics, seed: u64) -> Result<ServoBus<AnyMechanism>, SimError> {
    let trunk = rig.trunk.as_deref().ok_or_else(|| SimError::NoTrunk(rig.name.clone()))?;
    let built = Trunk::built((trunk.links, trunk.cameras), mechanics, Play::of_seed(seed));
    let axes = trunk.axes.map(|index| rig.axes.get(index));
    let seats = axes.map(|axis| Seat {
        zero: axis.map_or(0.0, |axis| axis.zero),
        direction: axis.map_or(1.0, vergence_rig::RigAxis::direction),
    });
    let servos = trunk.axes.into_iter().zip(built.outputs()).zip(&seats).filter_map(|((axis, output), seat)| {
        let id = Id::servo(FIRST_SERVO_ID.checked_add(u8::try_from(axis).ok()?)?).ok()?;
        Some(Servo::new(ServoModel::XM430_W350, id, Baud::M1, seat.direction * (output - seat.zero)))
    });
    let servos = servos.collect();
    Ok(ServoBus::new(servos, AnyMechanism::new(DrivenTrunk { trunk: built, seats })))
}
