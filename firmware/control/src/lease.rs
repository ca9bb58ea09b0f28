//! The lease: the time that the board keeps going without hearing from its host.

use vergence_protocol::{Microseconds, SessionId};

/// Longest lease in milliseconds; a longer one is shortened to it.
pub const LONGEST_LEASE_MS: u16 = 1000;

/// The session whose heartbeat came last, and the time until which its lease is valid.
#[derive(Clone, Copy, Debug, Default)]
pub struct Lease {
    session: SessionId,
    until: Microseconds,
    lease_us: u64,
}

impl Lease {
    /// Takes a heartbeat of `session`. While a session holds the board (`held_by`), only its own heartbeats count.
    pub fn renew(&mut self, now: Microseconds, session: SessionId, lease_ms: u16, held_by: Option<SessionId>) {
        if held_by.is_some_and(|holder| holder != session) {
            return;
        }
        let lease_us = u64::from(lease_ms.min(LONGEST_LEASE_MS)) * 1000;
        *self = Self { session, until: Microseconds(now.0 + lease_us), lease_us };
    }

    /// Whether `session` has a lease that is valid at `now`.
    pub fn is_live(&self, now: Microseconds, session: SessionId) -> bool {
        self.session == session && now < self.until
    }

    /// Time since the last heartbeat at `now`, in microseconds.
    pub fn silence(&self, now: Microseconds) -> u64 {
        now.0.saturating_sub(self.until.0.saturating_sub(self.lease_us))
    }
}
