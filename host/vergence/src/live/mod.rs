//! The live loop: cameras that deliver when they like, a board that tells where the axes were, and a cloud of the newest pair
//! whenever the matcher is free.
//!
//! The cameras send [`vergence_camera::CameraEvent`]s; [`vergence_pipeline::Exposures`] finds which of their images belong
//! together and when they were exposed; [`measure()`] turns that into a [`Measurement`]; [`LiveLoop`] keeps them going.
//! Nothing queues: what the matcher has no time for is counted and dropped, and no cloud holds anything of another.

mod blindness;
mod live_loop;
mod measure;
mod publish;
mod simulated;

pub use live_loop::{Ended, Limits, LiveLoop, LiveResult, MatchingTime, Totals};
pub use measure::{Measurement, PosedExposure, measure};
pub use publish::Publisher;
pub use simulated::drive;
