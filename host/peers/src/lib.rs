//! Rigs on several machines: a rig publishes what it measures over zenoh, a machine watches many rigs, and who knows a rig's secret sends it to
//! a mode.
//!
//! Messages are those of a recording, under the keys that ROS 2 nodes on `rmw_zenoh` use ([`data_key`]). Publishing never delays the rig:
//! [`Publication`] keeps the newest of each kind for a thread of its own, and counts what that thread had no time for. An order goes the way
//! of a page of the panel ([`Desk`]): one drives, everybody's stop ends it, and so does silence. Nothing that keeps the rig safe is here.
//!
//! Without the feature `zenoh` everything is built but the transport, and opening that says so.

#[cfg(not(feature = "zenoh"))]
#[path = "without_zenoh.rs"]
mod transport;
#[cfg(feature = "zenoh")]
#[path = "with_zenoh.rs"]
mod transport;

mod authorisation;
mod decode;
mod desk;
mod error;
mod keys;
mod network;
mod operator;
mod publication;
mod rigs;
mod units;
mod watch;

pub use authorisation::{Secret, mode_tag};
pub use decode::{CloudFigures, DecodedHealth};
pub use desk::{Answer, Ask, Desk};
pub use error::PeersError;
pub use keys::{Attachment, DOMAIN, data_key, is_name, mode_key, token_key};
pub use network::Network;
pub use operator::send_to_mode;
pub use publication::{Publication, Published, Ways};
pub use rigs::Rigs;
pub use watch::{Watching, watch};
