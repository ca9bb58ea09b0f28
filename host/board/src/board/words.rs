//! Poses, faults and events as sentences, and positions checked against the rig's ranges.

use vergence_protocol::{AxisKind, FaultRecord, Happening, PoseReport, switch_text};
use vergence_rig::{AxisPosition, Rig, RigAxis};
use vergence_vision::{Angle, Length};

use crate::error::BoardError;

/// Position of each axis of `rig` in `pose`.
#[must_use]
pub fn positions(rig: &Rig, pose: &PoseReport) -> Vec<AxisPosition> {
    rig.axes.iter().zip(&pose.counts).map(|(axis, &counts)| axis.position_at(counts)).collect()
}

/// The target that keeps `axis` where it stands: `present`, or the end of the range where the axis rests within 0.05 mm or
/// 0.05 degrees beyond it. Encoder and play show an axis a little off where the board sent it.
#[must_use]
pub fn staying(axis: &RigAxis, present: AxisPosition) -> AxisPosition {
    let hair = match axis.kind {
        AxisKind::Linear => AxisPosition::Linear(Length::from_mm(0.05)),
        AxisKind::Rotary => AxisPosition::Rotary(Angle::from_deg(0.05)),
    };
    let nearest = |end: &AxisPosition| (present.value() - end.value()).abs() < hair.value();
    match axis.range.into_iter().find(nearest) {
        Some(end) if !axis.contains(present) => end,
        _ => present,
    }
}

/// Checks targets against the ranges of the rig, before anything is sent.
///
/// # Errors
/// [`BoardError::OutOfRange`] with axis, target and range.
pub fn check_range(rig: &Rig, targets: &[AxisPosition]) -> Result<(), BoardError> {
    for (axis, &target) in rig.axes.iter().zip(targets) {
        if !axis.contains(target) {
            return Err(BoardError::OutOfRange { axis: axis.name.clone(), target, range: axis.range });
        }
    }
    Ok(())
}

/// A pose as one line: state, mode, and the position of each axis.
#[must_use]
pub fn describe_pose(rig: &Rig, pose: &PoseReport) -> String {
    let axes = rig.axes.iter().zip(positions(rig, pose)).enumerate().map(|(index, (axis, position))| {
        let reference = if pose.referenced.contains(index) { "" } else { " (no reference)" };
        format!("{} {position}{reference}", axis.name)
    });
    let mode = rig.reported_mode(pose).map(|mode| format!(" [{mode}]")).unwrap_or_default();
    format!("{}{mode}  {}", pose.state, axes.collect::<Vec<_>>().join("  "))
}

/// A fault as a sentence with its remedy.
#[must_use]
pub fn describe_fault(rig: &Rig, fault: &FaultRecord) -> String {
    let axis = fault.axis.and_then(|index| rig.axes.get(usize::from(index)));
    let axis = axis.map(|axis| format!(" on axis '{}'", axis.name)).unwrap_or_default();
    format!("{}{axis}; {}", fault.code, fault.code.remedy())
}

/// An event of the flight recorder in words, with the rig's names and units.
#[must_use]
pub fn event_in_words(rig: &Rig, what: &Happening) -> String {
    let axis = |index: u8| rig.axes.get(usize::from(index));
    let name = |index: u8| axis(index).map_or_else(|| format!("axis {index}"), |axis| axis.name.clone());
    match *what {
        Happening::Fault { code, axis: Some(index), .. } => format!("FAULT on {}: {code}", name(index)),
        Happening::Fault { code, axis: None, .. } => format!("FAULT: {code}"),
        Happening::Switch { axis: index, home, operated } => {
            format!("{}: {}", name(index), switch_text(home, operated))
        }
        Happening::Encoder { axis: index, counts } => match axis(index) {
            Some(axis) => format!("{} was at {} by its encoder", axis.name, axis.position_at(counts)),
            None => what.to_string(),
        },
        _ => what.to_string(),
    }
}
