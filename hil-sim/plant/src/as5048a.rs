//! The magnetic encoder AS5048A on its SPI (ams datasheet v1-11): registers, parity, errors, and answers one frame late.

use std::f64::consts::TAU;

/// Counts of a turn.
const TURN: f64 = 16_384.0;
/// Bits of a word: even parity, and "read" of a question or "error" of an answer.
const PARITY: u16 = 1 << 15;
const FLAG: u16 = 1 << 14;
const DATA: u16 = FLAG - 1;
/// Error register: frame, command, parity.
const BAD_COMMAND: u16 = 1 << 1;
const BAD_PARITY: u16 = 1 << 2;
/// Diagnostics: start over, angle not computed, field too strong, field too weak.
const STARTED: u16 = 1 << 8;
const OVERFLOW: u16 = 1 << 9;
const TOO_STRONG: u16 = 1 << 10;
const TOO_WEAK: u16 = 1 << 11;
/// Gain and magnitude with a magnet as it should be.
const GAIN: u16 = 128;
const MAGNITUDE: u16 = 4_000;

/// What is wrong with the encoder, its magnet or its wires.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum MagnetFault {
    /// The line of its answers is stuck at this level: broken, or shorted.
    Stuck(bool),
    /// The bit of this number is wrong in each answer.
    FlippedAnswer(u8),
    /// The bit of this number is wrong in each question.
    FlippedQuestion(u8),
    /// The magnet is too far away.
    Weak,
    /// The magnet is too near.
    Strong,
    /// The magnet is gone: the angle cannot be computed.
    Gone,
    /// The encoder starts again and again: its supply is too low.
    Starting,
}

/// An AS5048A under a magnet that turns with the axis.
#[derive(Clone, Copy, Debug)]
pub struct As5048aChip {
    /// Length of a turn of the magnet in micro-units of the axis.
    turn: f64,
    /// Reading where the axis is at zero.
    mount: f64,
    /// Largest error of its angle, which returns with each turn, in counts (integral nonlinearity).
    nonlinearity: f64,
    /// The answer to the frame before.
    answer: u16,
    errors: u16,
    fault: Option<MagnetFault>,
}

impl As5048aChip {
    /// An encoder whose magnet turns once in `turn` micro-units of the axis and which reads `mount` (counts) at the axis zero.
    #[must_use]
    pub fn new(turn: f64, mount: u16) -> Self {
        Self { turn, mount: mount.into(), nonlinearity: 0.0, answer: 0, errors: 0, fault: None }
    }

    /// Lets its angle be off by up to `counts`, as a sine of the angle.
    #[must_use]
    pub fn with_nonlinearity(self, counts: f64) -> Self {
        Self { nonlinearity: counts, ..self }
    }

    /// Makes it fail from now on, or work again.
    pub fn fail(&mut self, fault: Option<MagnetFault>) {
        self.fault = fault;
    }

    fn angle(&self, position: f64) -> u16 {
        let turns = position / self.turn;
        let counts = turns * TURN + self.mount + self.nonlinearity * (TAU * turns).sin();
        counts.floor().rem_euclid(TURN) as u16
    }

    /// Takes a frame of 16 bits while the axis is at `position`, and returns what the chip sent in it: the answer to the frame
    /// before.
    pub fn frame(&mut self, question: u16, position: f64) -> u16 {
        let question = match self.fault {
            Some(MagnetFault::FlippedQuestion(bit)) => question ^ 1 << (bit & 15),
            _ => question,
        };
        let sent = std::mem::replace(&mut self.answer, 0);
        self.answer = self.answer_to(question, position);
        match self.fault {
            Some(MagnetFault::Stuck(high)) => {
                if high {
                    u16::MAX
                } else {
                    0
                }
            }
            Some(MagnetFault::FlippedAnswer(bit)) => sent ^ 1 << (bit & 15),
            _ => sent,
        }
    }

    fn answer_to(&mut self, question: u16, position: f64) -> u16 {
        let mut data = 0;
        if question.count_ones() % 2 == 1 {
            self.errors |= BAD_PARITY;
        } else if question & FLAG == 0 {
            // Writing is for programming, which is not modelled: it is not understood.
            self.errors |= if question & DATA == 0 { 0 } else { BAD_COMMAND };
        } else {
            data = self.register(question & DATA, position);
        }
        let word = data & DATA | if self.errors == 0 { 0 } else { FLAG };
        if word.count_ones() % 2 == 1 { word | PARITY } else { word }
    }

    fn register(&mut self, address: u16, position: f64) -> u16 {
        match address {
            0x0001 => std::mem::take(&mut self.errors),
            0x3FFD => self.diagnostics(),
            0x3FFE => {
                if self.fault == Some(MagnetFault::Gone) {
                    0
                } else {
                    MAGNITUDE
                }
            }
            0x3FFF => self.angle(position),
            // No operation, programming, zero position: nothing programmed.
            0x0000 | 0x0003 | 0x0016 | 0x0017 => 0,
            _ => {
                self.errors |= BAD_COMMAND;
                0
            }
        }
    }

    fn diagnostics(&self) -> u16 {
        match self.fault {
            Some(MagnetFault::Weak) => STARTED | TOO_WEAK | 0xFF,
            Some(MagnetFault::Strong) => STARTED | TOO_STRONG,
            Some(MagnetFault::Gone) => STARTED | OVERFLOW | TOO_WEAK | 0xFF,
            Some(MagnetFault::Starting) => GAIN,
            _ => STARTED | GAIN,
        }
    }
}
