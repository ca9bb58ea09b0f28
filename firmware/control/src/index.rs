//! Checks the count of an encoder at its index pulses: between two of them there are always as many counts.
//!
//! A pulse is as wide as a count or more, so that it has two edges. Compared is the one at which it begins: the lower one on the
//! way up, the upper one on the way down, each with the first one of its direction. Counts at rest flicker, and the line with
//! them, so that the direction is that of the last few counts, and of several edges of a pulse the first one decides; where that
//! is the end of a pulse, the way began within it, and the pulse is passed over.

use vergence_protocol::{EncoderState, FaultCode};

use crate::follow::Lost;
use crate::io::IndexEdge;

/// Counts back that make another direction: more than those by which an encoder flickers.
const TURN_BACK: i32 = 4;

/// The pulses since the axis got its reference. All counts are raw.
#[derive(Clone, Copy, Debug, Default)]
pub struct IndexWatch {
    /// Counts at the first pulse on the way down, and on the way up.
    first: [Option<i32>; 2],
    /// Count at the latest edge, or where the watch began.
    latest: i32,
    passes: u32,
    drift: i32,
    worst: i32,
    /// Direction, and the furthest count in it.
    rises: Option<bool>,
    furthest: i32,
    /// Count at the first edge of the pulse that was passed last in this direction.
    pulse: Option<i32>,
}

impl IndexWatch {
    /// Begins anew at the count `raw`.
    pub fn begin(raw: i32) -> Self {
        Self { latest: raw, furthest: raw, ..Self::default() }
    }

    /// Takes the count of this tick, and the edges that have come since the last one. Pulses are `every` counts apart; they may be
    /// off by `most`.
    pub fn watch(&mut self, every: u32, most: i32, raw: i32, edges: &[IndexEdge]) -> Option<Lost> {
        let every = i32::try_from(every).ok().filter(|every| *every > 0)?;
        let direction = self.rises;
        self.follow(raw);
        let mut lost = None;
        for edge in edges {
            self.latest = edge.count;
            let is_near = |pulse: i32| edge.count.wrapping_sub(pulse).unsigned_abs() < every.unsigned_abs() / 2;
            if !self.pulse.is_some_and(is_near) {
                self.pulse = Some(edge.count);
                if let Some(up) = self.rises.filter(|_| edge.rises && direction == self.rises) {
                    lost = lost.or(self.pass(every, most, edge.count, up));
                }
            }
        }
        let way = raw.wrapping_sub(self.latest);
        if way.unsigned_abs() > every.saturating_add(most.saturating_mul(2)).unsigned_abs() {
            self.latest = raw;
            return lost.or(Some(Lost { code: FaultCode::IndexMissing, detail: way }));
        }
        lost
    }

    fn follow(&mut self, raw: i32) {
        let way = raw.wrapping_sub(self.furthest);
        match self.rises {
            Some(rises) if way == 0 || (way > 0) == rises => self.furthest = raw,
            _ if way.unsigned_abs() >= TURN_BACK.unsigned_abs() => {
                self.rises = Some(way > 0);
                self.furthest = raw;
                self.pulse = None;
            }
            _ => {}
        }
    }

    fn pass(&mut self, every: i32, most: i32, at: i32, up: bool) -> Option<Lost> {
        let first = *self.first[usize::from(up)].get_or_insert(at);
        let drift = nearest(at.wrapping_sub(first), every);
        self.passes = self.passes.saturating_add(1);
        self.drift = drift;
        if drift.unsigned_abs() > self.worst.unsigned_abs() {
            self.worst = drift;
        }
        (drift.unsigned_abs() > most.unsigned_abs()).then_some(Lost { code: FaultCode::EncoderDrift, detail: drift })
    }

    /// What the pulses have shown.
    pub fn state(&self) -> EncoderState {
        EncoderState::Indexed { passes: self.passes, drift: self.drift, worst: self.worst }
    }
}

/// The rest of a division of `counts`, from minus half of `every` to half of it.
fn nearest(counts: i32, every: i32) -> i32 {
    let rest = counts.rem_euclid(every);
    if rest > every / 2 { rest - every } else { rest }
}
