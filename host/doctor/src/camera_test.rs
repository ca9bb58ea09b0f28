//! Hears what both cameras send for a while, and looks at some of the images.

use std::pin::pin;
use std::time::Duration;

use tokio::sync::mpsc::Receiver;
use tokio::time::sleep;
use vergence_board::{Board, BoardError, HostClock};
use vergence_camera::{CameraError, CameraEvent, Develop, Field, ImageQuality, camera_mask};
use vergence_protocol::{Request, Trigger, TriggerMark};
use vergence_rig::{ExposureTiming, HostInstant, Rig};
use vergence_vision::Side;

/// So many images of each camera are looked at: decoding all would slow a small computer down.
const LOOKS: u32 = 6;
/// Images of the last pulse are waited for so long.
const LAST: Duration = Duration::from_millis(150);

/// The cameras of a rig, ready to be tested.
pub struct CameraTest<'a> {
    /// What of the left and of the right image shows something.
    pub fields: [Field; 2],
    /// The board that fires them; `None` where nothing does.
    pub board: Option<&'a mut Board>,
    /// How it fires them; `None` where they run freely.
    pub trigger: Option<Trigger>,
    /// The clock of images and pulses.
    pub clock: HostClock,
}

/// What arrives from the cameras and their trigger.
pub struct Taken<'a> {
    /// Events of both cameras.
    pub events: &'a mut Receiver<(Side, CameraEvent)>,
    /// Pulses of the trigger; `None` where the cameras run freely.
    pub marks: Option<&'a mut Receiver<TriggerMark>>,
}

/// An image that arrived.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct HeardImage {
    /// The camera's number of it.
    pub seq: u32,
    /// Middle of its exposure.
    pub middle: HostInstant,
    /// When it arrived, on the host's clock in microseconds.
    pub arrived_us: f64,
    /// Number of bytes that the camera sent; `None` where it came over no cable.
    pub bytes: Option<u32>,
}

/// What was heard.
#[derive(Clone, Debug, Default)]
pub struct Heard {
    /// How the left and the right camera expose; `None` of one that was never there.
    pub timing: [Option<ExposureTiming>; 2],
    /// The images of each, in the order of their arrival.
    pub images: [Vec<HeardImage>; 2],
    /// Figures of some of them.
    pub looks: [Vec<ImageQuality>; 2],
    /// Why a camera was lost, or an image could not be read or looked at.
    pub troubles: [Vec<String>; 2],
    /// Numbers of the pulses and when they were, on the host's clock.
    pub pulses: Vec<(u32, HostInstant)>,
}

impl<'a> CameraTest<'a> {
    /// The cameras of `rig`, fired by `board` as the trigger says, with the clock of images and pulses.
    ///
    /// # Errors
    /// Those of the rig's masks.
    pub fn of(
        rig: &Rig,
        board: Option<&'a mut Board>,
        (trigger, clock): (Option<Trigger>, HostClock),
    ) -> Result<Self, CameraError> {
        let field = |side: Side| {
            let lens = rig.camera(side);
            let mask = rig.masks[side.index()].as_ref().map(|mask| camera_mask(mask, lens.size())).transpose()?;
            Ok(Field::of(lens, mask.as_ref()))
        };
        Ok(Self { fields: [field(Side::Left)?, field(Side::Right)?], board, trigger, clock })
    }

    /// Fires the cameras where the board does so, hears them for `time` or until `interruption`, and looks at some of their images.
    ///
    /// # Errors
    /// A link that ended.
    pub async fn hear(
        &mut self,
        taken: &mut Taken<'_>,
        time: Duration,
        interruption: impl Future<Output = ()>,
    ) -> Result<Heard, BoardError> {
        if let Some(board) = &mut self.board {
            board.compare_clocks().await?;
        }
        self.set_trigger(self.trigger).await?;
        let (mut heard, mut marks) = (Heard::default(), Vec::new());
        let mut kept: [Vec<Develop>; 2] = Default::default();
        let begun = self.clock.now();
        let mut over = pin!(async {
            tokio::select! {
                () = sleep(time) => {}
                () = interruption => {}
            }
        });
        let slot = time / LOOKS;
        let mut last = [None; 2];
        loop {
            tokio::select! {
                event = taken.events.recv() => match event {
                    Some((side, event)) => {
                        let age = Duration::from_micros(self.clock.now().0.saturating_sub(begun.0));
                        let number = (age.as_secs_f64() / slot.as_secs_f64().max(1e-3)) as u32;
                        let is_next = last[side.index()].is_none_or(|last| number > last);
                        if let Some(develop) = heard.take(side, event, self.clock).filter(|_| is_next) {
                            last[side.index()] = Some(number);
                            kept[side.index()].push(develop);
                        }
                    }
                    None => break,
                },
                Some(mark) = next(&mut taken.marks) => marks.push(mark),
                () = &mut over => break,
            }
        }
        self.set_trigger(self.trigger.map(|_| Trigger::Off)).await?;
        self.hear_the_last(taken, &mut heard, &mut marks).await;
        if let Some(board) = &self.board {
            let clock = board.client().clock_map();
            // By their order: the board numbers them anew when the trigger is switched off, with the last one on its way.
            heard.pulses = (0..).zip(marks.iter().filter_map(|mark| clock.host_at(mark.at))).collect();
        }
        for (side, kept) in [Side::Left, Side::Right].into_iter().zip(kept) {
            self.look(side, kept, &mut heard);
        }
        Ok(heard)
    }

    async fn set_trigger(&self, trigger: Option<Trigger>) -> Result<(), BoardError> {
        match (&self.board, trigger) {
            (Some(board), Some(trigger)) => board.ask(Request::SetTrigger(trigger)).await,
            _ => Ok(()),
        }
    }

    /// Images that are on their way when the trigger stops.
    async fn hear_the_last(&self, taken: &mut Taken<'_>, heard: &mut Heard, marks: &mut Vec<TriggerMark>) {
        let mut patience = pin!(sleep(LAST));
        // Free-running cameras go on, and one more image of each tells nothing new.
        while self.trigger.is_some() {
            tokio::select! {
                Some((side, event)) = taken.events.recv() => drop(heard.take(side, event, self.clock)),
                Some(mark) = next(&mut taken.marks) => marks.push(mark),
                () = &mut patience => return,
            }
        }
    }

    fn look(&self, side: Side, kept: Vec<Develop>, heard: &mut Heard) {
        for develop in kept {
            match develop().map(|image| (ImageQuality::of(&image, &self.fields[side.index()]), image.dimensions())) {
                Ok((Some(quality), _)) => heard.looks[side.index()].push(quality),
                Ok((None, (width, height))) => heard.troubles[side.index()].push(format!(
                    "its images are {width} x {height}, and those of the rig file are not: name the rig file of these cameras"
                )),
                Err(error) => heard.troubles[side.index()].push(error.to_string()),
            }
        }
    }
}

impl Heard {
    /// Notes an event; hands out what makes its image, where it is one.
    fn take(&mut self, side: Side, event: CameraEvent, clock: HostClock) -> Option<Develop> {
        match event {
            CameraEvent::Attached(timing) => self.timing[side.index()] = Some(timing),
            CameraEvent::Lost(why) => self.troubles[side.index()].push(why),
            CameraEvent::Image(image) => {
                let arrived_us = clock.now().0 as f64;
                let heard = HeardImage { seq: image.seq, middle: image.middle, arrived_us, bytes: image.bytes };
                self.images[side.index()].push(heard);
                return Some(image.develop);
            }
        }
        None
    }
}

/// The next pulse; never where the cameras run freely.
async fn next(marks: &mut Option<&mut Receiver<TriggerMark>>) -> Option<TriggerMark> {
    match marks {
        Some(marks) => marks.recv().await,
        None => std::future::pending().await,
    }
}
