//! `vergence capture`: a set of board views, with advice on what to show.

use std::path::PathBuf;

use serde_json::json;
use vergence_calibration::{BoardSpec, Coverage};
use vergence_scene::Board;
use vergence_vision::{ImageSize, Side};

use super::board_options::BoardOptions;
use super::camera_options::CameraOptions;
use crate::board_watch::{BoardWatch, NAMES, seen};
use crate::camera::{BoardStage, Camera, CameraSet, Frame, SimulatedBoardCamera};
use crate::cli::Globals;
use crate::console::Console;
use crate::failure::Failure;
use crate::link::HostClock;
use crate::output::{make_folder, write_png};
use crate::rig_file;

/// Watches one camera or a pair, and keeps an image whenever a still board is seen where it was not seen enough. Every
/// image is written at once: whatever ends the capture, what was taken is kept.
#[derive(Debug, clap::Args)]
pub struct Args {
    #[command(flatten)]
    board: BoardOptions,
    /// The cameras: one device such as /dev/video0, or left and right; or `sim` for simulated ones.
    #[arg(long, num_args = 1..=2, required = true, value_name = "DEVICE")]
    cameras: Vec<String>,
    /// The folder for the images: left000.png, right000.png and so on.
    #[arg(long, value_name = "DIR")]
    out: PathBuf,
    /// Stop after this many views, complete or not.
    #[arg(long, default_value_t = 40)]
    views: usize,
    /// Give up after this many frames.
    #[arg(long, default_value_t = 100_000)]
    frames: u64,
    #[command(flatten)]
    camera: CameraOptions,
    /// Of simulated cameras: one, instead of the pair in its human pose.
    #[arg(long)]
    mono: bool,
    /// Of simulated cameras: where the board is held, and the noise.
    #[arg(long, default_value_t = 1)]
    seed: u64,
}

pub fn run(args: &Args, globals: &Globals, console: Console) -> Result<(), Failure> {
    let board = args.board.spec()?;
    let cameras = CameraSet::new(open(args, globals, &board)?);
    capture(cameras, &board, args, console)
}

fn capture(mut cameras: CameraSet, board: &BoardSpec, args: &Args, console: Console) -> Result<(), Failure> {
    make_folder(&args.out)?;
    let mut watch = BoardWatch::new(Vec::new());
    let progress = console.progress("show the board");
    let advice = |watch: &BoardWatch| watch.advice().unwrap_or_else(|| "the set is complete".into());
    let mut frames_seen = 0;
    while watch.taken() < args.views && frames_seen < args.frames && !watch.is_complete() {
        let frames = cameras.grab()?;
        if frames_seen == 0 {
            watch = BoardWatch::new(frames.iter().map(|frame| Coverage::new(size(frame))).collect());
        }
        frames_seen += 1;
        let news = watch.look(seen(&frames, board)) && watch.is_news();
        if news {
            for (frame, name) in frames.iter().zip(NAMES) {
                write_png(&args.out.join(format!("{name}{:03}.png", watch.taken())), &frame.image)?;
            }
            watch.take();
        }
        progress.set_message(format!("{} views; {}", watch.taken(), advice(&watch)));
        progress.tick();
        if news {
            progress.suspend(|| console.say(format!("view {} taken; {}", watch.taken(), advice(&watch))))?;
        }
    }
    progress.finish_and_clear();
    let complete = watch.is_complete();
    console.say(format!(
        "{} views in {}{}",
        watch.taken(),
        args.out.display(),
        if complete { "; the set is complete" } else { "; the set is not complete" }
    ))?;
    if cameras.alone() > 0 {
        console.say(format!("{} frames had no partner of the other camera taken at the same time", cameras.alone()))?;
    }
    if cameras.missed() > 0 {
        console.say(format!("{} frames were lost between the cameras and here", cameras.missed()))?;
    }
    console.result(&json!({
        "views": watch.taken(),
        "frames": frames_seen,
        "frames_alone": cameras.alone(),
        "frames_missed": cameras.missed(),
        "complete": complete,
        "out": args.out,
    }))
}

fn size(frame: &Frame) -> ImageSize {
    ImageSize { width: frame.image.width(), height: frame.image.height() }
}

fn open(args: &Args, globals: &Globals, board: &BoardSpec) -> Result<Vec<Box<dyn Camera>>, Failure> {
    if args.cameras == ["sim"] {
        return simulated(args, globals, board);
    }
    let clock = HostClock::start();
    args.cameras.iter().map(|device| args.camera.open(device, clock)).collect()
}

fn simulated(args: &Args, globals: &Globals, board: &BoardSpec) -> Result<Vec<Box<dyn Camera>>, Failure> {
    let rig = rig_file::load(globals.rig.as_deref())?;
    let targets = rig.mode("human").map(|mode| mode.targets.iter().map(|target| target.value()).collect::<Vec<_>>());
    let pose = rig.pose_at_values(&targets.unwrap_or_default());
    let stage = BoardStage {
        left: rig.left_camera,
        right: (rig.right_camera, pose.left_from_right),
        both: !args.mono,
        board: Board { columns: board.columns, rows: board.rows, square: board.square },
        seed: args.seed,
    };
    let sides = if args.mono { &[Side::Left][..] } else { &[Side::Left, Side::Right] };
    Ok(sides.iter().map(|&side| Box::new(SimulatedBoardCamera { stage, side, frames: 0 }) as Box<dyn Camera>).collect())
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used, reason = "a test may fail")]

    use clap::Parser;

    use super::*;
    use crate::rig_file::bench_with_sensors;

    #[derive(Parser)]
    struct Line {
        #[command(flatten)]
        args: Args,
    }

    /// Shows the same board some times, then is gone.
    struct Vanishing {
        frame: Frame,
        frames_left: u32,
    }

    impl Camera for Vanishing {
        fn grab(&mut self) -> Result<Option<Frame>, Failure> {
            let gone = || Failure::device("camera /dev/video0 vanished");
            self.frames_left = self.frames_left.checked_sub(1).ok_or_else(gone)?;
            Ok(Some(self.frame.clone()))
        }
    }

    #[test]
    fn what_was_taken_before_a_camera_vanished_is_kept() {
        let (rig, folder) = (bench_with_sensors(640).unwrap(), tempfile::tempdir().unwrap());
        let out = folder.path().join("set");
        let command = ["capture", "--board", "9x6", "--square", "20mm", "--cameras", "/dev/video0", "--out"];
        let Line { args } = Line::parse_from(command.into_iter().map(Into::into).chain([out.clone().into_os_string()]));
        let board = args.board.spec().unwrap();
        let nowhere = rig.pose_at_values(&[0.0, 0.0]).left_from_right;
        let stage = BoardStage {
            left: rig.left_camera,
            right: (rig.right_camera, nowhere),
            both: false,
            board: Board { columns: board.columns, rows: board.rows, square: board.square },
            seed: 1,
        };
        let frame = SimulatedBoardCamera { stage, side: Side::Left, frames: 0 }.grab().unwrap().unwrap();
        let cameras = CameraSet::new(vec![Box::new(Vanishing { frame: frame.clone(), frames_left: 3 })]);
        let failure = capture(cameras, &board, &args, Console::new(true)).unwrap_err();
        assert_eq!(failure.kind().exit_code(), 3);
        assert!(failure.to_string().contains("vanished"));
        assert_eq!(image::open(out.join("left000.png")).unwrap().to_rgb8(), frame.image);
    }
}
