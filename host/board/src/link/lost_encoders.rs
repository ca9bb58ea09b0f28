//! Which axes no encoder tells, by the faults and references that the board reports.
//!
//! A board that loses an encoder cuts its drivers and forgets the references of all axes. Only the axis of the fault is in doubt: the
//! others' encoders are on their stages and go on counting from the same zero. The axis of the fault is told again as soon as the
//! fault is cleared and the axis has its reference.

use vergence_protocol::{AxisList, AxisMask, ControllerState, Counts, FaultCode, PoseReport};

/// An axis that no encoder tells.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct LostAxis {
    /// Index of the axis.
    pub axis: usize,
    /// Its last reading before the fault.
    pub last: Counts,
}

/// What the encoders tell of an instant.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Told {
    /// Where every axis was.
    All,
    /// Where every axis was but these. All of them stood.
    AllBut(Vec<LostAxis>),
    /// Nothing: an axis that no encoder tells moved, or the zeros of the readings changed.
    Nothing,
}

/// The axes that no encoder tells.
#[derive(Clone, Debug, Default)]
pub(super) struct LostEncoders {
    lost: Vec<LostAxis>,
    /// Number of the latest fault that was seen.
    fault: Option<u16>,
    /// The latest readings.
    counts: AxisList<Counts>,
    /// Axes that ever had a reference.
    referenced: AxisMask,
    /// Nothing is told of instants up to this, in microseconds of the board's clock.
    untold_until: u64,
    /// Nothing is told before every axis has its reference.
    awaits_reference: bool,
}

impl LostEncoders {
    /// Of a board that may have restarted: readings without a reference tell nothing.
    pub fn after_restart() -> Self {
        Self { awaits_reference: true, ..Self::default() }
    }

    /// Takes the next pose that the board reports.
    pub fn note(&mut self, pose: &PoseReport) {
        let before = self.lost.len();
        if let Some(fault) = pose.fault.filter(|fault| self.fault.replace(fault.seq) != Some(fault.seq))
            && let Some(axis) = fault.axis.map(usize::from)
            && doubts_encoder(fault.code, pose.referenced.contains(axis))
        {
            self.lose(axis);
        }
        if pose.fault.is_none() {
            self.lost.retain(|lost| !pose.referenced.contains(lost.axis));
        }
        self.awaits_reference &= (0..pose.counts.len()).any(|axis| !pose.referenced.contains(axis));
        let moves_untold = is_moving(pose.state) && !self.lost.is_empty();
        if self.lost.len() != before || moves_untold || self.awaits_reference {
            self.untold_until = pose.at.0;
        }
        self.counts.clone_from(&pose.counts);
        self.referenced.0 |= pose.referenced.0;
    }

    /// An axis that never had a reference was never told.
    fn lose(&mut self, axis: usize) {
        let is_known = self.referenced.contains(axis) && !self.lost.iter().any(|lost| lost.axis == axis);
        if let Some(&last) = self.counts.get(axis).filter(|_| is_known) {
            self.lost.push(LostAxis { axis, last });
        }
    }

    /// What the encoders tell of an instant in microseconds of the board's clock.
    pub fn told_at(&self, us: f64) -> Told {
        match &self.lost[..] {
            _ if self.awaits_reference || us <= self.untold_until as f64 => Told::Nothing,
            [] => Told::All,
            lost => Told::AllBut(lost.to_vec()),
        }
    }

    /// The axes that no encoder tells now.
    pub fn lost(&self) -> &[LostAxis] {
        &self.lost
    }
}

/// Whether the board moves axes in this state.
pub(super) const fn is_moving(state: ControllerState) -> bool {
    matches!(state, ControllerState::Homing | ControllerState::Moving | ControllerState::Stopping)
}

/// Whether after this fault the encoder of its axis may tell less than before. `keeps_reference`: a joint keeps it, because its servo
/// knows its angle; a stage loses it where motor and encoder disagree, and nobody knows which of them is right.
const fn doubts_encoder(code: FaultCode, keeps_reference: bool) -> bool {
    match code {
        FaultCode::EncoderLost
        | FaultCode::EncoderGarbled
        | FaultCode::EncoderMagnet
        | FaultCode::EncoderDrift
        | FaultCode::IndexMissing => true,
        FaultCode::Stall
        | FaultCode::Slip
        | FaultCode::FollowingError
        | FaultCode::NotSettled
        | FaultCode::WrongDirection => !keeps_reference,
        // The servo of a joint is its encoder too.
        FaultCode::DriverSilent | FaultCode::DriverGarbled | FaultCode::JointWrongId => keeps_reference,
        _ => false,
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::expect_used, reason = "a test may fail")]

    use vergence_protocol::{FaultRecord, Microseconds, Mode, MoveId, MovePhase};

    use super::*;

    /// A pose at `ms` with both axes at `counts`.
    fn pose(ms: u64, counts: [i32; 2], referenced: u8, state: ControllerState) -> PoseReport {
        PoseReport {
            at: Microseconds(ms * 1000),
            seq: 0,
            counts: counts.into_iter().map(Counts).collect(),
            referenced: AxisMask(referenced),
            state,
            mode: Mode(0),
            move_id: MoveId(0),
            phase: MovePhase::None,
            fault: None,
        }
    }

    fn fault(code: FaultCode, seq: u16, axis: Option<u8>) -> Option<FaultRecord> {
        Some(FaultRecord { code, seq, at: Microseconds(0), axis, detail: 0, later: 0 })
    }

    #[test]
    fn only_the_axis_of_the_fault_is_lost_until_it_has_its_reference_again() {
        let mut encoders = LostEncoders::default();
        encoders.note(&pose(1, [100, 200], 3, ControllerState::Moving));
        assert_eq!(encoders.told_at(1500.0), Told::All);
        let latched = fault(FaultCode::EncoderLost, 1, Some(1));
        encoders.note(&PoseReport { fault: latched, ..pose(2, [101, 0], 0, ControllerState::Fault) });
        assert_eq!(encoders.told_at(2000.0), Told::Nothing, "the axis moved until the fault");
        let lost = vec![LostAxis { axis: 1, last: Counts(200) }];
        assert_eq!(encoders.told_at(2001.0), Told::AllBut(lost.clone()));
        // Cleared, but not homed.
        encoders.note(&pose(3, [101, 0], 0, ControllerState::Idle));
        assert_eq!(encoders.told_at(3000.0), Told::AllBut(lost));
        encoders.note(&pose(4, [50, 0], 0, ControllerState::Homing));
        assert_eq!(encoders.told_at(3500.0), Told::Nothing);
        encoders.note(&pose(5, [0, 0], 3, ControllerState::Ready));
        assert_eq!((encoders.told_at(5000.0), encoders.told_at(5001.0)), (Told::Nothing, Told::All));
    }

    #[test]
    fn a_board_that_may_have_restarted_tells_nothing_before_it_has_its_references() {
        let mut encoders = LostEncoders::after_restart();
        assert_eq!(encoders.told_at(0.0), Told::Nothing);
        encoders.note(&pose(1, [5, 7], 1, ControllerState::Idle));
        assert_eq!(encoders.told_at(2000.0), Told::Nothing);
        encoders.note(&pose(2, [100, 200], 3, ControllerState::Ready));
        assert_eq!((encoders.told_at(1000.0), encoders.told_at(1500.0)), (Told::Nothing, Told::All));
    }

    #[test]
    fn a_fault_that_says_nothing_of_an_encoder_leaves_it_trusted() {
        let faults = [
            (FaultCode::EmergencyStop, None, 0),
            (FaultCode::HardLimit, Some(1), 0),
            (FaultCode::Stall, Some(1), 3),
            (FaultCode::DriverSilent, Some(1), 0),
        ];
        for (code, axis, referenced) in faults {
            let mut encoders = LostEncoders::default();
            encoders.note(&pose(1, [100, 200], 3, ControllerState::Ready));
            let latched =
                PoseReport { fault: fault(code, 1, axis), ..pose(2, [100, 200], referenced, ControllerState::Fault) };
            encoders.note(&latched);
            assert_eq!(encoders.told_at(2500.0), Told::All, "{code:?}");
        }
    }
}
