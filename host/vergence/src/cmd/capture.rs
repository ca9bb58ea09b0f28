//! `vergence capture`: a set of board views, with advice on what to show.

use std::path::PathBuf;
use std::time::Duration;

use image::imageops::grayscale;
use serde_json::json;
use vergence_calibration::detect::detect;
use vergence_calibration::{BoardSpec, BoardView, Coverage};
use vergence_scene::Board;
use vergence_vision::ImageSize;

use super::board_options::BoardOptions;
use crate::camera::{BoardStage, Camera, Eye, Frame, SimulatedBoardCamera, V4lCamera, V4lSettings};
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
    /// Image size of the cameras.
    #[arg(long, value_parser = parse_pixels, value_name = "WxH")]
    size: Option<(u32, u32)>,
    /// Exposure, such as 5ms.
    #[arg(long, value_parser = humantime::parse_duration)]
    exposure: Option<Duration>,
    /// Gain, in the camera's own unit.
    #[arg(long)]
    gain: Option<i64>,
    /// Of simulated cameras: one, instead of the pair in its human pose.
    #[arg(long)]
    mono: bool,
    /// Of simulated cameras: where the board is held, and the noise.
    #[arg(long, default_value_t = 1)]
    seed: u64,
}

/// A board that moves by less than this between two frames is held still, in pixels.
const STILL_PX: f64 = 1.0;
const NAMES: [&str; 2] = ["left", "right"];

pub fn run(args: &Args, globals: &Globals, console: Console) -> Result<(), Failure> {
    let board = args.board.spec()?;
    let mut cameras = open(args, globals, &board)?;
    make_folder(&args.out)?;
    let mut set = Set { coverage: Vec::new(), last: Vec::new(), taken: 0 };
    let progress = console.progress("show the board");
    let mut seen = 0;
    while set.taken < args.views && seen < args.frames && !set.is_complete() {
        let mut frames = Vec::new();
        for camera in &mut cameras {
            frames.push(camera.grab()?.ok_or_else(|| Failure::device("a camera ended"))?);
        }
        seen += 1;
        let news = set.look(&frames, &board);
        if news {
            for (frame, name) in frames.iter().zip(NAMES) {
                write_png(&args.out.join(format!("{name}{:03}.png", set.taken)), &frame.image)?;
            }
            set.take();
        }
        progress.set_message(format!("{} views; {}", set.taken, set.advice()));
        progress.tick();
        if news {
            progress.suspend(|| console.say(format!("view {} taken; {}", set.taken, set.advice())))?;
        }
    }
    progress.finish_and_clear();
    let complete = set.is_complete();
    console.say(format!(
        "{} views in {}{}",
        set.taken,
        args.out.display(),
        if complete { "; the set is complete" } else { "; the set is not complete" }
    ))?;
    console.result(&json!({ "views": set.taken, "frames": seen, "complete": complete, "out": args.out }))
}

fn open(args: &Args, globals: &Globals, board: &BoardSpec) -> Result<Vec<Box<dyn Camera>>, Failure> {
    if args.cameras == ["sim"] {
        return simulated(args, globals, board);
    }
    let settings = V4lSettings { size: args.size, exposure: args.exposure, gain: args.gain };
    let clock = HostClock::start();
    let mut cameras: Vec<Box<dyn Camera>> = Vec::new();
    for device in &args.cameras {
        cameras.push(Box::new(V4lCamera::open(device.as_ref(), &settings, clock)?));
    }
    Ok(cameras)
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
    let eyes = if args.mono { &[Eye::Left][..] } else { &[Eye::Left, Eye::Right] };
    Ok(eyes.iter().map(|&eye| Box::new(SimulatedBoardCamera { stage, eye, frames: 0 }) as Box<dyn Camera>).collect())
}

/// The set in the making: what each camera has covered, and what it saw last.
struct Set {
    coverage: Vec<Coverage>,
    last: Vec<BoardView>,
    taken: usize,
}

impl Set {
    /// Looks for the board in the frames of one instant; whether they are worth keeping.
    fn look(&mut self, frames: &[Frame], board: &BoardSpec) -> bool {
        if self.coverage.is_empty() {
            let size = |frame: &Frame| ImageSize { width: frame.image.width(), height: frame.image.height() };
            self.coverage = frames.iter().map(|frame| Coverage::new(size(frame))).collect();
        }
        let views: Option<Vec<BoardView>> = frames
            .iter()
            .map(|frame| Some(detect(&grayscale(&frame.image), board, None).ok()?.view(&frame.name, board)))
            .collect();
        let before = std::mem::replace(&mut self.last, views.unwrap_or_default());
        let still = before.len() == frames.len() && before.iter().zip(&self.last).all(|(a, b)| is_still(a, b));
        still && self.coverage.iter().zip(&self.last).any(|(coverage, view)| coverage.is_news(view))
    }

    /// Takes what was seen last.
    fn take(&mut self) {
        for (coverage, view) in self.coverage.iter_mut().zip(&self.last) {
            coverage.add(view);
        }
        self.taken += 1;
    }

    fn is_complete(&self) -> bool {
        !self.coverage.is_empty() && self.coverage.iter().all(|coverage| coverage.advice().is_none())
    }

    /// For the camera that needs it most.
    fn advice(&self) -> String {
        let advice = self.coverage.iter().zip(NAMES).find_map(|(coverage, name)| Some((coverage.advice()?, name)));
        match advice {
            Some((advice, name)) if self.coverage.len() > 1 => format!("{name} camera: {advice}"),
            Some((advice, _)) => advice.to_string(),
            None => "the set is complete".into(),
        }
    }
}

/// Whether the board stands where it stood.
fn is_still(before: &BoardView, now: &BoardView) -> bool {
    let moved = now.corners.iter().filter_map(|corner| {
        let same = before.corners.iter().find(|other| same_place(other.board_mm, corner.board_mm))?;
        Some((corner.pixel.u - same.pixel.u).hypot(corner.pixel.v - same.pixel.v))
    });
    let (count, worst) = moved.fold((0, 0f64), |(count, worst), px| (count + 1, worst.max(px)));
    count * 2 >= now.corners.len() && count > 0 && worst < STILL_PX
}

fn same_place([x, y]: [f64; 2], [other_x, other_y]: [f64; 2]) -> bool {
    (x - other_x).abs() < 1e-6 && (y - other_y).abs() < 1e-6
}

fn parse_pixels(text: &str) -> Result<(u32, u32), String> {
    super::calibrate::parse_size(text).map(|size| (size.width, size.height))
}
