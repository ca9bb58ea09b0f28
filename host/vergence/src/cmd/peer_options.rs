//! Options of the verbs that reach machines with other rigs.

use std::path::PathBuf;

use vergence_peers::{Network, PeersError, Publication, Published, Secret, Ways};

use crate::failure::Failure;

/// Whether other machines hear of the rig.
#[derive(Debug, clap::Args)]
pub struct PublishOptions {
    /// Publishes clouds, poses and health under this name for other machines.
    #[arg(long, value_name = "NAME", help_heading = "Other machines")]
    publish: Option<String>,
    #[command(flatten)]
    peers: PeerOptions,
}

/// The ways to other machines.
#[derive(Debug, Default, PartialEq, clap::Args)]
#[command(next_help_heading = "Other machines")]
pub struct PeerOptions {
    /// Connects to another machine, as soon and as often as it is there; may be given again.
    #[arg(long, value_name = "tcp/HOST:PORT")]
    peer: Vec<String>,
    /// Lets other machines connect here, such as at tcp/127.0.0.1:7447.
    #[arg(long, value_name = "tcp/HOST:PORT")]
    peer_listen: Vec<String>,
    /// Lets other computers connect too: --peer-listen tcp/0.0.0.0:7447 --peer-network.
    #[arg(long)]
    peer_network: bool,
    /// The file with the secret of those who may send a rig to a mode.
    #[arg(long, value_name = "FILE")]
    peer_secret: Option<PathBuf>,
}

impl PublishOptions {
    /// Name, ways and secret, where the rig shall be published.
    pub fn read(&self) -> Result<Option<(&str, Ways)>, Failure> {
        match &self.publish {
            Some(name) => Ok(Some((name, self.peers.read()?))),
            None if self.peers == PeerOptions::default() => Ok(None),
            None => Err(Failure::usage("--peer and its like need a name for the rig: add --publish NAME")),
        }
    }

    /// Publishes a rig that takes no orders, where it shall be.
    pub fn start(&self, rig: Published) -> Result<Option<Publication>, Failure> {
        match self.read()? {
            None => Ok(None),
            Some((name, (network, None))) => Ok(Some(Publication::start(name, &network, rig, None)?)),
            Some(_) => {
                Err(Failure::usage("--peer-secret is for others who drive, and 'run' drives alone: see 'panel'"))
            }
        }
    }
}

impl PeerOptions {
    /// The ways, and the secret.
    pub fn read(&self) -> Result<Ways, PeersError> {
        let secret = self.peer_secret.as_deref().map(Secret::read).transpose()?;
        Ok((Network::new(&self.peer, &self.peer_listen, self.peer_network)?, secret))
    }
}
