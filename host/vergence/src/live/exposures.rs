//! Which frames belong together, and when they were exposed. Pure: frames, pulses and time come in as arguments.

use std::collections::{BTreeMap, VecDeque};

use vergence_protocol::{FrameMark, Microseconds};
use vergence_rig::{BoardInstant, ClockMap, Fate, FramePairing, HostInstant, StampedFrame, TimedEvent};
use vergence_vision::Side;

use super::eye::{LiveFrame, News};
use crate::camera::{FrameTiming, as_event, as_stamped, side_by_side};

/// Why a camera is dead that was never heard of.
pub const UNHEARD: &str = "it has not answered yet";
/// What is on its way for longer than this does not arrive.
const PATIENCE_US: f64 = 500_000.0;

/// On which clock exposures are wanted.
#[derive(Clone, Debug)]
pub enum TimeBase {
    /// The board's, as far as it is known now.
    Board(ClockMap),
    /// The host's: there is no board.
    Host,
}

/// A frame and when the middle of its middle row was exposed.
pub struct Shot {
    /// The frame.
    pub frame: LiveFrame,
    /// On the clock of the [`TimeBase`].
    pub middle: BoardInstant,
}

/// What can be measured.
pub enum Exposed {
    /// Both cameras, taken together.
    Pair(Box<[Shot; 2]>),
    /// One camera, because the other is dead.
    One {
        /// The living one.
        side: Side,
        /// Its frame.
        shot: Box<Shot>,
        /// Why the other is dead.
        why: String,
    },
}

/// Both cameras, and the pulses that fire them where the board does.
pub struct Exposures {
    eyes: [Eye; 2],
    sync: Sync,
    ready: VecDeque<Exposed>,
    skipped: BTreeMap<&'static str, u64>,
    ambiguity: Ambiguity,
}

/// Frames that time does not tell apart: said once.
enum Ambiguity {
    None,
    ToTell(String),
    Told,
}

#[derive(Default)]
struct Eye {
    timing: Option<FrameTiming>,
    /// Why it is dead; `None` while it is there.
    dead: Option<String>,
    /// Frames whose fate is not decided.
    frames: BTreeMap<u32, LiveFrame>,
    /// With the pulses of the board.
    pulses: Option<FramePairing>,
}

enum Sync {
    /// The board fires both cameras, a pulse each so many microseconds.
    Triggered { period_us: f64, pulses: BTreeMap<u32, Pulse> },
    /// The cameras run freely: right frames are paired with left ones.
    Free(Option<FramePairing>),
}

/// What has come of a pulse.
struct Pulse {
    at: Microseconds,
    slots: [Slot; 2],
}

enum Slot {
    Waiting,
    Taken(LiveFrame),
    Missed,
}

impl Slot {
    fn give_up(&mut self) {
        if matches!(self, Self::Waiting) {
            *self = Self::Missed;
        }
    }
}

impl Exposures {
    /// Fired by the board each `period_us` microseconds, or running freely.
    #[must_use]
    pub fn new(period_us: Option<f64>) -> Self {
        let sync = match period_us {
            Some(period_us) => Sync::Triggered { period_us, pulses: BTreeMap::new() },
            None => Sync::Free(None),
        };
        let unheard = || Eye { dead: Some(UNHEARD.into()), ..Eye::default() };
        Self {
            eyes: [unheard(), unheard()],
            sync,
            ready: VecDeque::new(),
            skipped: BTreeMap::new(),
            ambiguity: Ambiguity::None,
        }
    }

    /// Why each camera is dead; `None` for one that is there.
    #[must_use]
    pub fn dead(&self) -> [Option<&str>; 2] {
        self.eyes.each_ref().map(|eye| eye.dead.as_deref())
    }

    /// How much was skipped so far, by reason.
    #[must_use]
    pub fn skipped(&self) -> &BTreeMap<&'static str, u64> {
        &self.skipped
    }

    /// Counts what somebody else skips.
    pub fn skip(&mut self, reason: &'static str) {
        *self.skipped.entry(reason).or_default() += 1;
    }

    /// Why frames cannot be told apart by time, once.
    pub fn take_ambiguity(&mut self) -> Option<String> {
        match std::mem::replace(&mut self.ambiguity, Ambiguity::Told) {
            Ambiguity::ToTell(text) => Some(text),
            before => {
                self.ambiguity = before;
                None
            }
        }
    }

    /// The next thing that can be measured, oldest first.
    pub fn take(&mut self) -> Option<Exposed> {
        self.ready.pop_front()
    }

    /// A camera tells something.
    pub fn hear(&mut self, side: Side, news: News, base: &TimeBase) {
        match news {
            News::There(timing) => self.there(side, timing),
            News::Dead(why) => self.eyes[side.index()].dead = Some(why),
            News::Frame(frame) => self.frame(side, frame, base),
        }
        self.decide(base);
    }

    /// The board fired the cameras.
    pub fn pulse(&mut self, mark: &FrameMark, base: &TimeBase) {
        let TimeBase::Board(clock) = base else { return };
        let Some(at) = clock.host_at(mark.at) else { return self.skip("clock_unknown") };
        if let Sync::Triggered { pulses, .. } = &mut self.sync {
            pulses.insert(mark.seq, Pulse { at: mark.at, slots: [Slot::Waiting, Slot::Waiting] });
        }
        for pairing in self.eyes.iter_mut().filter_map(|eye| eye.pulses.as_mut()) {
            pairing.event(TimedEvent { seq: mark.seq, at });
        }
        self.decide(base);
    }

    /// Gives up what should have arrived long ago.
    pub fn settle(&mut self, now: Microseconds, base: &TimeBase) {
        let until = now.0 as f64 - PATIENCE_US;
        self.eyes.iter_mut().filter_map(|eye| eye.pulses.as_mut()).for_each(|pairing| pairing.settle(until));
        if let Sync::Free(Some(pairing)) = &mut self.sync {
            pairing.settle(until);
        }
        self.decide(base);
    }

    fn there(&mut self, side: Side, timing: FrameTiming) {
        let eye = &mut self.eyes[side.index()];
        *eye = Eye { timing: Some(timing), ..Eye::default() };
        match &mut self.sync {
            Sync::Triggered { period_us, pulses } => {
                eye.pulses = Some(FramePairing::new(timing.after_pulse(), *period_us));
                // It has seen nothing of what was fired before.
                pulses.values_mut().for_each(|pulse| pulse.slots[side.index()].give_up());
            }
            Sync::Free(pairing) => {
                let periods = self.eyes.each_ref().map(|eye| eye.timing.map(|timing| timing.period));
                *pairing = match periods {
                    [Some(left), Some(right)] => Some(side_by_side(left.max(right))),
                    _ => None,
                };
            }
        }
    }

    fn frame(&mut self, side: Side, frame: LiveFrame, base: &TimeBase) {
        let (seq, middle) = (frame.seq, frame.middle);
        let other_dead = self.eyes[side.other().index()].dead.clone();
        match &mut self.sync {
            Sync::Free(Some(pairing)) if other_dead.is_none() => match side {
                Side::Left => pairing.event(as_event(seq, middle)),
                Side::Right => pairing.frame(as_stamped(seq, middle)),
            },
            Sync::Free(_) => {
                let Some(why) = other_dead else { return };
                match on_base(middle, base) {
                    Some(middle) => {
                        self.ready.push_back(Exposed::One { side, shot: Box::new(Shot { frame, middle }), why });
                    }
                    None => self.skip("clock_unknown"),
                }
                return;
            }
            Sync::Triggered { .. } => {
                let stamped = StampedFrame { seq, middle };
                let Some(pairing) = &mut self.eyes[side.index()].pulses else { return };
                if let (Some(excess), Ambiguity::None) = (pairing.excess_us(&stamped, 0.0), &self.ambiguity) {
                    self.ambiguity = Ambiguity::ToTell(ambiguity(side, excess));
                }
                pairing.frame(stamped);
            }
        }
        self.eyes[side.index()].frames.insert(seq, frame);
    }

    /// Works off all that is certain now.
    fn decide(&mut self, base: &TimeBase) {
        match &self.sync {
            Sync::Free(_) => self.decide_free(base),
            Sync::Triggered { .. } => {
                for side in [0, 1] {
                    while let Some(fate) = self.eyes[side].pulses.as_mut().and_then(FramePairing::take) {
                        self.decide_triggered(side, fate);
                    }
                }
                self.collect();
            }
        }
    }

    fn decide_triggered(&mut self, side: usize, fate: Fate) {
        let Sync::Triggered { pulses, .. } = &mut self.sync else { return };
        let frames = &mut self.eyes[side].frames;
        let reason = match fate {
            Fate::Paired { event, frame } => {
                if let (Some(pulse), Some(frame)) = (pulses.get_mut(&event), frames.remove(&frame)) {
                    pulse.slots[side] = Slot::Taken(frame);
                }
                return;
            }
            Fate::EventAlone(event) => {
                if let Some(pulse) = pulses.get_mut(&event) {
                    pulse.slots[side] = Slot::Missed;
                }
                return;
            }
            Fate::FrameAlone(frame) => frames.remove(&frame).map(|_| "frame_without_pulse"),
            Fate::Ambiguous(frame) => frames.remove(&frame).map(|_| "frame_of_either_pulse"),
        };
        if let Some(reason) = reason {
            self.skip(reason);
        }
    }

    /// Takes the pulses of which everything is known.
    fn collect(&mut self) {
        let Sync::Triggered { pulses, .. } = &mut self.sync else { return };
        let mut complete = Vec::new();
        while let Some(entry) = pulses.first_entry() {
            let waits =
                |side: usize| matches!(entry.get().slots[side], Slot::Waiting) && self.eyes[side].dead.is_none();
            if waits(0) || waits(1) {
                break;
            }
            complete.push(entry.remove());
        }
        for Pulse { at, slots } in complete {
            let shot = |side: usize, frame| {
                self.eyes[side].timing.map(|timing| Shot { frame, middle: after_pulse(at, &timing) })
            };
            match slots {
                [Slot::Taken(left), Slot::Taken(right)] => {
                    if let (Some(left), Some(right)) = (shot(0, left), shot(1, right)) {
                        self.ready.push_back(Exposed::Pair(Box::new([left, right])));
                    }
                }
                [Slot::Taken(frame), _] => self.one(Side::Left, shot(0, frame)),
                [_, Slot::Taken(frame)] => self.one(Side::Right, shot(1, frame)),
                _ => self.skip("no_frame_of_pulse"),
            }
        }
    }

    /// A frame without the other camera's: worth something only where that one is dead.
    fn one(&mut self, side: Side, shot: Option<Shot>) {
        match (self.eyes[side.other().index()].dead.clone(), shot) {
            (Some(why), Some(shot)) => self.ready.push_back(Exposed::One { side, shot: Box::new(shot), why }),
            _ => self.skip(match side {
                Side::Left => "right_frame_lost",
                Side::Right => "left_frame_lost",
            }),
        }
    }

    fn decide_free(&mut self, base: &TimeBase) {
        while let Sync::Free(Some(pairing)) = &mut self.sync
            && let Some(fate) = pairing.take()
        {
            let [left, right] = &mut self.eyes;
            let reason = match fate {
                Fate::Paired { event, frame } => match (left.frames.remove(&event), right.frames.remove(&frame)) {
                    (Some(left), Some(right)) => {
                        let shot = |frame: LiveFrame| Some(Shot { middle: on_base(frame.middle, base)?, frame });
                        match (shot(left), shot(right)) {
                            (Some(left), Some(right)) => {
                                self.ready.push_back(Exposed::Pair(Box::new([left, right])));
                                continue;
                            }
                            _ => "clock_unknown",
                        }
                    }
                    _ => continue,
                },
                Fate::EventAlone(event) => match left.frames.remove(&event) {
                    Some(_) => "right_frame_lost",
                    None => continue,
                },
                Fate::FrameAlone(frame) => match right.frames.remove(&frame) {
                    Some(_) => "left_frame_lost",
                    None => continue,
                },
                Fate::Ambiguous(frame) => match right.frames.remove(&frame) {
                    Some(_) => "out_of_step",
                    None => continue,
                },
            };
            self.skip(reason);
        }
    }
}

/// The middle of the exposure that a pulse began: its edge is known exactly.
fn after_pulse(at: Microseconds, timing: &FrameTiming) -> BoardInstant {
    let delay = timing.after_pulse();
    let half = 0.5 * (delay.most_us - delay.least_us);
    BoardInstant { us: at.0 as f64 + delay.least_us + half, error_us: half }
}

/// A stamp of the host on the clock of `base`.
fn on_base(middle: HostInstant, base: &TimeBase) -> Option<BoardInstant> {
    match base {
        TimeBase::Host => Some(BoardInstant { us: middle.us, error_us: middle.error_us }),
        TimeBase::Board(clock) => {
            let at = clock.board_at(Microseconds(middle.us.max(0.0) as u64))?;
            Some(BoardInstant { error_us: at.error_us + middle.error_us, ..at })
        }
    }
}

fn ambiguity(side: Side, excess_us: f64) -> String {
    format!(
        "frames of the {side} camera may belong to either of two pulses: when they were exposed is known {:.0} ms too badly for \
         this rate; fire more slowly, or say --exposure and --readout",
        (excess_us / 1000.0).ceil()
    )
}
