//! `vergence bench calibrate`: seconds of this program and of the peers on the same corners and images, one thread each.

use std::path::{Path, PathBuf};

use serde_json::{Value, json};
use vergence_bench::calibrate::OneThread;
use vergence_bench::peer::Peer;
use vergence_bench::sets::{CORNER_SETS, IMAGE_SETS, meta, shared};
use vergence_calibration_input::{named_images, read_corners};
use vergence_targets::TargetSpec;
use vergence_vision::Length;

use crate::console::Console;
use crate::failure::Failure;
use crate::stopwatch::clock;

/// Solves every fisheye set and detects every chessboard, then lets OpenCV (`cv2.fisheye.calibrate` with its crude guess,
/// the classic detector and the SB detector) and SciPy's bundle adjustment do the same, for the solutions by a script in the
/// folder `bench` beside the data. Everything runs on one thread; seconds are medians.
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

pub fn run(args: &Args, console: Console) -> Result<(), Failure> {
    let shared = shared(args.shared.as_deref())?;
    let peer = Peer { python: &args.python, scripts: shared.join("bench"), runs: args.runs };
    let peer = (!args.no_peer).then_some(&peer);
    let thread = OneThread::start(clock)?;
    let (mut solves, mut detections) = (Vec::new(), Vec::new());
    for (name, corners_file) in CORNER_SETS {
        let set = shared.join("data").join(name);
        let meta = meta(&set)?;
        let peers = peer.map(|peer| peer.calibrate(&set, corners_file, &meta.cameras)).transpose()?;
        for (index, camera) in meta.cameras.iter().enumerate() {
            let path = set.join(corners_file);
            let views: Vec<_> = read_corners(&path, Some(camera))?.into_iter().map(|frame| frame.view).collect();
            let solve = thread.solve(&views, meta.size(), args.runs).map_err(|error| Failure::input(&path, error))?;
            let peers = peers.as_ref().and_then(|peers| peers.get(index));
            console.say(solve.in_words(&format!("{name} {corners_file} {camera}"), peers))?;
            let mut value = solve.json(peers);
            value["set"] = name.into();
            value["corners_file"] = corners_file.into();
            value["camera"] = camera.as_str().into();
            solves.push(value);
        }
    }
    for (name, pattern) in IMAGE_SETS {
        let detection = detection(&shared.join("data").join(name), name, pattern, peer, &thread, console)?;
        detections.push(detection);
    }
    console.result(&json!({ "solve": solves, "detection": detections, "peers": peer.is_some() }))
}

/// Detects the chessboard in the images of a set; says the result and returns it as JSON.
fn detection(
    set: &Path,
    name: &str,
    pattern: &str,
    peer: Option<&Peer<'_>>,
    thread: &OneThread,
    console: Console,
) -> Result<Value, Failure> {
    let meta = meta(set)?;
    let [columns, rows] = meta.board_inner_corners;
    let target = TargetSpec { columns, rows, square: Length::from_mm(meta.square_mm) };
    let paths = named_images(&[set.join(pattern).to_string_lossy().into_owned()])?;
    let found = thread.detect_files(&paths, &target)?;
    let peer = peer.map(|peer| peer.detect(&paths, meta.board_inner_corners)).transpose()?;
    console.say(found.in_words(name, peer.as_ref()))?;
    Ok(found.json(name, peer.as_ref()))
}
