//! Options of the verbs that reach machines with other rigs.

use std::path::PathBuf;

use vergence_peers::{Network, PeersError, Publication, Published, Secret};

use crate::failure::Failure;

/// Whether other machines hear of the rig.
#[derive(Debug, clap::Args)]
pub struct PublishOptions {
    /// Publishes clouds, poses and health under this name for other machines.
    #[arg(long, value_name = "NAME", help_heading = "Other machines")]
    pub publish: Option<String>,
    #[command(flatten)]
    pub peers: PeerOptions,
}

/// The ways to other machines.
#[derive(Debug, clap::Args)]
#[command(next_help_heading = "Other machines")]
pub struct PeerOptions {
    /// Connects to another machine, as soon and as often as it is there; may be given again.
    #[arg(long = "peer", value_name = "tcp/HOST:PORT")]
    connect: Vec<String>,
    /// Lets other machines connect here, such as at tcp/127.0.0.1:7447.
    #[arg(long = "peer-listen", value_name = "tcp/HOST:PORT")]
    listen: Vec<String>,
    /// Lets other computers connect too: --peer-listen tcp/0.0.0.0:7447 --peer-network.
    #[arg(long = "peer-network")]
    open: bool,
    /// The file with the secret of those who may send a rig to a mode.
    #[arg(long = "peer-secret", value_name = "FILE")]
    secret: Option<PathBuf>,
}

impl PublishOptions {
    /// Publishes a rig that takes no orders, where it shall be.
    pub fn start(&self, rig: Published) -> Result<Option<Publication>, Failure> {
        let Some(name) = &self.publish else { return Ok(None) };
        match self.peers.read()? {
            (_, Some(_)) => {
                Err(Failure::usage("--peer-secret lets others drive, which 'vergence panel' can, not 'run'"))
            }
            (network, None) => Ok(Some(Publication::start(name, &network, rig, None)?)),
        }
    }
}

impl PeerOptions {
    /// The ways, and the secret.
    pub fn read(&self) -> Result<(Network, Option<Secret>), PeersError> {
        let secret = self.secret.as_deref().map(Secret::read).transpose()?;
        Ok((Network::new(&self.connect, &self.listen, self.open)?, secret))
    }
}
