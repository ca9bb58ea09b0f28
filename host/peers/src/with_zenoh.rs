//! The transport: zenoh over TCP, without discovery.
//!
//! zenoh waits on a runtime of its own, which must not happen on a thread of the rig's runtime: calls made there run on a thread of their own.

use std::time::Duration;

use tokio::runtime::Handle;
use zenoh::Wait;
use zenoh::liveliness::LivelinessToken;
use zenoh::pubsub::Subscriber;
use zenoh::qos::CongestionControl;
use zenoh::query::Queryable;

use crate::error::PeersError;
use crate::network::Network;

/// Connections to other rigs; dropping it closes them.
pub struct Session(Option<zenoh::Session>);

/// Something that others see until it is dropped.
pub struct Declared {
    _tokens: Vec<LivelinessToken>,
    _subscriber: Option<Subscriber<()>>,
    _queryable: Option<Queryable<()>>,
}

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
    /// Opens the ways that `network` names. Nobody has to be there yet.
    ///
    /// # Errors
    /// [`PeersError::Open`]
    pub fn open(network: &Network) -> Result<Self, PeersError> {
        let settings = network.settings();
        apart(|| {
            let config = zenoh::Config::from_json5(&settings).map_err(failed)?;
            zenoh::open(config).wait().map(|session| Self(Some(session))).map_err(failed)
        })
    }

    fn inner(&self) -> Result<&zenoh::Session, PeersError> {
        self.0.as_ref().ok_or_else(|| PeersError::Open("it is closed".to_owned()))
    }

    /// The number of this session in the network.
    ///
    /// # Errors
    /// [`PeersError::Open`]
    pub fn id(&self) -> Result<String, PeersError> {
        Ok(self.inner()?.zid().to_string())
    }

    /// Sends a message to whoever wants it. On a link that is too slow it is left out.
    ///
    /// # Errors
    /// [`PeersError::Open`]
    pub fn publish(&self, key: &str, payload: Vec<u8>, attachment: Vec<u8>) -> Result<(), PeersError> {
        let session = self.inner()?;
        let put =
            || session.put(key, payload).attachment(attachment).congestion_control(CongestionControl::Drop).wait();
        apart(put).map_err(failed)
    }

    /// Shows liveliness tokens to all.
    ///
    /// # Errors
    /// [`PeersError::Open`]
    pub fn show(&self, keys: &[String]) -> Result<Declared, PeersError> {
        let session = self.inner()?;
        let tokens = apart(|| keys.iter().map(|key| session.liveliness().declare_token(key).wait()).collect());
        let tokens: Result<_, zenoh::Error> = tokens;
        Ok(Declared { _tokens: tokens.map_err(failed)?, _subscriber: None, _queryable: None })
    }

    /// Hears messages under `key` on a thread of zenoh: `hear` must be quick.
    ///
    /// # Errors
    /// [`PeersError::Open`]
    pub fn hear(&self, key: &str, hear: impl Fn(Arrived) + Send + Sync + 'static) -> Result<Declared, PeersError> {
        let session = self.inner()?;
        let on_sample = move |sample: zenoh::sample::Sample| {
            hear(Arrived {
                key: sample.key_expr().as_str().to_owned(),
                payload: sample.payload().to_bytes().into_owned(),
                attachment: sample.attachment().map(|bytes| bytes.to_bytes().into_owned()),
            });
        };
        let subscriber = apart(|| session.declare_subscriber(key).callback(on_sample).wait());
        Ok(Declared { _tokens: Vec::new(), _subscriber: Some(subscriber.map_err(failed)?), _queryable: None })
    }

    /// Answers questions at `key`, one after the other.
    ///
    /// # Errors
    /// [`PeersError::Open`]
    pub fn answer(
        &self,
        key: &str,
        answer: impl Fn(&[u8]) -> Vec<u8> + Send + Sync + 'static,
    ) -> Result<Declared, PeersError> {
        let session = self.inner()?;
        let on_query = move |query: zenoh::query::Query| {
            let question = query.payload().map(|bytes| bytes.to_bytes().into_owned()).unwrap_or_default();
            // Whoever asked and is gone needs no answer.
            let _ = query.reply(query.key_expr().clone(), answer(&question)).wait();
        };
        let queryable = apart(|| session.declare_queryable(key).callback(on_query).wait());
        Ok(Declared { _tokens: Vec::new(), _subscriber: None, _queryable: Some(queryable.map_err(failed)?) })
    }

    /// The first answer to a question at `key`; `None` where none comes in this time.
    ///
    /// # Errors
    /// [`PeersError::Open`]
    pub fn ask(&self, key: &str, question: &[u8], wait: Duration) -> Result<Option<Vec<u8>>, PeersError> {
        let session = self.inner()?;
        apart(|| {
            let replies = session.get(key).payload(question).timeout(wait).wait().map_err(failed)?;
            let reply = replies.recv().ok().and_then(|reply| reply.into_result().ok());
            Ok(reply.map(|sample| sample.payload().to_bytes().into_owned()))
        })
    }
}

impl Drop for Session {
    fn drop(&mut self) {
        let session = self.0.take();
        apart(|| drop(session));
    }
}

impl Drop for Declared {
    fn drop(&mut self) {
        let Self { _tokens: tokens, _subscriber: subscriber, _queryable: queryable } = self;
        let all = (std::mem::take(tokens), subscriber.take(), queryable.take());
        apart(|| drop(all));
    }
}

/// What `work` returns, which waits: on a thread of its own where this one belongs to a runtime.
fn apart<T: Send>(work: impl FnOnce() -> T + Send) -> T {
    if Handle::try_current().is_err() {
        return work();
    }
    std::thread::scope(|scope| match scope.spawn(work).join() {
        Ok(done) => done,
        Err(panic) => std::panic::resume_unwind(panic),
    })
}

fn failed(error: impl std::fmt::Display) -> PeersError {
    PeersError::Open(error.to_string())
}
