//! The host's side of a firmware update, without input or output of its own.
//!
//! Chunks go out up to four ahead of the answers (go-back-N). The board decides the offset: the host sends the byte that
//! the board wants next. So a lost chunk, a page that must be written again, a restarted board and a host that comes back
//! later are handled in one way.

use heapless::Vec;

use crate::management::{CHUNK, ImageHeader, Management, ManagementReport, Outcome, Signature};
use crate::{HostSession, Microseconds, WINDOW};

/// Largest distance of the chunks ahead of the answers, in bytes.
const AHEAD: u32 = (WINDOW * CHUNK) as u32;
/// First time-out of a chunk in microseconds: four chunks at 115 200 baud and the erasure of a page.
const CHUNK_PATIENCE: u64 = 200_000;
/// First time-out of `Commit` in microseconds: the board hashes the image and checks its signature.
const COMMIT_PATIENCE: u64 = 2_000_000;
/// Largest number of times that a time-out doubles.
const DOUBLINGS: u32 = 3;
/// Byte that fills the last chunk: erased flash.
const FILL: u8 = 0xFF;
/// Bytes that the flash programs at once: the length of a chunk is a multiple of it.
const UNIT: usize = 8;

/// State of an update.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum UploadState {
    /// Asking the board to begin or resume the update.
    Beginning,
    /// Sending the image.
    Sending,
    /// The board checks the image.
    Checking,
    /// Complete: the board will start the image on trial at its next start.
    Done,
    /// Refused by the board.
    Failed(Outcome),
}

/// One update of a board's firmware.
///
/// Loop: give the board's answers to [`receive`](Self::receive) and call [`transmit`](Self::transmit), at the latest at
/// [`next_wake`](Self::next_wake), until the state is `Done` or `Failed`. An update never gives up by itself.
#[derive(Debug)]
pub struct Upload<'a> {
    image: &'a [u8],
    header: ImageHeader,
    signature: Signature,
    state: UploadState,
    /// The next byte that the board wants.
    next: u32,
    /// The next byte to send.
    sent: u32,
    /// Number of the `Begin` or `Commit` that awaits its answer.
    asked: Option<u8>,
    /// Number of the latest request.
    latest: u8,
    /// Number of the first request whose answer tells the present state: earlier ones are out of date.
    fresh_from: u8,
    /// Number of time-outs in a row.
    silences: u32,
    waiting_since: Microseconds,
}

impl<'a> Upload<'a> {
    /// An update that has not begun; `None` if the header's length is not that of `image`.
    #[must_use]
    pub fn new(image: &'a [u8], header: ImageHeader, signature: Signature) -> Option<Self> {
        (usize::try_from(header.length) == Ok(image.len())).then_some(Self {
            image,
            header,
            signature,
            state: UploadState::Beginning,
            next: 0,
            sent: 0,
            asked: None,
            latest: 0,
            fresh_from: 0,
            silences: 0,
            waiting_since: Microseconds(0),
        })
    }

    /// State of the update.
    #[must_use]
    pub const fn state(&self) -> UploadState {
        self.state
    }

    /// Number of bytes that the board has, and length of the image in bytes.
    #[must_use]
    pub const fn progress(&self) -> (u32, u32) {
        (self.next, self.header.length)
    }

    /// Asks the board again how far the update is: for a new `HostSession`. Ignored if the update is done or has failed.
    pub fn resume(&mut self) {
        if matches!(self.state, UploadState::Beginning | UploadState::Sending | UploadState::Checking) {
            self.enter(UploadState::Beginning);
            self.silences = 0;
        }
    }

    /// Gives `host` the requests to send at `now`.
    pub fn transmit(&mut self, now: Microseconds, host: &mut HostSession) {
        if self.is_waiting() && now >= self.deadline() {
            self.silences = (self.silences + 1).min(DOUBLINGS);
            self.asked = None;
            self.sent = self.next;
            self.fresh_from = self.latest.wrapping_add(1);
        }
        match self.state {
            UploadState::Beginning => self.ask(now, host, Management::Begin(self.header)),
            UploadState::Checking => self.ask(now, host, Management::Commit(self.signature)),
            UploadState::Sending => self.send_chunks(now, host),
            UploadState::Done | UploadState::Failed(_) => {}
        }
    }

    /// Time at which [`Self::transmit`] next has a request if no answer comes before; zero means at once.
    #[must_use]
    pub fn next_wake(&self) -> Option<Microseconds> {
        match self.state {
            UploadState::Done | UploadState::Failed(_) => None,
            _ if self.may_send() => Some(Microseconds(0)),
            _ => Some(self.deadline()),
        }
    }

    /// Takes an answer of the board, which arrived at `now`.
    pub fn receive(&mut self, now: Microseconds, report: &ManagementReport) {
        let ManagementReport::Progress { to, next, outcome } = *report else { return };
        match self.state {
            UploadState::Beginning if self.asked == Some(to) => match outcome {
                Outcome::Done => self.go_on(now, next),
                refused => self.enter(UploadState::Failed(refused)),
            },
            UploadState::Sending => self.receive_chunk(now, to, next, outcome),
            UploadState::Checking if self.asked == Some(to) => match outcome {
                Outcome::Done => self.enter(UploadState::Done),
                Outcome::Missing => self.go_on(now, next),
                Outcome::NotBegun => self.enter(UploadState::Beginning),
                refused => self.enter(UploadState::Failed(refused)),
            },
            _ => {}
        }
    }

    fn receive_chunk(&mut self, now: Microseconds, to: u8, next: u32, outcome: Outcome) {
        let is_fresh = to.wrapping_sub(self.fresh_from) < 1 << 7;
        match outcome {
            Outcome::Done if next >= self.next => self.go_on(now, next),
            // A chunk was lost, or the board repeats a page. All chunks under way bring the same answer: only the first
            // one acts.
            Outcome::Done | Outcome::Missing if is_fresh => {
                self.fresh_from = self.latest.wrapping_add(1);
                self.sent = next;
                self.go_on(now, next);
            }
            Outcome::NotBegun if is_fresh => self.enter(UploadState::Beginning),
            Outcome::Done | Outcome::Missing | Outcome::NotBegun => {}
            refused => self.enter(UploadState::Failed(refused)),
        }
    }

    /// Continues at `next`, the byte that the board wants.
    fn go_on(&mut self, now: Microseconds, next: u32) {
        self.next = next.min(self.header.length);
        self.sent = self.sent.clamp(self.next, self.header.length);
        self.silences = 0;
        self.waiting_since = now;
        if self.next == self.header.length {
            self.enter(UploadState::Checking);
        } else if self.state != UploadState::Sending {
            self.sent = self.next;
            self.enter(UploadState::Sending);
        }
    }

    fn enter(&mut self, state: UploadState) {
        self.state = state;
        self.asked = None;
        self.fresh_from = self.latest.wrapping_add(1);
    }

    fn ask(&mut self, now: Microseconds, host: &mut HostSession, request: Management) {
        if self.asked.is_none()
            && let Ok(seq) = host.manage(request)
        {
            self.asked = Some(seq);
            self.latest = seq;
            self.waiting_since = now;
        }
    }

    fn send_chunks(&mut self, now: Microseconds, host: &mut HostSession) {
        while self.may_send()
            && let Some(chunk) = self.chunk()
            && let Ok(seq) = host.manage(chunk)
        {
            if !self.is_waiting() {
                self.waiting_since = now;
            }
            self.latest = seq;
            self.sent = (self.sent + CHUNK as u32).min(self.header.length);
        }
    }

    /// The next chunk to send, filled up to whole units of flash.
    fn chunk(&self) -> Option<Management> {
        let rest = self.image.get(usize::try_from(self.sent).ok()?..)?;
        let mut data: Vec<u8, CHUNK> = rest.iter().take(CHUNK).copied().collect();
        let whole = data.len().next_multiple_of(UNIT);
        data.resize(whole, FILL).ok()?;
        Some(Management::Chunk { offset: self.sent, data })
    }

    const fn may_send(&self) -> bool {
        match self.state {
            UploadState::Sending => {
                self.sent < self.header.length && self.sent + CHUNK as u32 <= self.next.saturating_add(AHEAD)
            }
            _ => self.asked.is_none(),
        }
    }

    fn is_waiting(&self) -> bool {
        match self.state {
            UploadState::Sending => self.sent > self.next,
            _ => self.asked.is_some(),
        }
    }

    fn deadline(&self) -> Microseconds {
        let patience = if self.state == UploadState::Checking { COMMIT_PATIENCE } else { CHUNK_PATIENCE };
        Microseconds(self.waiting_since.0.saturating_add(patience << self.silences))
    }
}
