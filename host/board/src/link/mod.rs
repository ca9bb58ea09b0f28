//! The link to a controller board: how a port is opened, and the two clients that speak over it.

mod client;
mod clock;
mod error;
mod follow;
mod knowledge;
mod management;
mod open;
mod port_lock;
mod repeated_stop;
mod session_id;
mod task;

pub use client::Client;
pub use clock::HostClock;
pub use error::{LinkError, OpenError};
pub use follow::{Followed, Follower};
pub use knowledge::BoardKnowledge;
pub use management::ManagementLink;
pub use open::{OpenWire, Port, Wire, open};
pub use port_lock::{PortLock, ReaderMark, is_held, is_wanted};
pub use repeated_stop::RepeatedStop;
pub use session_id::fresh_session;
