//! Passes what the live loop hears on to it, and tells a [`Recorder`] of it.

use tokio::sync::mpsc::{Receiver, channel};
use vergence_board::HostClock;
use vergence_camera::CameraEvent;
use vergence_protocol::TriggerMark;
use vergence_vision::Side;

use crate::Recorder;

/// The events of `events`, recorded as they pass at the time of `clock`. Call within a tokio runtime.
#[must_use]
pub fn recorded_events(
    mut events: Receiver<(Side, CameraEvent)>,
    recorder: Recorder,
    clock: HostClock,
) -> Receiver<(Side, CameraEvent)> {
    let (onward, passed) = channel(events.max_capacity());
    tokio::spawn(async move {
        while let Some((side, event)) = events.recv().await {
            let event = recorder.camera(clock.now(), side, event);
            if onward.send((side, event)).await.is_err() {
                return;
            }
        }
    });
    passed
}

/// The pulses of `marks`, recorded as they pass at the time of `clock`. Call within a tokio runtime.
#[must_use]
pub fn recorded_marks(mut marks: Receiver<TriggerMark>, recorder: Recorder, clock: HostClock) -> Receiver<TriggerMark> {
    let (onward, passed) = channel(marks.max_capacity());
    tokio::spawn(async move {
        while let Some(mark) = marks.recv().await {
            recorder.pulse(clock.now(), &mark);
            if onward.send(mark).await.is_err() {
                return;
            }
        }
    });
    passed
}
