//! Finds frames in a stream of bytes; accepts any bytes.

use cobs::{DecodeResult, DecoderState};
use heapless::Vec;
use postcard_schema::Schema;
use serde::{Deserialize, Serialize};

use crate::frame::{Frame, FrameError, MAX_PACKET};

/// Frames received and dropped. Each counter stays at its largest value instead of wrapping.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, Schema)]
pub struct LinkCounters {
    /// Frames with a correct CRC.
    pub frames: u32,
    /// Dropped: longer than [`crate::MAX_FRAME`].
    pub too_long: u32,
    /// Dropped: shorter than header and CRC.
    pub too_short: u32,
    /// Dropped: broken byte stuffing.
    pub stuffing: u32,
    /// Dropped: wrong CRC.
    pub checksum: u32,
    /// Dropped: unknown kind of frame.
    pub kind: u32,
    /// Dropped: the body is no known message, or bytes follow it.
    pub body: u32,
}

impl LinkCounters {
    /// Number of all dropped frames.
    #[must_use]
    pub const fn dropped(&self) -> u32 {
        self.too_long
            .saturating_add(self.too_short)
            .saturating_add(self.stuffing)
            .saturating_add(self.checksum)
            .saturating_add(self.kind)
            .saturating_add(self.body)
    }

    /// Counts one frame as dropped because of `error`.
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

/// Adds one to `counter`; the largest value stays.
pub(crate) const fn increment(counter: &mut u32) {
    *counter = counter.saturating_add(1);
}

/// Undoes the byte stuffing as bytes arrive and checks each frame at its closing 0x00.
///
/// ```
/// use vergence_protocol::frame::{Header, Kind, encode};
/// use vergence_protocol::{MAX_FRAME, PROTOCOL, Receiver, Request};
///
/// let header = Header { major: PROTOCOL.major, kind: Kind::Immediate, seq: 0, ack: 0 };
/// let mut bytes = [0; MAX_FRAME];
/// let length = encode(header, &Request::GetInfo, &mut bytes)?;
/// let mut receiver = Receiver::new();
/// for &byte in &bytes[..length] {
///     if let Some(frame) = receiver.push(byte) {
///         assert_eq!(frame.body::<Request>()?, Request::GetInfo);
///     }
/// }
/// assert_eq!(receiver.counters().frames, 1);
/// # Ok::<(), vergence_protocol::frame::FrameError>(())
/// ```
#[derive(Debug, Default)]
pub struct Receiver {
    decoder: DecoderState,
    packet: Vec<u8, MAX_PACKET>,
    too_long: bool,
    counters: LinkCounters,
}

impl Receiver {
    /// A receiver at the beginning of the stream.
    #[must_use]
    pub fn new() -> Self {
        Self::default()
    }

    /// Takes the next byte and returns the frame that this byte ends. Bytes that are no frame are counted and skipped.
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

    /// Counts a frame as dropped that [`Self::push`] returned but whose body its reader could not use.
    pub fn reject(&mut self, error: FrameError) {
        self.counters.count(error);
    }

    /// Frames received and dropped so far.
    #[must_use]
    pub const fn counters(&self) -> LinkCounters {
        self.counters
    }
}
