//! The live loop: cameras that deliver when they like, a board that tells where the axes were, and a cloud of the newest pair
//! whenever the matcher is free.
//!
//! What the cameras deliver arrives as [`Heard`]; [`Exposures`] finds which of their frames belong together and when they
//! were exposed; [`measure()`] turns that into a [`Measured`]; [`LiveLoop`] keeps them going. Nothing queues: what the matcher
//! has no time for is counted and dropped, and no cloud holds anything of another.

mod attached;
mod blindness;
mod exposures;
mod eye;
mod live_loop;
mod measure;
mod publish;
mod simulated;

pub use attached::attach;
pub use exposures::{Exposed, Exposures, Shot, TimeBase, UNHEARD};
pub use eye::{Heard, LiveFrame, News, Picture};
pub use live_loop::{Ended, Limits, LiveLoop, Told, Totals};
pub use measure::{Measured, Motion, Seen, measure, pair_exposure};
pub use publish::Publisher;
pub use simulated::{SimulatedEye, Unplugged};
