//! A conversation with the native board.
#![allow(dead_code, unused_imports, reason = "each test file uses its own part")]
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic, reason = "a test fails by panic")]

#[path = "../../../../tests/conversation.rs"]
mod conversation;

use vergence_control::AxisSettings;
use vergence_plant::{AxisMechanics, NativeBoard, bench_mechanics, bench_settings};
use vergence_protocol::{Microseconds, Refusal, Status};

pub use conversation::{BOTH, Conversation, LEASE_MS};

/// The host's instants lie between the board's ticks.
const OFFSET_US: u64 = 370;

pub type Rigged = Conversation<NativeBoard>;

impl Conversation<NativeBoard> {
    /// The bench, switched on, without a session.
    pub fn off(seed: u64) -> Self {
        Self::with(&bench_settings(), &bench_mechanics(), seed)
    }

    pub fn with(settings: &[AxisSettings], mechanics: &[AxisMechanics], seed: u64) -> Self {
        let board = NativeBoard::new(settings, mechanics, seed).unwrap();
        let mut rigged = Self::with_board(board, Microseconds(OFFSET_US));
        rigged.is_prompt = true;
        rigged
    }

    /// A session with telemetry, disarmed.
    pub fn open(mut self) -> Self {
        self.connect();
        self
    }

    /// Armed and homed.
    pub fn homed(seed: u64) -> Self {
        let mut rigged = Self::off(seed).open();
        rigged.arm_and_home();
        rigged
    }

    /// Switches the board off and on again.
    pub fn restart_board(&mut self, seed: u64) {
        self.board = NativeBoard::new(&bench_settings(), &bench_mechanics(), seed).unwrap();
        self.board_start = self.now.0 - OFFSET_US;
    }

    /// The board's clock began again at zero when the host's read `now`.
    pub fn board_starts(&mut self, now: Microseconds) {
        self.board_start = now.0;
    }

    /// Refused for this reason.
    pub fn refused(why: Refusal) -> Status {
        Status::Refused(why)
    }
}
