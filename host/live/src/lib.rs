//! The live loop: cameras that deliver when they like, a board that tells where the axes were, and a cloud of the newest pair
//! whenever the matcher is free.
//!
//! The cameras send [`vergence_camera::CameraEvent`]s; [`vergence_pipeline::Exposures`] finds which of their images belong
//! together and when they were exposed; [`measure()`] turns that into a [`Measurement`]; [`LiveLoop`] keeps them going.
//! Nothing queues: what the matcher has no time for is counted and dropped. No cloud holds a point of another; only their pose is told
//! by all pairs since the axes last moved, where the joints alone do not tell it.

mod blindness;
mod cameras;
mod error;
mod ladder;
mod live_loop;
mod measure;
mod orders;
mod pace;
mod posed;
mod totals;
mod tour;

use std::time::Duration;

pub use cameras::{attach_both, drive, play_both, simulate_both, sized, unplugged};
pub use error::LiveError;
pub use ladder::{Notice, Rung, Step};
pub use live_loop::{Ended, Limits, LiveLoop, LiveResult, MatchingTime};
pub use measure::{Measurement, PosedExposure, measure};
pub use orders::{HOME, homing_orders};
pub use pace::{Limit, Pace};
pub use posed::{AT_REST, LONGEST_UNSEEN, Posed, READINGS, pose};
pub use totals::Totals;
pub use tour::Tour;

/// Returns the time since some fixed instant, always the real one: by it the loop tells how long matching takes.
pub type Clock = fn() -> Duration;
