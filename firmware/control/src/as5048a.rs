//! The magnetic encoder AS5048A by its SPI (ams datasheet v1-11, "SPI interface"): 16 bits a frame, mode 1, even parity.
//!
//! An answer comes in the frame after its question. Two frames a tick ask for the angle and for the diagnostics, so that the
//! angle is that of the first frame, and the diagnostics those of the tick before.

use vergence_protocol::{EncoderState, FaultCode};

use crate::encoder::TURN;

/// Bit 14 of a question: a read. Of an answer: the question before was not understood.
const READ: u16 = 1 << 14;
const ERROR: u16 = 1 << 14;
const DATA: u16 = READ - 1;

/// Registers. Reading the error register clears the error.
const CLEAR_ERROR: u16 = 0x0001;
const DIAGNOSTICS: u16 = 0x3FFD;
const ANGLE: u16 = 0x3FFF;

/// Diagnostics: the start is over, the angle cannot be computed, the field is too strong or too weak, the gain.
const STARTED: u16 = 1 << 8;
const OVERFLOW: u16 = 1 << 9;
const FIELD: u16 = 3 << 10;
const GAIN: u16 = 0xFF;

/// Exchanges in a row that may fail: until the last of them the encoder reads as before.
const PATIENCE: u8 = 3;

/// What the board knows of an AS5048A.
#[derive(Clone, Copy, Debug)]
pub struct As5048a {
    /// Turns and reading, which never jumps.
    count: i32,
    /// The question whose answer comes next; `None` before the first.
    asked: Option<u16>,
    failures: u8,
    state: EncoderState,
}

impl Default for As5048a {
    fn default() -> Self {
        Self { count: 0, asked: None, failures: 0, state: EncoderState::Starting }
    }
}

impl As5048a {
    /// Asks the encoder for its angle: two calls of `exchange`, each of which sends a word in a frame of its own and returns
    /// the word received, or `None` where the bus did not work.
    pub fn ask(&mut self, mut exchange: impl FnMut(u16) -> Option<u16>) {
        let diagnosed = exchange(question(ANGLE));
        let next = if self.failures > 0 && self.asked == Some(DIAGNOSTICS) { CLEAR_ERROR } else { DIAGNOSTICS };
        let angle = exchange(question(next));
        let before = self.asked.replace(next);
        let is_dead = |word: &u16| *word == 0 || *word == u16::MAX;
        if diagnosed.zip(angle).is_none_or(|(one, other)| is_dead(&one) && one == other) {
            return self.fail(FaultCode::EncoderLost);
        }
        match (data(diagnosed), data(angle)) {
            (Some(diagnostics), Some(angle)) if before == Some(DIAGNOSTICS) => self.judge(diagnostics, angle),
            // The error register or nothing was asked before: no news.
            (_, Some(_)) if before != Some(DIAGNOSTICS) => {}
            _ => self.fail(FaultCode::EncoderGarbled),
        }
    }

    fn judge(&mut self, diagnostics: u16, angle: u16) {
        if diagnostics & STARTED == 0 {
            // At the start it needs some milliseconds; later it has lost its supply.
            return self.fail(FaultCode::EncoderLost);
        }
        if diagnostics & (OVERFLOW | FIELD) != 0 {
            return self.fail(FaultCode::EncoderMagnet);
        }
        let half = (TURN / 2).cast_signed();
        let way = (i32::from(angle).wrapping_sub(self.count).wrapping_add(half)).rem_euclid(TURN.cast_signed()) - half;
        self.count = self.count.wrapping_add(way);
        self.failures = 0;
        self.state = EncoderState::Absolute { reading: angle, gain: (diagnostics & GAIN) as u8 };
    }

    fn fail(&mut self, code: FaultCode) {
        self.failures = (self.failures + 1).min(PATIENCE);
        if self.failures == PATIENCE {
            self.state = EncoderState::Failed(code);
        }
    }

    /// The reading, and whole turns, so that it never jumps.
    #[must_use]
    pub fn count(&self) -> i32 {
        self.count
    }

    /// State of the encoder.
    #[must_use]
    pub fn state(&self) -> EncoderState {
        self.state
    }
}

/// A read of `register`, with its parity.
fn question(register: u16) -> u16 {
    let word = READ | register;
    word | u16::from(word.count_ones() % 2 == 1) << 15
}

/// The data of an answer; `None` where it is garbled or tells of an error.
fn data(word: Option<u16>) -> Option<u16> {
    word.filter(|word| word.count_ones() % 2 == 0 && word & ERROR == 0).map(|word| word & DATA)
}
