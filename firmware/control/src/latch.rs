//! The fault latch: the first fault is kept, later ones are counted.

use vergence_protocol::{FaultCode, FaultRecord, Microseconds};

/// Holds the first fault since the last clear, and counts all faults since the board started.
#[derive(Clone, Copy, Debug, Default)]
pub struct FaultLatch {
    record: Option<FaultRecord>,
    /// Number of faults since the board started.
    total: u16,
}

impl FaultLatch {
    /// Latches a fault; returns true if it is the first since the last clear.
    pub fn raise(&mut self, code: FaultCode, at: Microseconds, axis: Option<usize>, detail: i32) -> bool {
        self.total = self.total.wrapping_add(1);
        if let Some(first) = &mut self.record {
            first.later = first.later.saturating_add(1);
            return false;
        }
        let axis = axis.and_then(|axis| u8::try_from(axis).ok());
        self.record = Some(FaultRecord { code, seq: self.total, at, axis, detail, later: 0 });
        true
    }

    /// The latched fault, if any.
    pub fn record(&self) -> Option<FaultRecord> {
        self.record
    }

    /// Clears the fault with number `seen`; returns false if another one, or none, is latched.
    pub fn clear(&mut self, seen: u16) -> bool {
        let matches = self.record.is_some_and(|record| record.seq == seen);
        if matches {
            self.record = None;
        }
        matches
    }
}
