//! The lines of an encoder: two in quadrature that show a count, or the selection of an absolute encoder on its bus.

use crate::spi::SpiFrame;
use crate::time::Picoseconds;
use crate::world::PinEdge;

/// Least time between two edges of an encoder, whatever jump it has to show.
const EDGE_SPACING: Picoseconds = Picoseconds::nanoseconds(200);

/// Times of the AS5048A from its selection to the clock, and from the end of a frame to the next selection.
const SELECT_TIME: Picoseconds = Picoseconds::nanoseconds(350);

/// The lines of one encoder: the count that they show, and the count that they are to reach.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Lines {
    pub shown: i32,
    wanted: i32,
    pub next: Option<Picoseconds>,
    spacing: Picoseconds,
}

/// The line that selects an absolute encoder: since when it does, and when it last ended.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Selection {
    since: Option<Picoseconds>,
    ended: Picoseconds,
}

impl Lines {
    /// Lines at rest at a count.
    pub fn at(count: i32) -> Self {
        Self { shown: count, wanted: count, ..Self::default() }
    }

    /// Sets the count to reach; its edges are spread over the coming `span`.
    pub fn aim(&mut self, count: i32, now: Picoseconds, span: Picoseconds) {
        self.wanted = count;
        let edges = u64::from(self.wanted.wrapping_sub(self.shown).unsigned_abs());
        if edges == 0 {
            self.next = None;
        } else {
            self.spacing = Picoseconds((span.0 / (edges + 1)).max(EDGE_SPACING.0));
            self.next = Some(now + self.spacing);
        }
    }

    /// Makes the next edge that is due; returns the line that changes, A (0) or B (1), and its level.
    pub fn edge(&mut self, now: Picoseconds) -> Option<(usize, bool)> {
        let due = self.next.filter(|&at| at <= now)?;
        let before = phases(self.shown);
        self.shown = self.shown.wrapping_add(self.wanted.wrapping_sub(self.shown).signum());
        self.next = (self.shown != self.wanted).then(|| due + self.spacing);
        let after = phases(self.shown);
        let line = usize::from(before[0] == after[0]);
        Some((line, after[line]))
    }
}

/// Levels of A and B at a count: A leads while it rises.
pub(crate) fn phases(count: i32) -> [bool; 2] {
    let quarter = count.rem_euclid(4);
    [quarter == 1 || quarter == 2, quarter >= 2]
}

impl Selection {
    pub fn select(&mut self, edge: PinEdge) {
        if edge.high {
            self.since = None;
            self.ended = edge.at.time;
        } else {
            self.since = Some(edge.at.time);
        }
    }

    pub fn is_selected(&self) -> bool {
        self.since.is_some()
    }

    /// Whether the absolute encoder understands a frame (AS5048A, "SPI timing"): mode 1, up to 10 MHz, 350 ns after it was
    /// selected, and 350 ns between two frames.
    pub fn understands(&self, frame: &SpiFrame) -> bool {
        let Some(since) = self.since else { return false };
        let in_time = frame.from >= since + SELECT_TIME && since >= self.ended + SELECT_TIME;
        frame.mode == 1 && frame.bits == 16 && frame.hertz <= 10_000_000 && in_time
    }
}
