//! What a scenario needs from a robot's board.

use vergence_plant::NativeBoard;
use vergence_plant::servo::{AnyMechanism, Nanoseconds, ServoBus};
use vergence_protocol::{Microseconds, ResetCause};
use vergence_rig::Rig;
use vergence_sim::{SimError, joint_settings, trunk_servos};

use super::scenario::RobotScenario;

/// Number of a board's first start.
const FIRST_BOOT: u32 = 1;

/// A robot's board with its servos.
pub trait RobotBoard {
    /// Lets time pass until `to` on the board's clock.
    fn advance(&mut self, to: Microseconds);
    /// Takes bytes that arrive now.
    fn receive(&mut self, bytes: &[u8]);
    /// Takes all frames that leave now, one after the other.
    fn transmit(&mut self) -> Vec<u8>;
    /// Takes the power from the board and gives it back: its clock begins anew. The servos go on.
    fn restart(&mut self, boot: u32);
    /// The servos with the trunk.
    fn servos(&self) -> &ServoBus<AnyMechanism>;
    /// Changes the servos or the trunk; with their time.
    fn with_servos(&mut self, act: &mut dyn FnMut(&mut ServoBus<AnyMechanism>, Nanoseconds));
    /// Presses or releases the emergency stop.
    fn press_emergency_stop(&mut self, pressed: bool);
    /// The reason why the board works no more; `None` while it works.
    fn halted(&self) -> Option<String> {
        None
    }
}

impl RobotBoard for NativeBoard {
    fn advance(&mut self, to: Microseconds) {
        self.advance(to);
    }

    fn receive(&mut self, bytes: &[u8]) {
        self.receive(bytes);
    }

    fn transmit(&mut self) -> Vec<u8> {
        self.transmit()
    }

    fn restart(&mut self, boot: u32) {
        // The settings were accepted at the first start.
        let _ = self.restart(ResetCause::PowerOn, boot);
    }

    fn servos(&self) -> &ServoBus<AnyMechanism> {
        self.plant().joints().servos()
    }

    fn with_servos(&mut self, act: &mut dyn FnMut(&mut ServoBus<AnyMechanism>, Nanoseconds)) {
        let joints = self.plant_mut().joints_mut();
        let now = joints.now();
        act(joints.servos_mut(), now);
    }

    fn press_emergency_stop(&mut self, pressed: bool) {
        self.plant_mut().press_emergency_stop(pressed);
    }
}

/// The real controller and bus master before the servos and the trunk of `rig`, just switched on.
///
/// # Errors
/// [`SimError`] of a rig without trunk, or whose joints cannot be driven.
pub fn native_robot(rig: &Rig, scenario: &RobotScenario) -> Result<NativeBoard, SimError> {
    let servos = trunk_servos(rig, scenario.mechanics, scenario.seed)?;
    let refused = |error: vergence_control::SettingsError| SimError::Settings(error.to_string());
    NativeBoard::of_joints(&joint_settings(rig)?, servos, FIRST_BOOT).map_err(refused)
}
