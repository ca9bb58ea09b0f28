//! Why a link ends.

use std::time::Duration;

/// Why the link is of no use any more.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum LinkError {
    /// The other end closed it, or the cable was pulled.
    #[error(
        "the link closed ({0}): check the cable or the simulator, then try again; nothing moves until you ask again"
    )]
    Closed(String),
    /// Nothing was heard.
    #[error("no answer within {0:?}: is this the port of a vergence board, and is the board powered?")]
    Silent(Duration),
    /// Something was heard, but nothing that makes sense.
    #[error("{0} bytes arrived but no valid message: another device, or another baud rate, is on this port")]
    Noise(u32),
    /// The board restarted, or another host took the session.
    #[error("the board began anew or another host took it over: run 'vergence status'")]
    SessionLost,
    /// A request that cannot be sent now.
    #[error("the request cannot be sent: {0}")]
    Unsendable(String),
}
