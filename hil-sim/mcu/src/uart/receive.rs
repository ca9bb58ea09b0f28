//! Frames from the peer (RM0440 §37.5.6).

use vergence_cpu::{Cycle, NEVER};

use super::{Frame, LineFault, Shifting, Uart, cr1, cr3, flag};
use crate::peripheral::Moment;

/// How much the peer's bit length may differ: §37.5.8 tolerates 3.33 to 4.86 % by configuration; beyond 4 % it fails
/// here.
const TOLERANCE_PERCENT: u64 = 4;

impl Uart {
    /// Lets the peer send `frame` after what it is sending.
    pub fn receive(&mut self, moment: Moment, frame: Frame) {
        self.incoming.push_back(frame);
        self.arrive_next(moment, moment.now);
    }

    /// Whether the peer has sent everything.
    pub fn is_line_quiet(&self) -> bool {
        self.arriving.is_none() && self.incoming.is_empty()
    }

    fn arrive_next(&mut self, moment: Moment, now: Cycle) {
        if self.arriving.is_none()
            && let Some(frame) = self.incoming.pop_front()
        {
            // The receiver samples the middle of the stop bit: half a bit before the end.
            let half_bits = 2 * self.frame_bits() - 1;
            let cycles =
                u128::from(half_bits) * u128::from(moment.clocks.tree.hclk) / (2 * u128::from(frame.baud.max(1)));
            self.arriving = Some((frame, Shifting { byte: frame.byte, ends: now + cycles as Cycle }));
            self.line_is_busy();
        }
    }

    /// A frame begins: the line is not idle.
    pub(super) fn line_is_busy(&mut self) {
        self.idle_at = None;
        self.timeout_at = None;
    }

    pub(super) fn advance_receiving(&mut self, moment: Moment) {
        while let Some((frame, Shifting { byte, ends })) =
            self.arriving.filter(|(_, shifting)| shifting.ends <= moment.now)
        {
            self.arriving = None;
            if self.is_on(cr1::RE) && self.connected[1] {
                self.sample(moment, frame, byte);
                self.expect_idle(moment, ends);
            }
            let half_bit = u64::from(moment.clocks.tree.hclk) / (2 * u64::from(frame.baud.max(1)));
            self.arrive_next(moment, ends + half_bit);
        }
        if self.idle_at.is_some_and(|at| at <= moment.now) {
            self.idle_at = None;
            self.isr |= flag::IDLE;
        }
        if self.timeout_at.is_some_and(|at| at <= moment.now) {
            self.timeout_at = None;
            self.isr |= flag::RTOF;
        }
    }

    /// The byte and flags that the receiver makes of a frame: a frame at another baud rate is garbage with a bad stop
    /// bit.
    fn sample(&mut self, moment: Moment, frame: Frame, byte: u8) {
        let (own, far) = (u64::from(self.baud(moment)), u64::from(frame.baud));
        if own.abs_diff(far) * 100 > own * TOLERANCE_PERCENT {
            return self.take(moment, byte.rotate_left(3) ^ 0xA5, flag::FE);
        }
        let errors = match frame.fault {
            LineFault::None => 0,
            LineFault::Noise => flag::NE,
            LineFault::Framing => flag::FE,
        };
        self.take(moment, byte, errors);
    }

    /// Puts a received byte into RDR or the FIFO; without room it is lost and sets a flag.
    pub(super) fn take(&mut self, _moment: Moment, byte: u8, errors: u32) {
        if self.inbox.len() < self.depth() {
            self.inbox.push_back((byte, errors));
            if self.inbox.len() == 1 {
                self.isr |= errors;
            }
        } else if self.cr3 & cr3::OVRDIS != 0 {
            self.inbox.pop_back();
            self.inbox.push_back((byte, errors));
        } else {
            self.isr |= flag::ORE;
        }
    }

    /// Expects silence after a frame whose stop bit was sampled at `sampled`.
    pub(super) fn expect_idle(&mut self, moment: Moment, sampled: Cycle) {
        // From the middle of the stop bit: its second half, then a whole frame of ones.
        self.idle_at = Some(sampled + self.half_bits(moment, 1 + 2 * self.frame_bits()));
        let bits = u64::from(self.rtor & 0xFF_FFFF);
        self.timeout_at = (self.cr2 >> 23 & 1 == 1).then(|| sampled + self.half_bits(moment, 1 + 2 * bits));
    }

    /// Takes a read of RDR.
    pub(super) fn pop(&mut self) -> u8 {
        let byte = self.inbox.pop_front().map_or(0, |(byte, _)| byte);
        if let Some(&(_, errors)) = self.inbox.front() {
            self.isr |= errors;
        }
        byte
    }

    pub(super) fn flush(&mut self) {
        self.inbox.clear();
    }

    pub(super) fn receiving_due(&self) -> Cycle {
        let arrives = self.arriving.map_or(NEVER, |(_, shifting)| shifting.ends);
        arrives.min(self.idle_at.unwrap_or(NEVER)).min(self.timeout_at.unwrap_or(NEVER))
    }

    pub(super) fn receive_flags(&self) -> u32 {
        // CR3.RXFTCFG: the full places that raise the threshold flag (§37.8.4).
        const FULL: [usize; 8] = [1, 2, 4, 6, 7, 8, 8, 8];
        let mut flags = 0;
        if !self.inbox.is_empty() {
            flags |= flag::RXNE;
        }
        if self.cr1 & cr1::FIFOEN != 0 {
            if self.inbox.len() == self.depth() {
                flags |= flag::RXFF;
            }
            if self.inbox.len() >= FULL[(self.cr3 >> 25 & 7) as usize] {
                flags |= flag::RXFT;
            }
        }
        if self.arriving.is_some() {
            flags |= flag::BUSY;
        }
        flags
    }
}
