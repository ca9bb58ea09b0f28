//! Servos at a USB adapter: what is there, and its number and speed. This is how a lab makes the bus of a robot ready, before the
//! board drives it.
//!
//! [`ServoPort`] sends a packet and takes the answers; [`scan`], [`set_id`], [`set_baud`] and [`examine`] are made of that. All of it
//! blocks: run it on a thread of its own.

mod error;
mod examine;
mod port;
mod report;
mod set_up;

pub use error::ServoError;
pub use examine::{Examination, Swing, examine, swing};
pub use port::{Heard, ServoPort};
pub use set_up::{FoundServo, Scanned, model_name, scan, scan_at, set_baud, set_id};
