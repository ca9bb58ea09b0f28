//! What is at the ends of an axis: kinds of switches, and stops that give way.

use vergence_control::HomeEnd;

/// Switches of an axis.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct SwitchMechanics {
    /// The end at which the home switch is.
    pub home_end: HomeEnd,
    /// Whether the home switch is normally closed: it opens at home.
    pub home_normally_closed: bool,
    /// Whether the hard limit switches are normally open: they close beyond the range.
    pub limits_normally_open: bool,
}

/// How an end stop gives way, and how the motor loses its steps against it. All zero: a stop that gives nothing, and a
/// rotor that stays where it is held.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct StopMechanics {
    /// Way that the stop yields under the largest force of the motor, in micro-units.
    pub give: f64,
    /// Way by which the rotor falls back when its force is exceeded, in micro-units: four full steps of a two-phase motor.
    pub fall_back: f64,
}
