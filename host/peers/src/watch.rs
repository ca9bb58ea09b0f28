//! Watches rigs on other machines, and sends them to modes for a page that is allowed to.

use std::sync::Arc;

use serde_json::Value;
use vergence_panel::{Outgoing, RigsOnPage};
use vergence_recording::{DIAGNOSTICS, JOINTS, POINTS, TRANSFORMS};

use crate::authorisation::Secret;
use crate::error::PeersError;
use crate::keys::{DOMAIN, data_key, is_name};
use crate::network::Network;
use crate::operator::send_to_mode;
use crate::rigs::Rigs;
use crate::transport::{Declared, Session};

/// Rigs that are watched until the value is dropped.
pub struct Watching {
    /// What is known of them.
    pub rigs: Arc<Rigs>,
    secret: Option<Secret>,
    // In this order they are dropped: what is heard, and then the session.
    _heard: Vec<Declared>,
    session: Session,
}

/// Watches the rigs `names`, or all, on `network`; who has their `secret` may send them to modes.
///
/// # Errors
/// [`PeersError::Name`], [`PeersError::Open`], [`PeersError::BuiltWithout`]
pub fn watch(names: &[String], network: &Network, secret: Option<Secret>) -> Result<Watching, PeersError> {
    if let Some(wrong) = names.iter().find(|name| !is_name(name)) {
        return Err(PeersError::Name(wrong.clone()));
    }
    let (session, rigs) = (Session::open(network)?, Arc::new(Rigs::new(names)));
    let mut heard = Vec::new();
    for topic in [POINTS, JOINTS, TRANSFORMS, DIAGNOSTICS] {
        let rigs = Arc::clone(&rigs);
        heard.push(session.hear(&data_key("*", &topic), move |arrived| rigs.take(arrived))?);
    }
    Ok(Watching { rigs, secret, _heard: heard, session })
}

impl Watching {
    /// Sends a rig to a mode, and waits until it is there. Call on a thread that nothing else waits for.
    ///
    /// # Errors
    /// Those of [`send_to_mode`]; [`PeersError::Refused`] without a secret.
    pub fn mode(&self, rig: &str, mode: &str) -> Result<(), PeersError> {
        let why =
            || PeersError::Refused { rig: rig.to_owned(), why: "it needs its secret: --peer-secret FILE".to_owned() };
        send_to_mode(&self.session, rig, mode, self.secret.as_ref().ok_or_else(why)?)
    }
}

impl RigsOnPage for Watching {
    fn rigs(&self) -> Value {
        let mut rigs = self.rigs.json();
        rigs["may_order"] = self.secret.is_some().into();
        rigs["domain"] = DOMAIN.into();
        rigs
    }

    fn cloud(&self, rig: &str) -> Option<Outgoing> {
        self.rigs.cloud(rig)
    }

    fn order(&self, rig: &str, mode: &str) -> Result<(), String> {
        self.mode(rig, mode).map_err(|error| error.to_string())
    }
}
