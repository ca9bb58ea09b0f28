//! Whether whoever moves the board still follows it. The link has a task of its own, which would send heartbeats for a
//! program that hangs; so they go out only while that program reads poses or asks for something.

use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};

use vergence_protocol::{ControllerState, Microseconds};

/// Longest time without a look at the board while it moves, in microseconds. Whoever waits for the end of a motion reads
/// every pose, and they come each 100 ms at least.
const IN_MOTION_US: u64 = 1_000_000;
/// The same while it rests, armed: long enough for the work between two moves.
const AT_REST_US: u64 = 120_000_000;

/// When the program last looked at the board, on the host's clock. Clones share it.
#[derive(Clone, Debug)]
pub(super) struct Attention(Arc<AtomicU64>);

impl Attention {
    /// The program looks now.
    pub(super) fn new(now: Microseconds) -> Self {
        Self(Arc::new(AtomicU64::new(now.0)))
    }

    /// Notes that the program looks now.
    pub(super) fn pay(&self, now: Microseconds) {
        self.0.store(now.0, Ordering::Relaxed);
    }

    /// Whether the program has looked lately enough for a board in this state.
    pub(super) fn is_paid(&self, now: Microseconds, state: ControllerState) -> bool {
        let moves = matches!(state, ControllerState::Homing | ControllerState::Moving | ControllerState::Stopping);
        let patience = if moves { IN_MOTION_US } else { AT_REST_US };
        now.0.saturating_sub(self.0.load(Ordering::Relaxed)) < patience
    }
}
