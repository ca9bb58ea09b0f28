//! The simulated mechanics of the rig, and the native board: the controller core run in virtual time against them.
//!
//! Simulated here: stepper motors, the compliance and backlash of screw and rack, load-side encoders, home and limit
//! switches, mechanical end stops, and the failures of each. The same seed and inputs give the same results.

mod as5048a;
mod axis;
mod bench;
mod board;
mod drivers;
mod encoder;
mod ends;
mod flash;
mod joints;
mod plant;
mod services;
pub mod servo;
mod stall_guard;
mod switch;
mod tmc2209;

pub use as5048a::{As5048aChip, MagnetFault};
pub use axis::{AxisMechanics, AxisPlant, PitchError, StepMade};
pub use bench::{Stage, bench_mechanics, bench_settings};
pub use board::NativeBoard;
pub use drivers::Drivers;
pub use encoder::EncoderFault;
pub use ends::{StopMechanics, SwitchMechanics};
pub use flash::{Cut, RamFlash};
pub use joints::Joints;
pub use plant::Plant;
pub use services::{Firmware, NativeServices, Verifier};
pub use switch::SwitchNoise;
pub use tmc2209::{DriverFaults, DriverReply, Tmc2209};
pub use vergence_protocol::management::NATIVE_HARDWARE;
