//! `vergence depth`: a cloud from photographs.

mod motion;

use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::{AtomicUsize, Ordering};

use serde_json::{Value, json};
use vergence_board::check_range;
use vergence_camera::{Camera, CameraImage, FileCamera};
use vergence_files::make_folder;
use vergence_matching::GuidedMatcher;
use vergence_output::{
    DenseCloud, PoseSource, TableFormat, check_ending, check_folder, cloud_json, drift_warning, dropped_lines,
    match_svg, pose_source_json, pose_source_line, write_cloud, write_drawing,
};
use vergence_pipeline::limits::PIXEL_SIGMA;
use vergence_pipeline::{
    Method, PairCloud, PairImages, PairPose, StageTimes, cloud_of_pairs, dense_ranges, pair_cloud, pose_by_images,
    with_fused,
};
use vergence_rig::{Rig, RigPose};
use vergence_vision::{Kernel, Pixel, PixelPair, Side};

use self::motion::StageSpeed;
use super::stage_pose::StagePose;
use crate::cli::CommonOptions;
use crate::cmd::model_options::MatcherOptions;
use crate::cmd::options::TableOption;
use crate::console::Console;
use crate::failure::Failure;
use crate::interrupt::{interrupted, on_own_thread};
use crate::rig_file;
use crate::stopwatch::clock;

/// Matches two photographs (or two folders of them, paired in the order of their names) taken by the cameras of the rig
/// file, and writes the points as PLY in millimetres in the left camera's frame.
#[derive(Debug, clap::Args)]
pub struct Args {
    /// The left image, or a folder.
    #[arg(long, value_name = "IMAGE")]
    left: PathBuf,
    /// The right image, or a folder.
    #[arg(long, value_name = "IMAGE")]
    right: PathBuf,
    /// The cloud to write, a name that ends in .ply; for folders, the folder for one cloud per pair.
    #[arg(long, value_name = "FILE")]
    out: PathBuf,
    /// Correspondences to triangulate instead of matching: CSV with columns u_left,v_left,u_right,v_right in pixels.
    #[arg(long, value_name = "CSV")]
    points: Option<PathBuf>,
    /// The vision mode in which the photographs were taken, for a rig with axes.
    #[arg(long, conflicts_with_all = ["baseline", "separation"])]
    mode: Option<String>,
    /// Method of triangulation: pseudo-intersection, or for comparison midpoint, mid2, angular-l1, angular-l2,
    /// angular-linf, reprojection, rectified; for matches on parallel edges, edge-plane:X,Y,Z with the direction of the
    /// edges in the left frame.
    #[arg(long, value_name = "METHOD", default_value_t)]
    kernel: Kernel,
    /// Measures a range for every pixel of the left image instead of matched points: a binary cloud, and beside it PNG images
    /// of range (mm, 16 bits; 0 none, 65535 too far), sigma (0.1 mm) and confidence (of 255), and a preview as SVG.
    #[arg(long, conflicts_with_all = ["points", "kernel", "matcher"])]
    dense: bool,
    /// Draws both images with the matched points, coloured by range, as SVG; for folders, the folder for one picture per pair.
    #[arg(long, value_name = "SVG", conflicts_with = "dense")]
    matches: Option<PathBuf>,
    /// Writes the points as tables too, beside the cloud.
    #[arg(long, value_delimiter = ',', value_name = "FORMAT")]
    also: Vec<TableOption>,
    #[command(flatten)]
    stage: StagePose,
    #[command(flatten)]
    speed: StageSpeed,
    #[command(flatten)]
    matching: MatcherOptions,
}

/// Pairs of images, for whoever interrupts.
#[derive(Default)]
struct Progress {
    all: AtomicUsize,
    measured: AtomicUsize,
}

pub async fn run(args: Args, common: &CommonOptions, console: Console) -> Result<(), Failure> {
    let (progress, out, rig_path) = (Arc::new(Progress::default()), args.out.clone(), common.rig.clone());
    let counted = Arc::clone(&progress);
    tokio::select! {
        biased;
        () = interrupted() => Err(Failure::interrupted(progress.in_words(&out))),
        outcome = on_own_thread(move || every_pair(&args, rig_path.as_deref(), console, &counted)) => outcome,
    }
}

impl Progress {
    /// What is measured and what is left.
    fn in_words(&self, out: &Path) -> String {
        let [all, measured] = [&self.all, &self.measured].map(|count| count.load(Ordering::Relaxed));
        match measured {
            0 => format!("interrupted: nothing is written to {} yet; run the command again", out.display()),
            _ => format!(
                "interrupted: {measured} of {all} pairs are measured, their clouds are in {}; run the command again for all of \
                 them, or with folders of the other {}",
                out.display(),
                all - measured.min(all)
            ),
        }
    }
}

/// Measures every pair, one after the other.
fn every_pair(args: &Args, rig: Option<&Path>, console: Console, progress: &Progress) -> Result<(), Failure> {
    check_names(args)?;
    let rig = rig_file::load(rig)?;
    let pose = pose(args, &rig)?;
    for sentence in rig.extrapolations(&pose.axes) {
        console.warn(sentence);
    }
    let pair_pose = match args.speed.pose(&rig, &pose.axes)? {
        Some(moving) => moving,
        None => PairPose::standing(pose.clone()),
    };
    let pairs = args.points.as_deref().map(read_pairs).transpose()?;
    let [mut left, mut right] = FileCamera::open_pair(&args.left, &args.right)?;
    progress.all.store(left.remaining(), Ordering::Relaxed);
    let matcher = if args.dense { None } else { Some(args.matching.matcher(console)?) };
    let several = args.left.is_dir();
    let (mut results, mut empty) = (Vec::new(), Vec::new());
    while let (Some(left), Some(right)) = (left.grab()?, right.grab()?) {
        let work = console.progress(&format!("{} and {}", left.name, right.name));
        let out = out_of(args, &left)?;
        let result = match &matcher {
            None => {
                let (result, is_empty) = one_dense_pair([&left, &right], &rig, &pose, &out, console)?;
                empty.extend(is_empty.then(|| left.name.clone()));
                result
            }
            Some(matcher) => {
                let method = Method { matcher: matcher.as_ref(), kernel: args.kernel };
                let cloud = one_pair([&left, &right], &rig, &pair_pose, pairs.as_deref(), method)?;
                work.suspend(|| write(args, [&left, &right], &cloud, &rig, &out, console))?
            }
        };
        work.finish_and_clear();
        results.push(result);
        progress.measured.fetch_add(1, Ordering::Relaxed);
    }
    console.result(&match (several, results.pop()) {
        (false, Some(only)) => only,
        (_, last) => json!({ "pairs": results.into_iter().chain(last).collect::<Vec<_>>() }),
    })?;
    if empty.is_empty() {
        return Ok(());
    }
    // Their files are written all the same: every pixel is a gap.
    Err(Failure::check(format!(
        "no pixel of {} has a range: the images are dark, without texture, or not of this pose",
        empty.join(", ")
    )))
}

/// Measures one pair and writes the cloud to `out` and images beside it. Returns the result, and whether no pixel has a
/// range or is known to be far.
fn one_dense_pair(
    [left, right]: [&CameraImage; 2],
    rig: &Rig,
    pose: &RigPose,
    out: &Path,
    console: Console,
) -> Result<(Value, bool), Failure> {
    left.check_size(rig.left_camera.size(), Side::Left)?;
    right.check_size(rig.right_camera.size(), Side::Right)?;
    let images = PairImages { left: &left.image, right: &right.image };
    let mut times = StageTimes::start(clock);
    let fail = |error: &dyn std::fmt::Display| Failure::usage(format!("{} and {}: {error}", left.name, right.name));
    let fused = pose_by_images(images, rig, pose, &GuidedMatcher::default()).map_err(|error| fail(&error))?;
    let pose = &fused.map_or_else(|| pose.clone(), |fused| with_fused(pose, &fused));
    let depth = dense_ranges(images, rig, pose, &mut |stage| times.ended(stage)).map_err(|error| fail(&error))?;
    let written = DenseCloud::write(&depth, &times, images, (rig, pose), out)?;
    console.say(written.in_words())?;
    pose_source_line(fused.as_ref()).iter().try_for_each(|line| console.say(line))?;
    let mut result = written.json();
    result["pose"] = pose_source_json(fused.as_ref());
    Ok((result, written.is_empty()))
}

/// Refuses names of output files that say another format than the one written.
fn check_names(args: &Args) -> Result<(), Failure> {
    let several = args.left.is_dir();
    match several {
        true => check_folder(&args.out)?,
        false => _ = check_ending(&args.out, &["ply"])?,
    }
    match &args.matches {
        Some(folder) if several => check_folder(folder)?,
        Some(file) => _ = check_ending(file, &["svg"])?,
        None => {}
    }
    Ok(())
}

/// Writes and prints the cloud of one pair.
fn write(
    args: &Args,
    [left, right]: [&CameraImage; 2],
    cloud: &PairCloud,
    rig: &Rig,
    out: &Path,
    console: Console,
) -> Result<Value, Failure> {
    write_cloud(out, &cloud.points, args.also.iter().copied().map(TableFormat::from))?;
    if let Some(matches) = &args.matches {
        let path = if args.left.is_dir() { in_folder(matches, left, "svg")? } else { matches.clone() };
        let images = PairImages { left: &left.image, right: &right.image };
        write_drawing(&path, match_svg(images, cloud))?;
    }
    console.say(format!("{} points of {} matches in {}", cloud.points.len(), cloud.matches, out.display()))?;
    dropped_lines(&cloud.dropped).iter().try_for_each(|line| console.say(line))?;
    pose_source_line(cloud.fused_pose.as_ref()).iter().try_for_each(|line| console.say(line))?;
    if let Some(warning) = drift_warning(cloud, PoseSource::of_photographs(rig)) {
        console.warn(format!("{} and {}: {warning}", left.name, right.name));
    }
    Ok(cloud_json(cloud, out))
}

/// The pose of the cameras: fixed by the rig file, or given on the command line.
fn pose(args: &Args, rig: &Rig) -> Result<RigPose, Failure> {
    let positions = match &args.mode {
        Some(name) => {
            let mode =
                rig.mode(name).ok_or_else(|| Failure::usage(format!("rig '{}' has no mode '{name}'", rig.name)))?;
            mode.targets.iter().copied().map(Some).collect()
        }
        None => args.stage.of_axes(rig)?,
    };
    let positions: Option<Vec<_>> = positions.into_iter().collect();
    let positions = positions.ok_or_else(|| {
        Failure::usage(format!("rig '{}' moves: say its pose with --mode, or --baseline and --separation", rig.name))
    })?;
    check_range(rig, &positions)?;
    let values: Vec<f64> = positions.iter().map(|position| position.value()).collect();
    Ok(rig.pose_at_values(&values))
}

/// The file for the cloud; where folders are given, in the folder for clouds, which is made.
fn out_of(args: &Args, left: &CameraImage) -> Result<PathBuf, Failure> {
    if args.left.is_dir() { in_folder(&args.out, left, "ply") } else { Ok(args.out.clone()) }
}

/// The file of a pair in `folder`, which is made.
fn in_folder(folder: &Path, left: &CameraImage, ending: &str) -> Result<PathBuf, Failure> {
    make_folder(folder)?;
    Ok(folder.join(format!("{}.{ending}", left.name)))
}

/// The cloud of one pair: of the given correspondences, or of what the matcher finds.
fn one_pair(
    [left, right]: [&CameraImage; 2],
    rig: &Rig,
    pose: &PairPose,
    pairs: Option<&[(PixelPair, f64)]>,
    method: Method<'_>,
) -> Result<PairCloud, Failure> {
    left.check_size(rig.left_camera.size(), Side::Left)?;
    right.check_size(rig.right_camera.size(), Side::Right)?;
    let images = PairImages { left: &left.image, right: &right.image };
    let fail = |error: &dyn std::fmt::Display| Failure::usage(format!("{} and {}: {error}", left.name, right.name));
    match pairs {
        Some(pairs) => cloud_of_pairs(pairs, images.left, rig, pose, method.kernel).map_err(|error| fail(&error)),
        None => pair_cloud(images, rig, pose, method, &mut |_| ()).map_err(|error| fail(&error)),
    }
}

/// Reads correspondences from a CSV file with a header.
fn read_pairs(path: &Path) -> Result<Vec<(PixelPair, f64)>, Failure> {
    #[derive(serde::Deserialize)]
    struct Row {
        u_left: f64,
        v_left: f64,
        u_right: f64,
        v_right: f64,
    }
    let mut reader = csv::Reader::from_path(path).map_err(|error| Failure::input(path, error))?;
    reader
        .deserialize()
        .map(|row| {
            let Row { u_left, v_left, u_right, v_right } = row.map_err(|error| Failure::input(path, error))?;
            let pixels = PixelPair { left: Pixel { u: u_left, v: v_left }, right: Pixel { u: u_right, v: v_right } };
            Ok((pixels, PIXEL_SIGMA))
        })
        .collect()
}
