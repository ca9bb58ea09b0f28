//! Why the panel cannot be shown, or ended.

use std::net::SocketAddr;

use vergence_board::BoardError;
use vergence_live::LiveError;
use vergence_recording::RecordingError;

/// Why the panel cannot be shown, or ended. The text is a sentence.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum PanelError {
    /// The address cannot be listened on.
    #[error("the panel cannot listen on {address}: {why}; choose another with --listen, port 0 takes a free one")]
    Listen {
        /// The address.
        address: SocketAddr,
        /// What the operating system says.
        why: String,
    },
    /// The address lets other computers in, and nobody said so.
    #[error("{0} lets other computers in: add --network, which makes a token that they need")]
    OtherComputers(SocketAddr),
    /// An address that other computers reach.
    #[error("{0} is reached from other computers, and the page of the rigs is for this one: choose 127.0.0.1")]
    OnlyHere(SocketAddr),
    /// The server cannot begin.
    #[error("the server of the panel does not start: {0}")]
    Server(String),
    /// The board or its link failed.
    #[error(transparent)]
    Board(#[from] BoardError),
    /// The live loop failed.
    #[error(transparent)]
    Live(#[from] LiveError),
    /// The recording failed.
    #[error(transparent)]
    Recording(#[from] RecordingError),
}
