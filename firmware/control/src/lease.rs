//! The lease: how long the board trusts a host that it does not hear.

use vergence_protocol::{Microseconds, SessionId};

/// No host may ask for a longer lease.
pub const LONGEST_LEASE_MS: u16 = 1000;

/// Whose heartbeat was heard, and until when it counts.
#[derive(Clone, Copy, Debug, Default)]
pub struct Lease {
    session: SessionId,
    until: Microseconds,
    lease_us: u64,
}

impl Lease {
    /// Takes a heartbeat. While `held_by` holds the board only its own heartbeats count.
    pub fn renew(&mut self, now: Microseconds, session: SessionId, lease_ms: u16, held_by: Option<SessionId>) {
        if held_by.is_some_and(|holder| holder != session) {
            return;
        }
        let lease_us = u64::from(lease_ms.min(LONGEST_LEASE_MS)) * 1000;
        *self = Self { session, until: Microseconds(now.0 + lease_us), lease_us };
    }

    /// Whether `session` has a live lease.
    pub fn is_live(&self, now: Microseconds, session: SessionId) -> bool {
        self.session == session && now < self.until
    }

    /// How long the host had been silent at `now`, in microseconds.
    pub fn silence(&self, now: Microseconds) -> u64 {
        now.0.saturating_sub(self.until.0.saturating_sub(self.lease_us))
    }
}
