//! The self-test before anything may move: encoders must stand still and switches must not chatter.

use vergence_protocol::{AxisList, FaultCode};

use crate::contact::Contact;
use crate::io::RigIo;
use crate::settings::AxisSettings;

/// Shortest duration of the test in ticks, and longest while a switch chatters.
const LEAST_TICKS: u8 = 10;
const MOST_TICKS: u8 = 200;

/// Result of one tick of the test.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Verdict {
    Running,
    Passed,
    Failed { code: FaultCode, axis: Option<usize>, detail: i32 },
}

/// A self-test under way.
#[derive(Clone, Debug, Default)]
pub struct SelfTest {
    ticks: u8,
    home: AxisList<Contact>,
    emergency_stop: Contact,
    encoders: AxisList<i32>,
    passed: bool,
}

impl SelfTest {
    /// Runs one tick of the test; the drivers are off.
    pub fn poll<'a>(&mut self, axes: impl Iterator<Item = &'a AxisSettings> + Clone, io: &impl RigIo) -> Verdict {
        let counts: AxisList<i32> = (0..axes.clone().count()).map(|axis| io.encoder(axis)).collect();
        if self.encoders.is_empty() {
            self.encoders = counts.clone();
            self.home = counts.iter().map(|_| Contact::default()).collect();
        }
        for (index, ((axis, now), before)) in axes.zip(&counts).zip(&self.encoders).enumerate() {
            // An absolute encoder counts from zero until it has answered.
            if axis.feedback.is_absolute() {
                continue;
            }
            // A hand moves a stage less far in a tick than its motor would.
            let jump = axis.encoder().position_at(now.wrapping_sub(*before)).0;
            if jump.unsigned_abs() > axis.largest_jump() {
                return Verdict::Failed { code: FaultCode::EncoderLost, axis: Some(index), detail: jump };
            }
        }
        self.encoders = counts;
        for (index, contact) in self.home.iter_mut().enumerate() {
            contact.read(io.home_switch(index), vergence_protocol::Counts(0));
        }
        self.emergency_stop.read(io.emergency_stop(), vergence_protocol::Counts(0));
        self.ticks = self.ticks.saturating_add(1);
        let verdict = self.verdict();
        self.passed = verdict == Verdict::Passed;
        verdict
    }

    /// Whether the test was passed.
    pub fn has_passed(&self) -> bool {
        self.passed
    }

    fn verdict(&self) -> Verdict {
        let unsure = self.home.iter().position(|contact| contact.is_closed().is_none());
        let sure = unsure.is_none() && self.emergency_stop.is_closed().is_some();
        match (unsure, sure) {
            _ if self.ticks < LEAST_TICKS => Verdict::Running,
            (_, true) => Verdict::Passed,
            _ if self.ticks < MOST_TICKS => Verdict::Running,
            (Some(axis), _) => Verdict::Failed { code: FaultCode::HomeSwitchStuck, axis: Some(axis), detail: 0 },
            (None, _) => Verdict::Failed { code: FaultCode::EmergencyStop, axis: None, detail: 0 },
        }
    }
}
