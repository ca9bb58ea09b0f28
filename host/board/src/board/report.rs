//! Pose and clock of a board for reports: as JSON, and the clock in words.

use serde_json::{Value, json};
use vergence_protocol::{PoseReport, TriggerMark};
use vergence_rig::{AxisPosition, Rig, axes_json, rounded};

use super::Board;
use super::words::{describe_fault, describe_pose, positions};

/// A pose for programs.
#[must_use]
pub fn pose_json(rig: &Rig, pose: &PoseReport) -> Value {
    let referenced: Vec<bool> = (0..rig.axes.len()).map(|axis| pose.referenced.contains(axis)).collect();
    let fault = pose.fault.map(|fault| {
        json!({
            "code": format!("{:?}", fault.code),
            "text": describe_fault(rig, &fault),
            "seq": fault.seq,
            "board_us": fault.at.0,
            "axis": fault.axis.and_then(|axis| rig.axes.get(usize::from(axis))).map(|axis| &axis.name),
            "detail": fault.detail,
            "later": fault.later,
        })
    });
    json!({
        "board_us": pose.at.0,
        "state": pose.state.to_string(),
        "mode": rig.reported_mode(pose).map(|mode| mode.to_string()),
        "axes": axes_json(rig, &positions(rig, pose)),
        "referenced": referenced,
        "fault": fault,
    })
}

/// How well the board's clock is known, in words.
#[must_use]
pub fn describe_clock(board: &Board) -> String {
    let map = board.client().clock_map();
    match (map.board_at(board.client().clock().now()), map.drift()) {
        _ if map.is_lost() => "clock lost: the board does not answer its probes".into(),
        (Some(now), Some(drift)) => {
            format!("clock within {:.0} us, drift {:+.1} \u{b1} {:.1} ppm", now.error_us, drift.ppm, drift.error_ppm)
        }
        _ => "clock not compared yet".into(),
    }
}

/// How well the board's clock is known. The bound holds with 95 %; sigma is that of an error anywhere within it.
#[must_use]
pub fn clock_json(board: &Board) -> Value {
    let map = board.client().clock_map();
    let error = map.board_at(board.client().clock().now()).map(|now| now.error_us);
    json!({
        "error_us": error.map(rounded),
        "sigma_us": error.map(|error| rounded(error / 3f64.sqrt())),
        "drift_ppm": map.drift().map(|drift| rounded(drift.ppm)),
        "lost": map.is_lost(),
    })
}

/// A pose that is printed as it comes, as a line for people.
#[must_use]
pub fn pose_line(rig: &Rig, pose: &PoseReport) -> String {
    let fault = pose.fault.map(|fault| format!("  {}", describe_fault(rig, &fault))).unwrap_or_default();
    format!("{:10.3} s  {}{fault}", pose.at.0 as f64 * 1e-6, describe_pose(rig, pose))
}

/// The latest pose for programs, with its time on both clocks, and what the link lost.
#[must_use]
pub fn pose_with_times_json(board: &Board) -> Value {
    let mut line = pose_json(board.rig(), board.pose());
    line["host_us"] = board.pose_on_host_clock().map(|host| host.us.round()).into();
    line["clock"] = clock_json(board);
    line["poses_lost"] = board.client().statistics().poses_lost.into();
    line
}

fn positions_at(rig: &Rig, mark: &TriggerMark) -> Vec<AxisPosition> {
    rig.axes.iter().zip(&mark.counts).map(|(axis, &counts)| axis.position_at(counts)).collect()
}

/// A pulse of the camera trigger and where the axes were, as a line for people.
#[must_use]
pub fn mark_line(rig: &Rig, mark: &TriggerMark) -> String {
    let positions = positions_at(rig, mark);
    let axes = rig.axes.iter().zip(&positions).map(|(axis, position)| format!("{} {position}", axis.name));
    format!("pulse {:5}  {:12.6} s  {}", mark.seq, mark.at.0 as f64 * 1e-6, axes.collect::<Vec<_>>().join("  "))
}

/// The same for programs, with its time on both clocks.
#[must_use]
pub fn mark_json(board: &Board, mark: &TriggerMark) -> Value {
    let (rig, host) = (board.rig(), board.client().clock_map().host_at(mark.at));
    json!({
        "seq": mark.seq,
        "board_us": mark.at.0,
        "host_us": host.map(|host| rounded(host.us)),
        "host_error_us": host.map(|host| rounded(host.error_us)),
        "axes": axes_json(rig, &positions_at(rig, mark)),
    })
}
