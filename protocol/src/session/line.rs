//! The outgoing side that both ends share.

use serde::Serialize;

use crate::Microseconds;
use crate::frame::{self, Header, MAX_FRAME};
use crate::receiver::increment;

/// After this much silence (microseconds) a 0x00 goes first: noise on an idle line must not spoil the next frame.
const IDLE: u64 = 10_000;

#[derive(Debug, Default)]
pub(super) struct Line {
    last: Option<Microseconds>,
    sent: u32,
}

impl Line {
    /// Writes one frame, with a 0x00 before it where the line was idle. `None` where the body does not fit a frame.
    pub(super) fn write<B: Serialize>(
        &mut self,
        now: Microseconds,
        header: Header,
        body: &B,
        buffer: &mut [u8; MAX_FRAME],
    ) -> Option<usize> {
        let mut length = frame::encode(header, body, buffer).ok()?;
        if self.last.is_none_or(|last| now.0.saturating_sub(last.0) >= IDLE) && length < MAX_FRAME {
            buffer.copy_within(..length, 1);
            buffer[0] = 0;
            length += 1;
        }
        self.last = Some(now);
        increment(&mut self.sent);
        Some(length)
    }

    /// Frames written so far.
    pub(super) const fn sent(&self) -> u32 {
        self.sent
    }
}
