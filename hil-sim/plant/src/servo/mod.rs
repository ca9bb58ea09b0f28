//! Simulated bus servos of the X series, and the wire that they share.
//!
//! A [`Servo`] has registers, a motor with gears, and the loops that its own firmware closes. A [`ServoBus`] has several on one
//! half-duplex wire. Time and bytes go in; bytes with their times come out. What the servos move is a [`Mechanism`].
//!
//! Numbers are those of the XM430-W350 (ROBOTIS e-manual); those that the manual does not state are marked as assumed in
//! [`ServoModel`].

mod bus;
mod control;
mod device;
mod faults;
mod held;
mod limits;
mod line;
mod master;
mod model;
mod motor;
mod registers;
mod wire;

pub use bus::{Free, Mechanism, ServoBus, ServoMoment};
pub use device::{Answer, Heard, Servo};
pub use faults::ServoFaults;
pub use held::AnyMechanism;
pub use line::{Nanoseconds, WireByte};
pub use master::Master;
pub use model::ServoModel;
pub use motor::{Drive, Motor};
pub use registers::Registers;
pub use wire::Wire;
