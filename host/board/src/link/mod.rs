//! The link to a controller board: how a port is opened, and the two clients that speak over it.

mod attention;
mod client;
mod clock;
mod error;
mod follow;
mod knowledge;
mod lost_encoders;
mod management;
mod open;
mod port_lock;
mod ports;
mod pulses;
mod repeated_stop;
mod session_id;
mod stop_beside;
mod task;

pub use client::{Client, Continuity};
pub use clock::HostClock;
pub use error::{LinkError, OpenError};
pub use follow::{Followed, Follower};
pub use knowledge::{BoardKnowledge, BoardNews, LastReading};
pub use lost_encoders::{LostAxis, Told};
pub use management::ManagementLink;
pub use open::{OpenWire, Patience, Port, Wire, open};
pub use port_lock::{PortLock, ReaderMark, is_held, is_wanted};
pub use ports::{describe_port, is_candidate, is_st_link, serial_ports};
pub use pulses::PulseChain;
pub use repeated_stop::RepeatedStop;
pub use session_id::fresh_session;
pub use stop_beside::{send_stop, stop_beside};
