//! `vergence doctor`: what is well, what is not, and what to do.

use std::path::PathBuf;
use std::sync::Arc;
use std::time::Duration;

use serde_json::json;
use vergence_board::{BoardChecks, Finding, Verdict, check_board, check_port};
use vergence_doctor::{
    HostTimes, MEND_RIG, Running, check_cameras, check_fit, check_machine, check_models, check_rig_file, check_test,
    host_times,
};
use vergence_rig::Rig;

use super::camera_test::{tell, test};
use super::connect::{connect, is_wire, port};
use super::mask_options::MaskOptions;
use super::model_options::StoreOptions;
use super::options::active_rig;
use super::taking_options::TakingOptions;
use crate::cli::CommonOptions;
use crate::console::Console;
use crate::failure::{Failure, FailureKind};
use crate::rig_file;
use crate::stopwatch::clock as stopwatch;

/// How long cameras are tested.
const LOOK: Duration = Duration::from_secs(2);

/// Checks rig file and age of the calibration, ports, permissions, cameras, networks for matching, disk, the host's clock, and the board with its link,
/// clock, state and settings. With --cameras it takes images too: it tests the cameras as `vergence camera test` does, and whether the calibration fits
/// what they see. Moves nothing. Each line passes, warns or fails, with the reason and a remedy. Exit code 1 when one fails.
#[derive(Debug, clap::Args)]
pub struct Args {
    /// Take images with these cameras, left and right: /dev/video0 /dev/video2; two folders of images or Y4M videos; or `sim` on a simulated rig.
    #[arg(long, num_args = 1..=2, value_name = "DEVICE")]
    cameras: Vec<String>,
    /// The folder of recordings, whose disk is checked.
    #[arg(long, value_name = "DIR", default_value = ".")]
    out: PathBuf,
    #[command(flatten)]
    models: StoreOptions,
    #[command(flatten)]
    taking: TakingOptions,
}

pub async fn run(args: &Args, common: &CommonOptions, console: Console) -> Result<(), Failure> {
    let before = host_times();
    let (path, mut findings, rig) = check_rig(common, before);
    let common = &CommonOptions { rig: path, ..common.clone() };
    findings.extend(check_cameras());
    // A pair without axes needs no board.
    if common.port.is_some() || rig.is_none_or(|rig| !rig.axes.is_empty()) {
        let port = match port(common) {
            Ok(port) => check_port(&port),
            Err(failure) => {
                Finding::fail("port", failure.to_string(), "see 'vergence devices' for the ports there are")
            }
        };
        let reachable = port.verdict != Verdict::Fail;
        findings.push(port);
        if reachable {
            findings.extend(examine(common, console).await);
        }
    }
    let mut mb_per_s = None;
    if !args.cameras.is_empty() {
        let failed =
            |failure: Failure| (vec![Finding::fail("images", failure.to_string(), "see 'vergence devices'")], None);
        let (seen, sent) = look(args, common, console).await.unwrap_or_else(failed);
        findings.extend(seen);
        mb_per_s = sent;
    }
    findings.extend(check_models(args.models.store().map_err(|failure| failure.to_string())));
    findings.extend(check_machine(&findings, (&args.out, mb_per_s), before));
    tell(&findings, json!({}), console)
}

/// The rig that verbs would use: the file named, the active calibration, or the built-in bench.
fn check_rig(common: &CommonOptions, now: HostTimes) -> (Option<PathBuf>, Vec<Finding>, Option<Rig>) {
    let (path, is_active) = match (&common.rig, active_rig()) {
        (Some(path), _) => (Some(path.clone()), false),
        (None, Ok(active)) => (active, true),
        (None, Err(failure)) => return (None, vec![Finding::fail("rig", failure.to_string(), MEND_RIG)], None),
    };
    let rig = rig_file::load(path.as_deref()).and_then(|rig| MaskOptions::default().read(&rig).map(|_| rig));
    let findings = match &rig {
        Ok(rig) => check_rig_file(rig, path.as_deref().map(|path| (path, is_active)), now),
        Err(failure) => vec![Finding::fail("rig", failure.to_string(), MEND_RIG)],
    };
    (path, findings, rig.ok())
}

/// What the cameras send, and whether the calibration fits it; beside it how many megabytes per second both send.
async fn look(args: &Args, common: &CommonOptions, console: Console) -> Result<(Vec<Finding>, Option<f64>), Failure> {
    let (mut rig, ()) = args.taking.connect(&args.cameras, common, None, console, |_| Ok(())).await?;
    let (mut events, mut marks) = (args.taking.start_cameras(&args.cameras, &rig, console)?, rig.take_marks());
    let seen = test(&args.cameras, &mut rig, (&mut events, marks.as_mut()), LOOK).await?;
    let mut findings = check_test(&seen);
    let running = Running {
        rig: Arc::new(rig.known),
        timing: seen.timing,
        events,
        marks,
        board: rig.board.as_ref(),
        trigger: rig.trigger,
        clock: (rig.clock, rig.period_us),
        stopwatch,
    };
    findings.push(check_fit(running).await);
    Ok((findings, seen.cameras.iter().map(|camera| camera.mb_per_s()).sum()))
}

async fn examine(common: &CommonOptions, console: Console) -> Vec<Finding> {
    let checks = BoardChecks {
        lease_ms: common.lease,
        line_baud: is_wire(common).then_some(common.baud),
        unreachable: |error| unreachable(&error.into()),
    };
    match connect(common, console, "examining the board").await {
        Ok(mut board) => {
            let findings = check_board(&mut board, checks).await;
            board.close().await;
            findings
        }
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
