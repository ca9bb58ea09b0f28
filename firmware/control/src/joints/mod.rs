//! The bus of a robot's joints: servos of the X series on one half-duplex wire (`no_std`, no I/O).
//!
//! [`JointBus`] is the master, a state machine over bytes and time. [`JointBus::hear`] takes what the wire brings,
//! [`JointBus::poll`] gives what is to be sent. It sets each servo up, then writes all goals and reads all positions in one
//! exchange after the other, and keeps torque as it is wanted.
//!
//! A read that fails is repeated in a way that tells more: the combined answer of all (*fast sync read*), then one answer of
//! each, then each joint alone, twice. Only a joint that fails alone has a fault, so that a disturbed answer costs a few
//! milliseconds. The others go on.
//!
//! [`JointLine`] is the bus as the node's tick sees it: orders in, states out.

mod bus;
mod exchange;
mod fault;
mod joint;
mod line;
pub mod origaker;
mod set_up;
mod settings;

pub use bus::{JointBus, Transmission};
pub use fault::{BusCounters, JointFault};
pub use joint::{Joint, JointHealth, JointReading};
pub use line::{JointLine, JointOrders, JointState, JointStates};
pub use settings::{BusSettings, JointSettings};
