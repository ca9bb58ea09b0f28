//! Poses and faults in words, and positions against the rig's ranges.

use vergence_protocol::{AxisKind, FaultRecord, PoseReport};
use vergence_rig::{AxisPosition, Rig, RigAxis};
use vergence_vision::{Angle, Length};

use crate::failure::Failure;

/// Where the axes are by `pose`.
#[must_use]
pub fn positions(rig: &Rig, pose: &PoseReport) -> Vec<AxisPosition> {
    rig.axes.iter().zip(&pose.counts).map(|(axis, &counts)| axis.position_at(counts)).collect()
}

/// Where an axis stays that is not to move: where it is, and at the end of its range where it came to rest a hair beyond.
/// The board knows where it was sent; encoder and play show it a little off.
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

/// Refuses targets outside the rig's range, before anything is sent.
///
/// # Errors
/// Names axis, target and range.
pub fn check_range(rig: &Rig, targets: &[AxisPosition]) -> Result<(), Failure> {
    for (axis, &target) in rig.axes.iter().zip(targets) {
        if !axis.contains(target) {
            let [low, high] = axis.range;
            return Err(Failure::usage(format!("{} {target} is out of range: choose {low} to {high}", axis.name)));
        }
    }
    Ok(())
}

/// A pose in one line.
#[must_use]
pub fn describe_pose(rig: &Rig, pose: &PoseReport) -> String {
    let axes = rig.axes.iter().zip(positions(rig, pose)).enumerate().map(|(index, (axis, position))| {
        let reference = if pose.referenced.contains(index) { "" } else { " (no reference)" };
        format!("{} {position}{reference}", axis.name)
    });
    let mode = rig.mode_name(pose.mode).map(|name| format!(" [{name}]")).unwrap_or_default();
    format!("{}{mode}  {}", pose.state, axes.collect::<Vec<_>>().join("  "))
}

/// A fault in a sentence with its remedy.
#[must_use]
pub fn describe_fault(rig: &Rig, fault: &FaultRecord) -> String {
    let axis = fault.axis.and_then(|index| rig.axes.get(usize::from(index)));
    let axis = axis.map(|axis| format!(" on axis '{}'", axis.name)).unwrap_or_default();
    format!("{}{axis}; {}", fault.code, fault.code.remedy())
}
