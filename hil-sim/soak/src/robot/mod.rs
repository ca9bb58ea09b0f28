//! Fault injection for a robot: a scripted host that goes through the robot's modes by planned paths, the real controller and bus
//! master, simulated servos and the simulated trunk, which knows more than anyone; one harm in each scenario; and a checker.
//!
//! [`RobotScenario::of`] draws a scenario from its seed, [`run_robot`] runs it. The checker asks the mechanics, not the board:
//!
//! - Links never touch, and the links of the loop stay together.
//! - No servo has torque before a session has armed the board, nor later than a stated time after it was disarmed or the emergency
//!   stop was pressed.
//! - After a fault of one joint the others keep their torque and their places.
//! - Reported positions are those that the outputs had at the stated time; a mode is reported only where they are in it.
//! - A harm is noticed, and named as what it is. What is no harm is no fault.
//! - After the harm is over the robot can be cleared, armed and brought back to a mode.

mod board;
mod checker;
#[cfg(feature = "chip")]
mod chip;
mod harm;
mod host;
mod play;
mod scenario;
mod tally;

pub use board::{RobotBoard, native_robot};
pub use checker::{RobotPromise, RobotViolation};
pub use harm::HarmKind;
pub use play::{RobotOutcome, run_robot};
pub use scenario::RobotScenario;
pub use tally::{RobotTally, soak_robot};
