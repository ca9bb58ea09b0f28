//! Records cameras and trigger pulses without measuring.

use std::future::pending;
use std::pin::pin;
use std::time::Duration;

use tokio::select;
use tokio::sync::mpsc::Receiver;
use tokio::time::sleep;
use vergence_camera::CameraEvent;
use vergence_live::{Ended, Limits, LiveError, READINGS};
use vergence_protocol::TriggerMark;
use vergence_vision::Side;

use crate::RecordingError;
use crate::recording::Recording;

impl Recording {
    /// Records the events of both cameras and the pulses of the trigger, until each camera that is alive gave as many images as `limits` has results, its time
    /// is over, the cameras have no more images, or both are dead. Then waits for the readings of the last exposure. `warn` is told when a camera dies.
    ///
    /// # Errors
    /// A link that ended.
    pub async fn keep(
        &self,
        (mut events, mut marks): (Receiver<(Side, CameraEvent)>, Option<Receiver<TriggerMark>>),
        limits: Limits,
        mut warn: impl FnMut(String),
    ) -> Result<Ended, RecordingError> {
        let mut over = pin!(after(limits.time));
        let mut cameras = Cameras::default();
        let ended = loop {
            select! {
                event = events.recv() => {
                    let Some((side, event)) = event else { break Ended::Done };
                    cameras.note(side, &event).into_iter().for_each(&mut warn);
                    // The image is made by the task that writes it.
                    drop(self.recorder.camera(self.clock.now(), side, event));
                }
                mark = next(&mut marks) => self.pulse(mark)?,
                () = &mut over => break Ended::Done,
            }
            if cameras.are_dead() {
                break Ended::Blind;
            }
            if limits.results.is_some_and(|most| cameras.gave(most)) {
                break Ended::Done;
            }
        };
        let mut readings = pin!(sleep(READINGS));
        loop {
            select! {
                mark = next(&mut marks) => self.pulse(mark)?,
                () = &mut readings => return Ok(ended),
            }
        }
    }

    fn pulse(&self, mark: Option<TriggerMark>) -> Result<(), RecordingError> {
        let mark = mark.ok_or(LiveError::LinkEnded)?;
        self.recorder.pulse(self.clock.now(), &mark);
        Ok(())
    }
}

/// How many images came of each camera, and which are dead.
#[derive(Clone, Copy, Debug, Default)]
struct Cameras {
    images: [u64; 2],
    dead: [bool; 2],
}

impl Cameras {
    /// Counts an event; returns a sentence where a camera dies.
    fn note(&mut self, side: Side, event: &CameraEvent) -> Option<String> {
        let (images, dead) = (&mut self.images[side.index()], &mut self.dead[side.index()]);
        match event {
            CameraEvent::Attached(_) => *dead = false,
            CameraEvent::Image(_) => *images += 1,
            CameraEvent::Lost(why) => {
                let was_alive = !std::mem::replace(dead, true);
                return was_alive.then(|| format!("the {side} camera is dead: {why}"));
            }
        }
        None
    }

    fn are_dead(self) -> bool {
        self.dead == [true; 2]
    }

    /// Whether each camera that is alive gave this many images.
    fn gave(self, most: u64) -> bool {
        self.images.iter().zip(self.dead).all(|(&images, dead)| dead || images >= most)
    }
}

/// Completes after this time; never without one.
async fn after(time: Option<Duration>) {
    match time {
        Some(time) => sleep(time).await,
        None => pending().await,
    }
}

/// The next pulse; never where the cameras run freely.
async fn next(marks: &mut Option<Receiver<TriggerMark>>) -> Option<TriggerMark> {
    match marks {
        Some(marks) => marks.recv().await,
        None => pending().await,
    }
}
