//! Frames to the peer (RM0440 §37.5.5).

use vergence_cpu::{Cycle, NEVER};

use super::{Shifting, Uart, cr1, cr3, flag};
use crate::peripheral::{Moment, Refused, Reply};

impl Uart {
    /// TXE, or with FIFO TXFNF.
    pub(super) fn has_room(&self) -> bool {
        self.outbox.len() < self.depth()
    }

    /// Takes a write to TDR.
    pub(super) fn push(&mut self, moment: Moment, byte: u8) -> Reply<()> {
        if !self.is_on(cr1::TE) {
            return Err("a byte is written while the transmitter is off".into());
        }
        if !self.has_room() {
            return Err(Refused(format!("the byte {byte:#04x} is written to a full data register")));
        }
        self.bit(moment)?;
        self.isr &= !flag::TC;
        self.outbox.push_back(byte);
        self.send_next(moment, moment.now);
        Ok(())
    }

    /// Switches the transmitter on, which sends an idle frame first.
    pub(super) fn begin_idle_frame(&mut self, moment: Moment) {
        self.idle_until = moment.now + self.half_bits(moment, 2 * self.frame_bits());
    }

    /// Switches the transmitter off: the frame on the line is finished, the rest is lost.
    pub(super) fn stop_sending(&mut self) {
        self.outbox.clear();
        self.isr |= flag::TC;
        self.sending = None;
    }

    fn send_next(&mut self, moment: Moment, now: Cycle) {
        if self.sending.is_none()
            && let Some(byte) = self.outbox.pop_front()
        {
            let begins = now.max(self.idle_until);
            if self.hears_itself() {
                self.line_is_busy();
            }
            self.sending = Some(Shifting { byte, ends: begins + self.half_bits(moment, 2 * self.frame_bits()) });
        }
    }

    /// Whether the receiver is on the one wire with the transmitter.
    fn hears_itself(&self) -> bool {
        self.cr3 & cr3::HDSEL != 0 && self.is_on(cr1::RE)
    }

    pub(super) fn advance_sending(&mut self, moment: Moment) {
        while let Some(Shifting { byte, ends }) = self.sending.filter(|sending| sending.ends <= moment.now) {
            self.sending = None;
            if self.connected[0] {
                self.sent.push((ends, byte));
            }
            // On one wire the receiver receives from its own transmitter (§37.5.15).
            if self.hears_itself() {
                self.take(moment, byte, 0);
                self.expect_idle(moment, ends.saturating_sub(self.half_bits(moment, 1)));
            }
            self.send_next(moment, ends);
            if self.sending.is_none() {
                self.isr |= flag::TC;
            }
        }
    }

    /// The level of the driver enable output, where it is in use (CR3.DEM, CR3.DEP).
    pub fn driver_enable(&self) -> Option<bool> {
        let inverted = self.cr3 >> 15 & 1 == 1;
        (self.cr3 >> 14 & 1 == 1).then(|| self.sending.is_some() != inverted)
    }

    pub(super) fn sending_due(&self) -> Cycle {
        self.sending.map_or(NEVER, |sending| sending.ends)
    }

    pub(super) fn transmit_flags(&self) -> u32 {
        // CR3.TXFTCFG: the free places that raise the threshold flag (§37.8.4).
        const FREE: [usize; 8] = [1, 2, 4, 6, 7, 8, 8, 8];
        let mut flags = 0;
        if self.has_room() {
            flags |= flag::TXE;
        }
        if self.outbox.is_empty() {
            flags |= flag::TXFE;
        }
        let free = self.depth() - self.outbox.len();
        if self.cr1 & cr1::FIFOEN != 0 && free >= FREE[(self.cr3 >> 29 & 7) as usize] {
            flags |= flag::TXFT;
        }
        flags
    }
}
