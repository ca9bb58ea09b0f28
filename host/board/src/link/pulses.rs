//! Pulses of the camera trigger beyond the end of a link.

use tokio::sync::mpsc::{Receiver, Sender, channel};
use vergence_protocol::TriggerMark;

/// Pulses that may wait; whoever listens takes them at once.
const KEPT: usize = 2_048;

/// The pulses of one link after the other, as one stream that does not end with a link.
#[derive(Clone, Debug)]
pub struct PulseChain(Sender<TriggerMark>);

impl PulseChain {
    /// Begins with the pulses of the first link; `None` where no camera is fired, and then nothing ever comes. Call within a tokio runtime.
    #[must_use]
    pub fn begin(first: Option<Receiver<TriggerMark>>) -> (Self, Option<Receiver<TriggerMark>>) {
        let (sender, pulses) = channel(KEPT);
        let chain = Self(sender);
        let pulses = first.is_some().then_some(pulses);
        first.into_iter().for_each(|first| chain.add(first));
        (chain, pulses)
    }

    /// Goes on with the pulses of another link, until it ends. Call within a tokio runtime.
    pub fn add(&self, mut pulses: Receiver<TriggerMark>) {
        let onward = self.0.clone();
        tokio::spawn(async move {
            while let Some(mark) = pulses.recv().await {
                if onward.send(mark).await.is_err() {
                    return;
                }
            }
        });
    }
}
