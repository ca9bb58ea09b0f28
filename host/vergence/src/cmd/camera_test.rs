//! `vergence camera test`: what both cameras of a rig send, judged.

use std::time::Duration;

use serde_json::{Value, json};
use tokio::sync::mpsc::Receiver;
use vergence_board::{Finding, Verdict, told};
use vergence_camera::{CameraEvent, UsbLink};
use vergence_doctor::{CameraTest, Taken, TestFigures, check_test, figures, test_in_words, test_json};
use vergence_protocol::TriggerMark;
use vergence_vision::Side;

use super::taking_options::{LiveRig, TakingOptions};
use crate::cli::CommonOptions;
use crate::console::Console;
use crate::failure::Failure;
use crate::interrupt::interrupted;

/// Takes images with both cameras for a while, and judges what comes: lost images, rate and jitter, exposure and sharpness inside the lens's field,
/// bandwidth of the USB bus, the time from the trigger's pulse to exposure and arrival, and how well both images of a pair agree in time.
///
/// The board fires the cameras (--rate), or nothing does (--free). Nothing moves. Each line passes, warns or fails, with the reason and a remedy. Exit
/// code 1 when one fails.
#[derive(Debug, clap::Args)]
pub struct Args {
    /// The left and the right camera, such as /dev/video0 /dev/video2; two folders of images or Y4M videos; or `sim` on a simulated rig.
    #[arg(long, num_args = 1..=2, required = true, value_name = "DEVICE")]
    cameras: Vec<String>,
    /// How long images are taken.
    #[arg(long = "for", value_name = "TIME", default_value = "3s", value_parser = humantime::parse_duration)]
    duration: Duration,
    #[command(flatten)]
    taking: TakingOptions,
}

pub async fn judge(args: &Args, common: &CommonOptions, console: Console) -> Result<(), Failure> {
    let (mut rig, ()) = args.taking.connect(&args.cameras, common, None, console, |_| Ok(())).await?;
    let mut heard = (args.taking.start_cameras(&args.cameras, &rig, console)?, rig.take_marks());
    let test = test(&args.cameras, &mut rig, (&mut heard.0, heard.1.as_mut()), args.duration).await?;
    console.say_lines(test_in_words(&test))?;
    tell(&check_test(&test), json!({ "simulated": rig.simulated.is_some(), "figures": test_json(&test) }), console)
}

/// What comes of `cameras` and their trigger in `time`.
pub async fn test(
    cameras: &[String],
    rig: &mut LiveRig,
    (events, marks): (&mut Receiver<(Side, CameraEvent)>, Option<&mut Receiver<TriggerMark>>),
    time: Duration,
) -> Result<TestFigures, Failure> {
    let mut test = CameraTest::of(&rig.known, rig.board.as_mut(), (rig.trigger, rig.clock))?;
    let heard = test.hear(&mut Taken { events, marks }, time, interrupted()).await?;
    let usb = |index: usize| cameras.get(index).and_then(|device| UsbLink::of(device.as_ref()));
    Ok(figures(&heard, [usb(0), usb(1)], rig.period_us))
}

/// Prints `findings` and, for programs, what else is in `result`. An error where one fails.
pub fn tell(findings: &[Finding], result: Value, console: Console) -> Result<(), Failure> {
    let (lines, result) = told(findings, result);
    console.say_lines(lines)?;
    console.result(&result)?;
    match findings.iter().filter(|finding| finding.verdict == Verdict::Fail).count() {
        0 => Ok(()),
        failed => Err(Failure::check(format!("{failed} of {} checks failed", findings.len()))),
    }
}
