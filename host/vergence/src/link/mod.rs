//! The link to a controller board: how it is opened, and the client that speaks over it.

mod client;
mod clock;
mod error;
mod knowledge;
mod management;
mod open;
mod port_lock;

pub use client::Client;
pub use clock::HostClock;
pub use error::LinkError;
pub use knowledge::BoardKnowledge;
pub use management::ManagementLink;
pub use open::{OpenWire, Port, Wire, open};
