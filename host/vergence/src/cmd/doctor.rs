//! `vergence doctor`: what is well, what is not, and what to do.

use std::path::PathBuf;

use serde_json::json;
use vergence_board::{BoardChecks, Finding, Verdict, check_board, check_cameras, check_port};

use super::connect::{connect, is_wire, port};
use super::mask_options::MaskOptions;
use super::options::active_rig;
use crate::cli::CommonOptions;
use crate::console::Console;
use crate::failure::{Failure, FailureKind};
use crate::rig_file;

/// Checks rig file, ports, permissions, cameras, and the board with its link, clock, state and settings. Moves nothing.
/// Each line passes, warns or fails, with the reason and a remedy. Exit code 1 when one fails.
#[derive(Debug, clap::Args)]
pub struct Args {}

pub async fn run(_: &Args, common: &CommonOptions, console: Console) -> Result<(), Failure> {
    let (rig, rig_finding) = check_rig(common);
    let common = &CommonOptions { rig, ..common.clone() };
    let mut findings = vec![rig_finding];
    findings.extend(check_cameras());
    let port = match port(common) {
        Ok(port) => check_port(&port),
        Err(failure) => Finding::fail("port", failure.to_string(), "see 'vergence devices' for the ports there are"),
    };
    let reachable = port.verdict != Verdict::Fail;
    findings.push(port);
    if reachable {
        findings.extend(examine(common, console).await);
    }
    for Finding { check, verdict, reason, remedy } in &findings {
        console.say(format!("{}  {check:<9} {reason}", verdict.name()))?;
        if let Some(remedy) = remedy {
            console.say(format!("                -> {remedy}"))?;
        }
    }
    let [passed, warned, failed] =
        Verdict::ALL.map(|verdict| findings.iter().filter(|finding| finding.verdict == verdict).count());
    console.say(format!("{passed} passed, {warned} warned, {failed} failed"))?;
    console.result(&json!({
        "checks": findings.iter().map(Finding::json).collect::<Vec<_>>(),
        "passed": passed, "warned": warned, "failed": failed,
    }))?;
    if failed > 0 {
        return Err(Failure::check(format!("{failed} of {} checks failed", findings.len())));
    }
    Ok(())
}

/// The rig that verbs would use: the file named, the active calibration, or the built-in bench.
fn check_rig(common: &CommonOptions) -> (Option<PathBuf>, Finding) {
    const MEND: &str = "mend the file, which docs/rig-file.md describes, or 'vergence calibrate rollback'";
    let (path, is_active) = match (&common.rig, active_rig()) {
        (Some(path), _) => (Some(path.clone()), false),
        (None, Ok(active)) => (active, true),
        (None, Err(failure)) => return (None, Finding::fail("rig", failure.to_string(), MEND)),
    };
    let rig = rig_file::load(path.as_deref()).and_then(|rig| MaskOptions::default().read(&rig).map(|_| rig));
    let finding = match (rig, &path) {
        (Err(failure), _) => Finding::fail("rig", failure.to_string(), MEND),
        (Ok(rig), Some(path)) => {
            let active = if is_active { "the active calibration, " } else { "" };
            Finding::pass("rig", format!("'{}' from {active}{}", rig.name, path.display()))
        }
        (Ok(rig), None) => Finding::warn(
            "rig",
            format!("the built-in '{}', which is nobody's real rig; no calibration is active", rig.name),
            "calibrate, or name your rig file with --rig or VERGENCE_RIG",
        ),
    };
    (path, finding)
}

async fn examine(common: &CommonOptions, console: Console) -> Vec<Finding> {
    let checks = BoardChecks {
        lease_ms: common.lease,
        line_baud: is_wire(common).then_some(common.baud),
        unreachable: |error| unreachable(&error.into()),
    };
    match connect(common, console, "examining the board").await {
        Ok(mut board) => check_board(&mut board, checks).await,
        Err(failure) => vec![unreachable(&failure)],
    }
}

fn unreachable(failure: &Failure) -> Finding {
    match failure.kind() {
        FailureKind::Protocol => {
            Finding::fail("versions", failure.to_string(), "use the vergence and the firmware of one release")
        }
        FailureKind::Usage => Finding::fail("rig", failure.to_string(), "the rig file must describe this board"),
        _ => Finding::fail("link", failure.to_string(), "check cable, power, --baud and who else uses the port"),
    }
}
