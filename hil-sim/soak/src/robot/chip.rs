//! A robot's board with the simulated chip: the unmodified firmware on the bus of the simulated servos.

use vergence_image::layout::SETTINGS;
use vergence_mcu::BenchWiring;
use vergence_plant::Plant;
use vergence_plant::servo::{AnyMechanism, Nanoseconds, ServoBus};
use vergence_protocol::Microseconds;
use vergence_rig::Rig;
use vergence_sim::{SimError, robot_settings, trunk_servos};

use super::board::RobotBoard;
use super::scenario::RobotScenario;
use crate::simulation::Board;
use crate::{ChipBoard, ChipFlash};

impl ChipFlash {
    /// A board with this flash before the servos and the trunk of `rig`, set to drive a robot, that has just started.
    ///
    /// # Errors
    /// [`SimError`] of a rig without trunk, or whose joints cannot be driven.
    pub fn robot(&self, rig: &Rig, scenario: &RobotScenario) -> Result<ChipBoard, SimError> {
        let servos = trunk_servos(rig, scenario.mechanics, scenario.seed)?;
        let settings = robot_settings(rig)?;
        let plant = Plant::of_joints(servos);
        Ok(self.board_with(BenchWiring::nucleo_g474_robot(), plant, Some((SETTINGS.start as usize, &settings))))
    }
}

impl RobotBoard for ChipBoard {
    fn advance(&mut self, to: Microseconds) {
        Board::advance(self, to);
    }

    fn receive(&mut self, bytes: &[u8]) {
        Board::receive(self, bytes);
    }

    fn transmit(&mut self) -> Vec<u8> {
        Board::transmit(self)
    }

    fn restart(&mut self, boot: u32) {
        Board::restart(self, boot, Microseconds(0));
    }

    fn servos(&self) -> &ServoBus<AnyMechanism> {
        self.plant().joints().servos()
    }

    fn with_servos(&mut self, act: &mut dyn FnMut(&mut ServoBus<AnyMechanism>, Nanoseconds)) {
        let now = Nanoseconds::microseconds(self.now_us());
        self.with_plant(&mut |plant| act(plant.joints_mut().servos_mut(), now));
    }

    fn press_emergency_stop(&mut self, pressed: bool) {
        self.with_plant(&mut |plant| plant.press_emergency_stop(pressed));
    }

    fn halted(&self) -> Option<String> {
        Board::halted(self)
    }
}
