//! A stop that is sent again and again until the board answers, because a lost one leaves the stages moving.

use vergence_protocol::{HostSession, Microseconds, Request, StopKind, SubmitError, Ticket};

/// Time in microseconds between two sendings: one frame in fifty is lost where one byte in a thousand is.
pub(super) const REPEAT_US: u64 = 20_000;

/// A stop on its way. Call [`Self::send`] at [`Self::due`] until a reply answers it ([`Self::is_answered_by`]).
#[derive(Clone, Debug)]
pub struct RepeatedStop {
    kind: StopKind,
    tickets: Vec<Ticket>,
    due: Microseconds,
}

impl RepeatedStop {
    /// A stop to be sent first at `now`.
    #[must_use]
    pub fn new(kind: StopKind, now: Microseconds) -> Self {
        Self { kind, tickets: Vec::new(), due: now }
    }

    /// Time of the next sending.
    #[must_use]
    pub fn due(&self) -> Microseconds {
        self.due
    }

    /// Gives the stop to `session` if it is due; it goes before all other requests. Call it before
    /// [`HostSession::transmit`].
    ///
    /// # Errors
    /// [`SubmitError`], as [`HostSession::send_now`].
    pub fn send(&mut self, now: Microseconds, session: &mut HostSession) -> Result<(), SubmitError> {
        if now >= self.due {
            self.due = Microseconds(now.0 + REPEAT_US);
            self.tickets.push(session.send_now(Request::Stop { kind: self.kind })?);
        }
        Ok(())
    }

    /// Whether a reply to `ticket` answers one of the sendings.
    #[must_use]
    pub fn is_answered_by(&self, ticket: Ticket) -> bool {
        self.tickets.contains(&ticket)
    }

    /// Number of sendings so far.
    #[must_use]
    pub fn sendings(&self) -> usize {
        self.tickets.len()
    }
}
