//! What befalls the mechanics, of both boards at the same instant.

use vergence_plant::{AxisPlant, EncoderFault, Plant};

/// A failure of the mechanics; it lasts until it is mended.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Mishap {
    /// The encoder of an axis stands.
    EncoderStuck(usize),
    /// The encoder of an axis counts backwards.
    EncoderReversed(usize),
    /// The rotor of an axis stands.
    Stalled(usize),
    /// The rotor of an axis misses so many steps.
    StepsLost(usize, u32),
    /// The coupling of an axis slips by a share of each step.
    Slips(usize, f64),
    /// The load of an axis is wedged.
    Blocked(usize),
    /// The emergency stop is pressed.
    EmergencyStop,
    /// The home switches are exchanged.
    SwitchesCrossed,
    /// The home switch of an axis reads closed or open, or follows its contact again.
    SwitchReads(usize, Option<bool>),
}

impl Mishap {
    /// Makes it happen.
    pub fn begin(self, plant: &mut Plant) {
        match self {
            Self::EncoderStuck(axis) => on(plant, axis, |axis| axis.fail_encoder(Some(EncoderFault::Stuck))),
            Self::EncoderReversed(axis) => on(plant, axis, |axis| axis.fail_encoder(Some(EncoderFault::Reversed))),
            Self::Stalled(axis) => on(plant, axis, |axis| axis.stall(true)),
            Self::StepsLost(axis, steps) => on(plant, axis, |axis| axis.lose_steps(steps)),
            Self::Slips(axis, share) => on(plant, axis, |axis| axis.slip(share)),
            Self::Blocked(axis) => plant.block(axis, true),
            Self::EmergencyStop => plant.press_emergency_stop(true),
            Self::SwitchesCrossed => plant.cross_home_switches(0, 1),
            Self::SwitchReads(axis, reading) => on(plant, axis, |axis| axis.fix_home_switch(reading)),
        }
    }

    /// Mends it.
    pub fn end(self, plant: &mut Plant) {
        match self {
            Self::EncoderStuck(axis) | Self::EncoderReversed(axis) => on(plant, axis, AxisPlant::mend_encoder),
            Self::Stalled(axis) => on(plant, axis, |axis| axis.stall(false)),
            Self::StepsLost(axis, _) => on(plant, axis, AxisPlant::keep_steps),
            Self::Slips(axis, _) => on(plant, axis, |axis| axis.slip(0.0)),
            Self::Blocked(axis) => plant.block(axis, false),
            Self::EmergencyStop => plant.press_emergency_stop(false),
            Self::SwitchesCrossed => plant.cross_home_switches(0, 1),
            Self::SwitchReads(axis, _) => on(plant, axis, |axis| axis.fix_home_switch(None)),
        }
    }
}

fn on(plant: &mut Plant, axis: usize, act: impl FnOnce(&mut AxisPlant)) {
    if let Some(axis) = plant.axis_mut(axis) {
        act(axis);
    }
}
