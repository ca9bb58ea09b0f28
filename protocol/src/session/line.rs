//! Outgoing frames: the part that host and board share.

use serde::Serialize;

use crate::Microseconds;
use crate::frame::{self, Header, MAX_FRAME};
use crate::receiver::increment;

/// After this silence, in microseconds, a 0x00 goes before the next frame: it ends any noise that an idle line made.
const IDLE: u64 = 10_000;

/// The outgoing side of a line.
#[derive(Debug, Default)]
pub(super) struct Line {
    /// Time of the last frame written.
    last: Option<Microseconds>,
    sent: u32,
}

impl Line {
    /// Writes one frame, after a 0x00 if the line was idle; returns the number of bytes. `None` if the body does not fit a
    /// frame.
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

    /// Number of frames written so far.
    pub(super) const fn sent(&self) -> u32 {
        self.sent
    }
}
