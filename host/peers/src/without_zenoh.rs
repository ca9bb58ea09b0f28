//! In place of the transport where the feature `zenoh` is off: nothing can be opened.

use std::time::Duration;

use crate::error::PeersError;
use crate::network::Network;

/// There is none.
pub enum Session {}

/// There is none.
pub enum Declared {}

/// A message that arrived.
pub struct Arrived {
    /// Its key.
    pub key: String,
    /// Its bytes.
    pub payload: Vec<u8>,
    /// What was sent beside it.
    pub attachment: Option<Vec<u8>>,
}

impl Session {
    /// Says that there is no transport.
    ///
    /// # Errors
    /// [`PeersError::BuiltWithout`]
    pub fn open(_: &Network) -> Result<Self, PeersError> {
        Err(PeersError::BuiltWithout)
    }

    /// As with zenoh.
    ///
    /// # Errors
    /// None.
    pub fn id(&self) -> Result<String, PeersError> {
        match *self {}
    }

    /// As with zenoh.
    ///
    /// # Errors
    /// None.
    pub fn publish(&self, _: &str, _: Vec<u8>, _: Vec<u8>) -> Result<(), PeersError> {
        match *self {}
    }

    /// As with zenoh.
    ///
    /// # Errors
    /// None.
    pub fn show(&self, _: &[String]) -> Result<Declared, PeersError> {
        match *self {}
    }

    /// As with zenoh.
    ///
    /// # Errors
    /// None.
    pub fn hear(&self, _: &str, _: impl Fn(Arrived) + Send + Sync + 'static) -> Result<Declared, PeersError> {
        match *self {}
    }

    /// As with zenoh.
    ///
    /// # Errors
    /// None.
    pub fn answer(
        &self,
        _: &str,
        _: impl Fn(&[u8]) -> Vec<u8> + Send + Sync + 'static,
    ) -> Result<Declared, PeersError> {
        match *self {}
    }

    /// As with zenoh.
    ///
    /// # Errors
    /// None.
    pub fn ask(&self, _: &str, _: &[u8], _: Duration) -> Result<Option<Vec<u8>>, PeersError> {
        match *self {}
    }
}
