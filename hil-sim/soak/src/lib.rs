//! Fault injection over the whole stack in virtual time, seeded: a scripted host, a line in both directions, the real
//! controller and simulated mechanics; one fault, or several, in each scenario; and a checker.
//!
//! [`Scenario::of`] draws a scenario from its seed, [`run`] runs it. The checker shares no code with the
//! controller. It knows the true mechanics and the bytes on the line, and checks these promises of the board:
//!
//! - The load stays inside the hard limit switches, except for the distance that no controller can avoid: that of one
//!   control tick at full speed, and the lag of the load behind its motor.
//! - Drivers go on only where a session with a live lease asks for it. Motors step only while they are on, and no
//!   longer after the end of the lease than braking takes in the worst case, v/a + 2a/j: an acceleration that is still growing
//!   must be reduced first. A move that is asked for before arming, before homing or beyond the range is refused.
//! - A stop that the host requests ends all steps in the same time, and one without torque switches the drivers off at
//!   once. The drivers go off while the emergency stop is pressed.
//! - An axis whose reference is right moves no further outside its range than the largest following error.
//! - An axis without reference moves no faster than homing does, and no axis faster than its setting, which a restart
//!   keeps once it is saved.
//! - Reported positions are true, to the error of the reference and the time of the report. Every time that a board
//!   states fits one offset between its clock and the true time. The cameras saw each pulse that it reports, at the
//!   positions that it reports.
//! - A mode is reported only while the true load is at its target: within the tolerance of the axis, the error of its
//!   reference, and one encoder count. A failed encoder cannot be noticed at once: from its failure on the
//!   largest following error is added.
//! - An encoder that stands still, runs backwards or is dead stops its axis: with drivers on, the load goes no further
//!   than the largest following error and the repeatability of homing.
//! - The first fault is repeated in every pose until it is cleared by its number.
//! - The state of the drivers in a pose is true; after a restart nothing is armed, referenced or latched.
//! - Every motion and every request ends; in the end everything is at rest.

mod board_clock;
mod checker;
#[cfg(feature = "chip")]
mod chip_board;
#[cfg(feature = "chip")]
pub mod differential;
mod faults;
mod host;
mod injector;
mod journal;
mod line;
#[cfg(feature = "chip")]
pub mod power_cuts;
mod promise;
mod pulses;
#[cfg(feature = "robot")]
pub mod robot;
mod scenario;
mod settings_in_force;
mod simulation;
mod stages;
mod tally;
mod watched_axis;

#[cfg(feature = "chip")]
pub use chip_board::{ChipBoard, ChipFlash};
pub use faults::{Fault, FaultKind, Onset};
pub use journal::Journal;
pub use promise::{Promise, Violation};
pub use scenario::{Destination, Errand, Scenario, Step};
pub use simulation::{Board, Ending, Outcome, native_board, run};
pub use stages::stages;
pub use tally::{KindTally, Tally, soak};
