//! What the board says of itself, and how well it can be heard.

use std::time::Duration;

use vergence_protocol::{
    Compatibility, ControllerState, DriverState, EncoderState, ResetCause, SettingItem, SettingKey,
};
use vergence_rig::AxisPosition;

use super::Finding;
use crate::board::{Board, describe_clock, describe_fault};
use crate::error::BoardError;
use crate::link_figures::LinkFigures;

/// Time in which the clocks are compared ten times.
const LISTEN: Duration = Duration::from_secs(2);
/// Largest error of the clock that pairs images with the right poses: at 60°/s it makes 0.06°.
const CLOCK_ERROR_US: f64 = 1_000.0;
/// Largest drift of a quartz clock.
const DRIFT_PPM: f64 = 200.0;

/// What the checks of a board must know of the command.
#[derive(Clone, Copy, Debug)]
pub struct BoardChecks {
    /// How long the board may go without a heartbeat, in milliseconds.
    pub lease_ms: u16,
    /// Speed of the line in bits per second; `None` where bytes take no time.
    pub line_baud: Option<u32>,
    /// Says what is wrong where the board can no longer be reached.
    pub unreachable: fn(BoardError) -> Finding,
}

/// Checks the board with its link, clock, state and settings; listens for two seconds, and moves nothing.
pub async fn check_board(board: &mut Board, checks: BoardChecks) -> Vec<Finding> {
    let mut findings = vec![versions(board), reset(board)];
    match LinkFigures::measure(board, LISTEN).await {
        Ok(figures) => findings.push(link(&figures, checks.lease_ms)),
        Err(error) => findings.push((checks.unreachable)(error)),
    }
    findings.extend([clock(board), state(board), reference(board)]);
    findings.extend(limits(board));
    findings.push(settings(board, checks.line_baud).await);
    findings.extend(switches(board).await);
    findings.extend(drivers(board).await);
    findings.extend(encoders(board).await);
    findings.push(key(board).await);
    findings
}

/// Checks how the board understands its switches.
async fn switches(board: &Board) -> Vec<Finding> {
    // Where the link fails, other checks say so.
    let aside = board.homes_aside().await.unwrap_or_default().into_iter().map(|axis| {
        let reason = format!("'home_switch_at' of {axis} lies at the other end of its range than 'home_end' says");
        let remedy = format!("'vergence config set {axis}.home_end', or '{axis}.home_switch_at'");
        Finding::fail("switches", reason, remedy)
    });
    let open = board.open_limits().await.unwrap_or_default().into_iter().map(|axis| {
        let reason = format!("the hard limit switches of {axis} are normally open: a broken wire goes unnoticed");
        let remedy =
            format!("use normally closed switches, then 'vergence config set {axis}.hard_limit normally_closed'");
        Finding::warn("switches", reason, remedy)
    });
    aside.chain(open).collect()
}

/// Checks the motor drivers that tell how they are.
async fn drivers(board: &Board) -> Vec<Finding> {
    // Where the link fails, other checks say so.
    let drivers = board.drivers().await.unwrap_or_default();
    let judged = drivers.into_iter().map(|(axis, state)| {
        let reason = format!("the motor driver of {axis} is {state}");
        match state {
            DriverState::Failed(code) => {
                Finding::fail("drivers", format!("the motor driver of {axis} cannot be used: {code}"), code.remedy())
            }
            DriverState::Hot => {
                Finding::warn("drivers", reason, "lower its 'run_current' or 'hold_current', or cool it")
            }
            DriverState::Starting => Finding::warn("drivers", reason, "try again in a second"),
            _ => Finding::pass("drivers", reason),
        }
    });
    judged.collect()
}

/// Checks the encoders that tell more than a count.
async fn encoders(board: &Board) -> Vec<Finding> {
    // Where the link fails, other checks say so.
    let encoders = board.encoders().await.unwrap_or_default();
    let judged = encoders.into_iter().map(|(axis, state)| {
        let reason = format!("the encoder of {axis}: {state}");
        match state {
            EncoderState::Failed(code) => Finding::fail("encoders", reason, code.remedy()),
            EncoderState::Starting => Finding::warn("encoders", reason, "try again in a second"),
            _ => Finding::pass("encoders", reason),
        }
    });
    judged.collect()
}

fn versions(board: &Board) -> Finding {
    let info = board.info();
    let firmware = info.firmware.map(|part| part.to_string()).join(".");
    let ours = env!("CARGO_PKG_VERSION");
    let both = format!("{} has firmware {firmware}, this is vergence {ours}", info.board);
    match board.client().compatibility() {
        Compatibility::Full if firmware == ours => Finding::pass("versions", both),
        Compatibility::Full => {
            Finding::warn("versions", format!("{both}; they understand each other"), "update the older of the two")
        }
        _ => Finding::fail(
            "versions",
            format!("{both}, and their messages differ: the board can be read but not moved"),
            "use the vergence and the firmware of one release",
        ),
    }
}

fn reset(board: &Board) -> Finding {
    match board.info().reset {
        ResetCause::Watchdog => Finding::warn(
            "start",
            "the watchdog restarted the board: its firmware hung",
            "see 'vergence status --why', and report it with what you were doing",
        ),
        cause => Finding::pass("start", format!("the board was last started by {}", describe_reset(cause))),
    }
}

/// Reason for the board's last start, in words.
fn describe_reset(cause: ResetCause) -> &'static str {
    match cause {
        ResetCause::PowerOn => "switching it on",
        ResetCause::Pin => "its reset button or pin",
        ResetCause::Software => "its own firmware, on request",
        ResetCause::Watchdog => "its watchdog",
        _ => "a cause this program does not know",
    }
}

fn link(figures: &LinkFigures, lease_ms: u16) -> Finding {
    let milliseconds = |share| figures.percentile(share).unwrap_or(f64::INFINITY);
    let (median, slow) = (milliseconds(0.5), milliseconds(0.99));
    let dropped = figures.host.link.dropped() + figures.board.map_or(0, |board| board.link.dropped());
    let summary = format!("answers take {median:.2} ms, 99 % of them {slow:.2} ms at most");
    let remedy = "shorten the cable, try a slower --baud, and see 'vergence link-test'";
    if figures.unanswered > 0 || figures.host.poses_lost > 0 {
        let lost = format!("{} requests and {} poses were lost", figures.unanswered, figures.host.poses_lost);
        return Finding::fail("link", lost, remedy);
    }
    if dropped > 0 {
        return Finding::warn("link", format!("{summary}; {dropped} frames arrived damaged"), remedy);
    }
    // Five heartbeats to a lease.
    if slow > f64::from(lease_ms) / 5.0 {
        let reason = format!("{summary}: slow for a lease of {lease_ms} ms");
        return Finding::warn(
            "link",
            reason,
            "set the latency timer of the USB bridge to 1 ms, or use a longer --lease",
        );
    }
    Finding::pass("link", format!("{summary}; nothing was lost"))
}

fn clock(board: &Board) -> Finding {
    let reason = describe_clock(board);
    let map = board.client().clock_map();
    let now = map.board_at(board.client().clock().now());
    match (now, map.drift()) {
        _ if map.is_lost() => Finding::fail("clock", reason, "check the link: poses cannot be paired with images"),
        (Some(now), Some(drift)) if now.error_us < CLOCK_ERROR_US && drift.ppm.abs() < DRIFT_PPM => {
            Finding::pass("clock", reason)
        }
        _ => {
            Finding::warn("clock", reason, "let it run for some seconds; set the latency timer of a USB bridge to 1 ms")
        }
    }
}

fn state(board: &Board) -> Finding {
    let pose = board.pose();
    match (pose.state, pose.fault) {
        (_, Some(fault)) => Finding::fail("state", fault.code.to_string(), describe_fault(board.rig(), &fault)),
        (ControllerState::Idle, None) => Finding::pass("state", "idle, without fault"),
        (ControllerState::Updating | ControllerState::Trial, None) => {
            Finding::warn("state", pose.state.to_string(), "finish the update: nothing moves until then")
        }
        (state, None) => Finding::pass("state", format!("{state}: another program uses the board")),
    }
}

fn reference(board: &Board) -> Finding {
    if board.is_referenced() {
        return Finding::pass("reference", "all axes know where they are");
    }
    Finding::warn("reference", "axes do not know where they are", "vergence home")
}

/// Checks that the board grants the range of the rig file.
fn limits(board: &Board) -> Vec<Finding> {
    let axes = board.rig().axes.iter().zip(board.axes());
    axes.map(|(axis, info)| {
        let [low, high] = axis.range;
        let [min, max] = [info.min, info.max].map(|end| AxisPosition::from_micro(axis.kind, end));
        let name = &axis.name;
        // A reversed encoder reads its lowest at the upper end.
        let [one, other] = [low, high].map(|end| axis.wire_position(end));
        if one.min(other) < info.min || one.max(other) > info.max {
            return Finding::fail(
                "limits",
                format!("the rig file lets {name} go from {low} to {high}, the board from {min} to {max}"),
                format!("narrow the range in the rig file, or 'vergence config set {name}.min' and '{name}.max'"),
            );
        }
        Finding::pass("limits", format!("{name} goes from {low} to {high}, which the board grants"))
    })
    .collect()
}

/// Checks whose firmware images the board takes.
async fn key(board: &Board) -> Finding {
    match board.trusted_key().await {
        Ok(Some(key)) if key.is_development() => Finding::warn(
            "key",
            "the board takes firmware of the development key: anybody can sign for it",
            "build boot loader and application with a key of your own: docs/flashing.md",
        ),
        Ok(Some(key)) => Finding::pass("key", format!("the board takes firmware of {}", key.describe())),
        Ok(None) => Finding::warn("key", "this firmware does not say whose images it takes", "update the firmware"),
        Err(error) => Finding::fail("key", error.to_string(), "check the link"),
    }
}

/// Checks that the settings can be read, and that the saved line speed is the one in use.
async fn settings(board: &Board, line_baud: Option<u32>) -> Finding {
    let read = async |item| board.setting(SettingKey { item, axis: 0 }).await;
    match (read(SettingItem::Baud).await, read(SettingItem::StreamPeriod).await) {
        (Ok(Some(baud)), Ok(Some(_))) if line_baud.is_some_and(|now| baud != i64::from(now)) => {
            let now = line_baud.unwrap_or_default();
            Finding::warn(
                "settings",
                format!("the board is set to {baud} baud, and was found at {now}"),
                format!("use --baud {baud}, or 'vergence config set baud {now}'"),
            )
        }
        (Ok(Some(baud)), Ok(Some(_))) => Finding::pass("settings", format!("can be read; {baud} baud")),
        (Err(error), _) | (_, Err(error)) => {
            Finding::fail("settings", error.to_string(), "check the link, or 'vergence config factory'")
        }
        _ => Finding::warn("settings", "this firmware keeps no settings", "update the firmware"),
    }
}
