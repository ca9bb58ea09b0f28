//! `vergence bench calibrate`: seconds of ours and of the peers on the same corners and images, one thread each.

use std::path::{Path, PathBuf};

use image::GrayImage;
use image::imageops::grayscale;
use serde_json::{Value, json};
use vergence_calibration::detect::detect;
use vergence_calibration::{BoardSpec, IntrinsicsOptions, calibrate_intrinsics, median};
use vergence_vision::Length;

use super::peer::{Peer, PeerCalibration, PeerFit};
use super::sets::{CORNER_SETS, IMAGE_SETS, meta, shared};
use crate::boards::files;
use crate::camera::read_image;
use crate::cmd::report::rounded;
use crate::console::Console;
use crate::corners;
use crate::failure::Failure;
use crate::stopwatch::Stopwatch;

/// Solves every fisheye set and detects every chessboard, then lets OpenCV (`cv2.fisheye.calibrate` with its crude guess,
/// the SB detector) and SciPy's bundle adjustment do the same by the scripts in the folder `bench` beside the data.
/// Everything runs on one thread; seconds are medians.
#[derive(Debug, clap::Args)]
pub struct Args {
    /// The folder with `data` and `bench`; without it ../shared.
    #[arg(long, env = "VERGENCE_SHARED", value_name = "DIR")]
    shared: Option<PathBuf>,
    /// The Python interpreter that has OpenCV and SciPy.
    #[arg(long, default_value = "python3")]
    python: String,
    /// Measure this program alone.
    #[arg(long)]
    no_peer: bool,
    /// How often each calibration is solved.
    #[arg(long, default_value_t = 5, value_parser = clap::value_parser!(u16).range(1..))]
    runs: u16,
}

/// A fit within this factor of the least-squares optimum has converged.
const CONVERGED: f64 = 1.5;
/// SciPy's optimum takes at least so many times as long as ours, or we are too slow.
const FASTER_THAN_SCIPY: f64 = 10.0;

pub fn run(args: &Args, console: Console) -> Result<(), Failure> {
    let shared = shared(args.shared.as_deref())?;
    let peer = Peer { python: &args.python, scripts: shared.join("bench"), runs: args.runs };
    let peer = (!args.no_peer).then_some(&peer);
    let one_thread = rayon::ThreadPoolBuilder::new()
        .num_threads(1)
        .build()
        .map_err(|error| Failure::device(format!("no thread: {error}")))?;
    let (mut solves, mut detections) = (Vec::new(), Vec::new());
    for (set, corners) in CORNER_SETS {
        let bench = SolveBench { set: &shared.join("data").join(set), corners, runs: args.runs };
        for solve in bench.run(peer, &one_thread)? {
            tell_solve(&solve, console)?;
            solves.push(solve);
        }
    }
    for (set, images) in IMAGE_SETS {
        let detection = detection(&shared.join("data").join(set), images, peer, &one_thread)?;
        tell_detection(&detection, console)?;
        detections.push(detection);
    }
    console.result(&json!({ "solve": solves, "detection": detections, "peers": peer.is_some() }))
}

struct SolveBench<'a> {
    set: &'a Path,
    corners: &'a str,
    runs: u16,
}

impl SolveBench<'_> {
    /// Every camera of the set.
    fn run(&self, peer: Option<&Peer<'_>>, one_thread: &rayon::ThreadPool) -> Result<Vec<Value>, Failure> {
        let meta = meta(self.set)?;
        let peers = peer.map(|peer| peer.calibrate(self.set, self.corners, &meta.cameras)).transpose()?;
        let mut solves = Vec::new();
        for (index, camera) in meta.cameras.iter().enumerate() {
            let path = self.set.join(self.corners);
            let views: Vec<_> = corners::read(&path, Some(camera))?.into_iter().map(|frame| frame.view).collect();
            let solve = || calibrate_intrinsics(&views, meta.size(), &IntrinsicsOptions::default());
            let mut seconds = Vec::new();
            for _ in 0..self.runs {
                let watch = Stopwatch::start();
                one_thread.install(solve).map_err(|error| Failure::input(&path, error))?;
                seconds.push(watch.seconds());
            }
            let found = solve().map_err(|error| Failure::input(&path, error))?;
            let peers = peers.as_ref().and_then(|peers| peers.get(index));
            let ours = median(seconds).unwrap_or_default();
            let mut result = json!({
                "set": self.set.file_name().unwrap_or_default().to_string_lossy(),
                "corners_file": self.corners,
                "camera": camera,
                "corners": found.corners_total,
                "seconds": ours,
                "rms_px": found.rms_px,
                "rms_inlier_px": found.rms_inlier_px,
            });
            if let Some(peers) = peers {
                compare(&mut result, ours, peers);
            }
            solves.push(result);
        }
        Ok(solves)
    }
}

fn compare(result: &mut Value, ours: f64, PeerCalibration { opencv, scipy }: &PeerCalibration) {
    let in_json = |fit: &PeerFit| json!({ "seconds": fit.seconds, "rms_px": fit.rms_px, "error": fit.error });
    let converged = opencv.rms_px.zip(scipy.rms_px).is_some_and(|(theirs, least)| theirs <= CONVERGED * least);
    result["opencv"] = in_json(opencv);
    result["opencv"]["converged"] = json!(converged);
    result["scipy"] = in_json(scipy);
    result["no_slower_than_opencv"] = json!(opencv.seconds.filter(|_| converged).map(|theirs| ours <= theirs));
    result["a_tenth_of_scipy"] = json!(scipy.seconds.map(|theirs| ours * FASTER_THAN_SCIPY <= theirs));
}

fn detection(
    set: &Path,
    pattern: &str,
    peer: Option<&Peer<'_>>,
    one_thread: &rayon::ThreadPool,
) -> Result<Value, Failure> {
    let meta = meta(set)?;
    let [columns, rows] = meta.board_inner_corners;
    let board = BoardSpec { columns, rows, square: Length::from_mm(meta.square_mm) };
    let paths = files(&[set.join(pattern).to_string_lossy().into_owned()])?;
    let (mut milliseconds, mut boards, mut complete) = (Vec::new(), 0, 0);
    for path in &paths {
        let image: GrayImage = grayscale(&read_image(path)?);
        let watch = Stopwatch::start();
        let found = one_thread.install(|| detect(&image, &board, None));
        milliseconds.push(1e3 * watch.seconds());
        boards += usize::from(found.is_ok());
        complete += usize::from(found.is_ok_and(|found| found.complete));
    }
    let ours = median(milliseconds).unwrap_or_default();
    let mut result = json!({
        "set": set.file_name().unwrap_or_default().to_string_lossy(),
        "images": paths.len(),
        "boards": boards,
        "complete": complete,
        "median_ms": ours,
    });
    if let Some(peer) = peer {
        let (found, theirs) = peer.detect(&paths, meta.board_inner_corners)?;
        result["opencv_sb"] = json!({ "boards": found, "median_ms": theirs });
        result["no_slower_than_opencv"] = json!(ours <= theirs);
    }
    Ok(result)
}

fn tell_solve(solve: &Value, console: Console) -> Result<(), Failure> {
    let ms = |value: &Value| value.as_f64().map_or_else(|| "failed".into(), |s| format!("{:.1} ms", 1e3 * s));
    let px = |value: &Value| value.as_f64().map_or_else(|| "-".into(), |px| format!("{px:.3} px"));
    let text = |name: &str| solve[name].as_str().unwrap_or_default().to_owned();
    let mut line = format!(
        "{} {} {} ({} corners): {} ({})",
        text("set"),
        text("corners_file"),
        text("camera"),
        solve["corners"],
        ms(&solve["seconds"]),
        px(&solve["rms_px"])
    );
    for (name, peer) in [("OpenCV", &solve["opencv"]), ("SciPy", &solve["scipy"])] {
        if !peer.is_null() {
            line += &format!("; {name} {} ({})", ms(&peer["seconds"]), px(&peer["rms_px"]));
        }
    }
    console.say(line)
}

fn tell_detection(found: &Value, console: Console) -> Result<(), Failure> {
    let ms = |value: &Value| rounded(value.as_f64().unwrap_or_default());
    let mut line = format!(
        "{}: boards in {} of {} images, {} of them complete, {:.1} ms an image",
        found["set"].as_str().unwrap_or_default(),
        found["boards"],
        found["images"],
        found["complete"],
        ms(&found["median_ms"])
    );
    let peer = &found["opencv_sb"];
    if !peer.is_null() {
        line += &format!("; OpenCV SB {} boards, {:.1} ms", peer["boards"], ms(&peer["median_ms"]));
    }
    console.say(line)
}
