//! Plays a recording from its beginning to its end, as fast as it can be measured or at the pace at which it was recorded.

use std::future::Future;
use std::time::Duration;

use tokio::task::yield_now;
use tokio::time::{Instant, sleep_until};
use vergence_board::BoardKnowledge;
use vergence_camera::CameraEvent;
use vergence_live::{LiveError, Measurement};
use vergence_vision::Side;

use crate::RecordingError;
use crate::event::Event;
use crate::reader::{Heard, Reader};
use crate::replay::Replay;

/// When the events of a recording are played.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Pacing {
    /// Exposures of this time after the first event are left out, and nothing of it is waited for.
    pub from: Duration,
    /// How many times as fast as it was recorded, more than zero; `None` for as fast as it can be measured.
    pub rate: Option<f64>,
}

impl Pacing {
    /// Microseconds that are left out.
    fn left_out_us(self) -> u64 {
        u64::try_from(self.from.as_micros()).unwrap_or(u64::MAX)
    }

    /// Time from the beginning of the replay to an event so many microseconds after the first one; `None` where nothing is waited for.
    fn due(self, since_first_us: u64) -> Option<Duration> {
        let played_us = since_first_us.checked_sub(self.left_out_us())?;
        Duration::try_from_secs_f64(played_us as f64 * 1e-6 / self.rate?).ok()
    }
}

/// Who follows a replay.
pub trait Audience {
    /// Completes when the replay may play the event that was heard `since_first` after the first one; the pace waits meanwhile.
    ///
    /// # Errors
    /// [`Jump`] where it shall go on elsewhere.
    fn proceed(&mut self, since_first: Duration) -> impl Future<Output = Result<(), Jump>>;

    /// Hears an event before it is measured. `board` is as before it.
    fn hear(&mut self, heard: &Heard, board: Option<&BoardKnowledge>);

    /// Takes what a camera did on its way to the measuring, and returns it.
    fn camera(&mut self, side: Side, event: CameraEvent) -> CameraEvent;
}

/// Where a replay shall go on: so long after the first event.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Jump(pub Duration);

/// Nobody follows.
impl Audience for () {
    async fn proceed(&mut self, _since_first: Duration) -> Result<(), Jump> {
        Ok(())
    }

    fn hear(&mut self, _heard: &Heard, _board: Option<&BoardKnowledge>) {}

    fn camera(&mut self, _side: Side, event: CameraEvent) -> CameraEvent {
        event
    }
}

/// Nobody follows where there is `None`.
impl<A: Audience> Audience for Option<&mut A> {
    async fn proceed(&mut self, since_first: Duration) -> Result<(), Jump> {
        match self {
            Some(audience) => audience.proceed(since_first).await,
            None => Ok(()),
        }
    }

    fn hear(&mut self, heard: &Heard, board: Option<&BoardKnowledge>) {
        if let Some(audience) = self {
            audience.hear(heard, board);
        }
    }

    fn camera(&mut self, side: Side, event: CameraEvent) -> CameraEvent {
        match self {
            Some(audience) => audience.camera(side, event),
            None => event,
        }
    }
}

/// Plays the event `first` and all that `reader` has after it, and calls `publish` with each measurement. Measuring blocks the caller's thread; between two
/// events other tasks have their turn.
///
/// # Errors
/// Those of [`Reader::next_event`], [`Replay::take`], `publish` and [`Audience::proceed`].
pub async fn play<E: From<LiveError> + From<RecordingError> + From<Jump>>(
    reader: &mut Reader,
    first: Option<Heard>,
    replay: &mut Replay<'_, impl Audience>,
    pacing: Pacing,
    publish: &mut impl FnMut(Measurement) -> Result<(), E>,
) -> Result<(), E> {
    let (mut begun, first_us) = (Instant::now(), first.as_ref().map_or(0, |heard| heard.host_us));
    let mut next = first;
    // What is left out is not even decoded.
    reader.decode_from(first_us.saturating_add(pacing.left_out_us()));
    while let Some(heard) = next {
        let since_first_us = heard.host_us.saturating_sub(first_us);
        if since_first_us >= pacing.left_out_us() {
            let held = Instant::now();
            replay.posing.audience.proceed(Duration::from_micros(since_first_us)).await?;
            begun += held.elapsed();
        }
        match pacing.due(since_first_us).and_then(|due| begun.checked_add(due)) {
            Some(due) => sleep_until(due).await,
            None => yield_now().await,
        }
        let is_left_out =
            since_first_us < pacing.left_out_us() && matches!(heard.event, Event::Image(..) | Event::Pulse(_));
        if !is_left_out {
            replay.take(heard, publish)?;
        }
        next = reader.next_event()?;
    }
    replay.finish(publish)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn events_are_due_after_what_is_left_out_divided_by_the_rate() {
        let pacing = Pacing { from: Duration::from_secs(2), rate: Some(4.0) };
        assert_eq!(pacing.due(1_999_999), None);
        assert_eq!(pacing.due(2_000_000), Some(Duration::ZERO));
        assert_eq!(pacing.due(3_000_000), Some(Duration::from_millis(250)));
        assert_eq!(Pacing { rate: None, ..pacing }.due(3_000_000), None);
    }
}
