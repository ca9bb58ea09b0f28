//! What several verbs say of a board.

use serde_json::{Map, Value, json};
use vergence_board::{Board, describe_fault, describe_pose, positions};
use vergence_protocol::{Happening, PoseReport};
use vergence_rig::{AxisPosition, Rig};
use vergence_vision::Zones;

use crate::console::Console;
use crate::failure::Failure;

/// Rounded for people and programs alike: a tenth of a micrometre or of a thousandth degree is below every encoder.
#[must_use]
pub fn rounded(value: f64) -> f64 {
    (value * 1e4).round() / 1e4
}

/// Axis positions as `{"baseline_mm": ..., "separation_deg": ...}`.
#[must_use]
pub fn axes_json(rig: &Rig, positions: &[AxisPosition]) -> Value {
    let entries = rig.axes.iter().zip(positions).map(|(axis, position)| match position {
        AxisPosition::Linear(length) => (format!("{}_mm", axis.name), json!(rounded(length.mm()))),
        AxisPosition::Rotary(angle) => (format!("{}_deg", axis.name), json!(rounded(angle.deg()))),
    });
    Value::Object(entries.collect::<Map<_, _>>())
}

/// Zones in degrees; an angle that is not a number becomes null.
#[must_use]
pub fn zones_json(zones: &Zones) -> Value {
    json!({
        "stereo": rounded(zones.stereo.deg()),
        "mono": rounded(zones.mono.deg()),
        "blind": rounded(zones.blind.deg()),
    })
}

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

/// Says where the board is now.
///
/// # Errors
/// Where standard output cannot be written.
pub fn say_pose(console: Console, rig: &Rig, pose: &PoseReport) -> Result<(), Failure> {
    console.say(describe_pose(rig, pose))?;
    if let Some(fault) = pose.fault {
        console.say(format!("  {}", describe_fault(rig, &fault)))?;
    }
    console.result(&pose_json(rig, pose))
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
            format!("{}: {}", name(index), vergence_protocol::switch_text(home, operated))
        }
        Happening::Encoder { axis: index, counts } => match axis(index) {
            Some(axis) => format!("{} was at {} by its encoder", axis.name, axis.position_at(counts)),
            None => what.to_string(),
        },
        _ => what.to_string(),
    }
}
