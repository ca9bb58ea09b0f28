//! Why rigs on other machines cannot be reached, or refuse.

use std::path::PathBuf;

/// Why rigs on other machines cannot be reached, or refuse. The text is a sentence.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum PeersError {
    /// The feature `zenoh` is off.
    #[error(
        "this vergence was built without zenoh: build it with 'cargo install --path host/vergence --features zenoh'"
    )]
    BuiltWithout,
    /// A name that keys and ROS 2 cannot hold.
    #[error("'{0}' is no name for a rig: letters, digits and '_', the first a letter, 64 at most")]
    Name(String),
    /// An address that is none.
    #[error("'{0}' is no address of a peer: write it as tcp/HOST:PORT, such as tcp/127.0.0.1:7447")]
    Endpoint(String),
    /// An address that lets other computers in.
    #[error("{0} lets other computers in: add --peer-network; clouds and poses are then open to all who can connect")]
    OtherComputers(String),
    /// Neither an address to connect to nor one to listen on.
    #[error("no way to other rigs: name one with --peer tcp/HOST:PORT or --peer-listen tcp/127.0.0.1:7447")]
    Nowhere,
    /// zenoh does not start.
    #[error("zenoh does not start: {0}")]
    Open(String),
    /// A secret that cannot be used.
    #[error("{}: {why}", file.display())]
    Secret {
        /// The file that holds it.
        file: PathBuf,
        /// What is wrong.
        why: String,
    },
    /// Nobody answers under this name.
    #[error(
        "no rig '{0}' answers: is it published by 'vergence panel --publish {0} --peer-secret FILE', and is the way to it open?"
    )]
    Silent(String),
    /// The rig did not take the order.
    #[error("rig '{rig}' refuses: {why}")]
    Refused {
        /// Its name.
        rig: String,
        /// What it says.
        why: String,
    },
    /// The rig took the order and did not reach the mode.
    #[error("rig '{rig}' did not reach mode '{mode}': {why}")]
    NotReached {
        /// Its name.
        rig: String,
        /// The mode.
        mode: String,
        /// What it says.
        why: String,
    },
    /// What was received is no answer of a rig.
    #[error("what answers as rig '{0}' speaks another version, or is none")]
    Foreign(String),
}
