//! Bytes to frames, whatever the bytes are.

use cobs::{DecodeResult, DecoderState};
use heapless::Vec;
use postcard_schema::Schema;
use serde::{Deserialize, Serialize};

use crate::frame::{Frame, FrameError, MAX_PACKET};

/// What came in. Each stays at its largest value rather than wrap.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, Schema)]
pub struct LinkCounters {
    /// Frames whose CRC held.
    pub frames: u32,
    /// Dropped: longer than a frame may be.
    pub too_long: u32,
    /// Dropped: shorter than header and CRC.
    pub too_short: u32,
    /// Dropped: broken byte stuffing.
    pub stuffing: u32,
    /// Dropped: wrong CRC.
    pub checksum: u32,
    /// Dropped: unknown kind of frame.
    pub kind: u32,
    /// Dropped: the body is not a message we know, or bytes are left after it.
    pub body: u32,
}

impl LinkCounters {
    /// All that was dropped.
    #[must_use]
    pub const fn dropped(&self) -> u32 {
        self.too_long
            .saturating_add(self.too_short)
            .saturating_add(self.stuffing)
            .saturating_add(self.checksum)
            .saturating_add(self.kind)
            .saturating_add(self.body)
    }

    /// Counts one dropped frame.
    pub fn count(&mut self, error: FrameError) {
        increment(match error {
            FrameError::TooLong => &mut self.too_long,
            FrameError::TooShort => &mut self.too_short,
            FrameError::Stuffing => &mut self.stuffing,
            FrameError::Checksum => &mut self.checksum,
            FrameError::Kind => &mut self.kind,
            FrameError::Body => &mut self.body,
        });
    }
}

/// Adds one; the largest value stays.
pub(crate) const fn increment(counter: &mut u32) {
    *counter = counter.saturating_add(1);
}

/// Undoes the byte stuffing as bytes arrive and checks each frame at its 0x00.
#[derive(Debug, Default)]
pub struct Receiver {
    decoder: DecoderState,
    packet: Vec<u8, MAX_PACKET>,
    too_long: bool,
    counters: LinkCounters,
}

impl Receiver {
    /// A receiver that has seen nothing.
    #[must_use]
    pub fn new() -> Self {
        Self::default()
    }

    /// Takes the next byte; gives the frame that it ended, if it did. What is no frame is counted and skipped.
    pub fn push(&mut self, byte: u8) -> Option<Frame<'_>> {
        match self.decoder.feed(byte) {
            Ok(DecodeResult::NoData) => None,
            Ok(DecodeResult::DataStart) => {
                self.packet.clear();
                self.too_long = false;
                None
            }
            Ok(DecodeResult::DataContinue(byte)) => {
                self.too_long |= self.packet.push(byte).is_err();
                None
            }
            Ok(DecodeResult::DataComplete) => self.finish(Ok(())),
            Err(_) => self.finish(Err(FrameError::Stuffing)),
        }
    }

    fn finish(&mut self, stuffing: Result<(), FrameError>) -> Option<Frame<'_>> {
        let length = if self.too_long { Err(FrameError::TooLong) } else { Ok(()) };
        match length.and(stuffing).and_then(|()| Frame::parse(&self.packet)) {
            Ok(frame) => {
                increment(&mut self.counters.frames);
                Some(frame)
            }
            Err(error) => {
                self.counters.count(error);
                None
            }
        }
    }

    /// Counts a frame as dropped after all: whoever read its body could not use it.
    pub fn reject(&mut self, error: FrameError) {
        self.counters.count(error);
    }

    /// What came in so far.
    #[must_use]
    pub const fn counters(&self) -> LinkCounters {
        self.counters
    }
}
