//! A difference between the two boards, for people.

use std::fmt;

use super::steps::Phase;
use crate::journal::Journal;

/// The first difference of a session: something that the boards did not do alike.
#[derive(Clone, Debug, PartialEq)]
pub struct Difference {
    /// What differs, such as `state` or `counts of axis 0`.
    pub field: String,
    /// The value on the native board.
    pub native: String,
    /// The value on the chip.
    pub chip: String,
}

impl Difference {
    /// A difference of a field.
    pub fn new(field: impl Into<String>, native: impl fmt::Debug, chip: impl fmt::Debug) -> Self {
        Self { field: field.into(), native: format!("{native:?}"), chip: format!("{chip:?}") }
    }

    /// An error unless both values are equal.
    pub fn unless_equal<T: PartialEq + fmt::Debug>(field: &str, native: &T, chip: &T) -> Result<(), Self> {
        if native == chip { Ok(()) } else { Err(Self::new(field, native, chip)) }
    }

    /// An error unless two numbers are at most `allowed` apart.
    pub fn unless_close(field: impl Into<String>, native: f64, chip: f64, allowed: f64) -> Result<(), Self> {
        if (native - chip).abs() <= allowed {
            return Ok(());
        }
        let field = format!("{} (at most {allowed:.1} apart)", field.into());
        Err(Self { field, native: format!("{native:.1}"), chip: format!("{chip:.1}") })
    }
}

impl fmt::Display for Difference {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}: native {}, chip {}", self.field, self.native, self.chip)
    }
}

/// How far the boards were apart at most, and how much was compared.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Figures {
    /// Messages other than poses.
    pub messages: u64,
    /// Poses.
    pub poses: u64,
    /// Step pulses whose instants were compared.
    pub steps: u64,
    /// Poses whose state, phase, fault or mode was that of a neighbouring tick of the other board.
    pub poses_a_tick_apart: u64,
    /// Motions in which the boards saw a switch or an encoder at different ticks; their later steps are only counted.
    pub motions_apart: u64,
    /// Failures between a stall and a slip, to which the boards gave different names.
    pub named_apart: u64,
    /// Largest difference of step instants by phase, in microseconds, of steps that come faster than 10 kHz.
    pub step_us: [f64; 5],
    /// The same of all steps, as a share of the time since the step before.
    pub step_share: [f64; 5],
    /// Largest difference of counts in mid-move as the time in which the axis goes as far, in microseconds.
    pub lag_us: f64,
    /// Largest difference of the counts at rest with a reference, for each axis.
    pub rest_counts: [i32; 2],
    /// Largest difference of the instants of requests as the boards' clocks show them, in microseconds.
    pub request_us: u64,
}

impl Figures {
    /// Records that a step was `us` apart, `interval_us` after the step before.
    pub fn note_step(&mut self, phase: Phase, us: f64, interval_us: f64) {
        let most = &mut self.step_share[phase as usize];
        *most = most.max(us / interval_us.max(1.0));
        if interval_us < 100.0 {
            let most = &mut self.step_us[phase as usize];
            *most = most.max(us);
        }
    }

    /// Adds those of another session.
    pub fn merge(&mut self, other: &Self) {
        self.messages += other.messages;
        self.poses += other.poses;
        self.steps += other.steps;
        self.poses_a_tick_apart += other.poses_a_tick_apart;
        self.motions_apart += other.motions_apart;
        self.named_apart += other.named_apart;
        self.request_us = self.request_us.max(other.request_us);
        self.lag_us = self.lag_us.max(other.lag_us);
        let theirs = other.step_us.into_iter().chain(other.step_share);
        for (mine, theirs) in self.step_us.iter_mut().chain(&mut self.step_share).zip(theirs) {
            *mine = mine.max(theirs);
        }
        for (mine, theirs) in self.rest_counts.iter_mut().zip(other.rest_counts) {
            *mine = (*mine).max(theirs);
        }
    }
}

/// The result of one session.
#[derive(Clone, Debug, PartialEq)]
pub struct Verdict {
    /// The first difference.
    pub difference: Option<Difference>,
    /// What was compared.
    pub figures: Figures,
    /// What happened; the latest messages of both boards where they differ.
    pub journal: Journal,
    /// Duration in virtual time, seconds.
    pub virtual_seconds: f64,
}
