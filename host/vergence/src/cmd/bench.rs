//! `vergence bench`: the speed of this program beside others on the same work.

mod calibrate;
mod live;
mod matching;
mod mcu;
mod networks;
mod vision;

use crate::console::Console;
use crate::failure::Failure;

/// Measures this program and others on the same work, in one run.
#[derive(Debug, clap::Args)]
pub struct Args {
    #[command(subcommand)]
    task: Task,
}

#[derive(Debug, clap::Subcommand)]
enum Task {
    /// Measures calibration and the detection of targets, beside OpenCV and SciPy.
    ///
    /// Solves every fisheye set and detects every chessboard, then lets OpenCV (cv2.fisheye.calibrate with its crude
    /// guess, the classic detector and the SB detector) and SciPy's bundle adjustment do the same. Everything runs on one thread.
    Calibrate(calibrate::Args),
    /// Measures the live matcher on pairs that follow one another: rate, delay, right points, beside OpenCV.
    Live(live::Args),
    /// Counts right matches over the angle between the optical axes: whole images, views, and without networks.
    Matching(matching::Args),
    /// Measures the simulated chip: busy code beside QEMU, and the firmware disarmed and armed beside real time.
    Mcu(mcu::Args),
    /// Measures networks for a pair, beside Python's onnxruntime.
    Networks(networks::Args),
    /// Measures projection, unprojection and triangulation of whole arrays, beside OpenCV.
    Vision(vision::Args),
}

pub fn run(args: &Args, console: Console) -> Result<(), Failure> {
    match &args.task {
        Task::Calibrate(args) => calibrate::run(args, console),
        Task::Live(args) => live::run(args, console),
        Task::Matching(args) => matching::run(args, console),
        Task::Mcu(args) => mcu::run(args, console),
        Task::Networks(args) => networks::run(args, console),
        Task::Vision(args) => vision::run(args, console),
    }
}
