//! `vergence depth`: a cloud from photographs.

mod dense;
mod motion;

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use serde_json::{Value, json};
use vergence_matching::Matcher;
use vergence_rig::{PairExposure, Rig, RigPose, SteadyMotion};
use vergence_vision::{ImageSize, Kernel, Pixel, PixelPair};

use self::motion::StageSpeed;
use super::move_to::StagePose;
use super::report::rounded;
use crate::board::check_range;
use crate::camera::{Camera, FileCamera, Frame};
use crate::cli::Globals;
use crate::console::Console;
use crate::failure::Failure;
use crate::look::{Eyes, Look, PIXEL_SIGMA, look_by, look_exposed, triangulate};
use crate::models::MatcherOptions;
use crate::output::{Table, TableFormat, make_folder, ply, write_whole};
use crate::rig_file;

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
    /// The cloud to write; for folders, the folder for one cloud per pair.
    #[arg(long, value_name = "FILE")]
    out: PathBuf,
    /// Triangulate these correspondences instead of matching: CSV with columns u_left,v_left,u_right,v_right in pixels.
    #[arg(long, value_name = "CSV")]
    points: Option<PathBuf>,
    /// The vision mode in which the photographs were taken, for a rig with axes.
    #[arg(long, conflicts_with_all = ["baseline", "separation"])]
    mode: Option<String>,
    /// How two rays make a point: pseudo-intersection, or to compare with it midpoint, mid2, angular-l1, angular-l2,
    /// angular-linf, reprojection, rectified, or for matches on parallel edges edge-plane:X,Y,Z with their direction in
    /// the left frame.
    #[arg(long, value_name = "METHOD", default_value_t)]
    kernel: Kernel,
    /// A range for every pixel of the left image instead of matched points: a binary cloud, and beside it PNG images of
    /// range (mm, 16 bits; 0 none, 65535 too far), sigma (0.1 mm), confidence (of 255) and a preview.
    #[arg(long, conflicts_with_all = ["points", "kernel", "matcher"])]
    dense: bool,
    /// Write the points as tables too, beside the cloud.
    #[arg(long, value_delimiter = ',', value_name = "FORMAT")]
    also: Vec<TableFormat>,
    #[command(flatten)]
    stage: StagePose,
    #[command(flatten)]
    speed: StageSpeed,
    #[command(flatten)]
    matching: MatcherOptions,
}

pub fn run(args: &Args, globals: &Globals, console: Console) -> Result<(), Failure> {
    let rig = rig_file::load(globals.rig.as_deref())?;
    let pose = pose(args, &rig)?;
    for sentence in rig.extrapolations(&pose.axes) {
        console.warn(sentence);
    }
    let motion = args.speed.motion(&rig, &pose.axes)?;
    let pairs = args.points.as_deref().map(read_pairs).transpose()?;
    let (mut left, mut right) = (FileCamera::open(&args.left)?, FileCamera::open(&args.right)?);
    if left.remaining() != right.remaining() {
        return Err(Failure::usage(format!(
            "{} has {} images and {} has {}: they must pair up",
            args.left.display(),
            left.remaining(),
            args.right.display(),
            right.remaining()
        )));
    }
    let matcher = if args.dense { None } else { Some(args.matching.matcher(console)?) };
    let several = args.left.is_dir();
    let (mut results, mut empty) = (Vec::new(), Vec::new());
    while let (Some(left), Some(right)) = (left.grab()?, right.grab()?) {
        let work = console.progress(&format!("{} and {}", left.name, right.name));
        let Some(matcher) = &matcher else {
            let result = dense::one_pair([&left, &right], &rig, &pose, &out_of(args, &left)?, console)?;
            work.finish_and_clear();
            if dense::is_empty(&result) {
                empty.push(left.name);
            }
            results.push(result);
            continue;
        };
        let how =
            How { pairs: pairs.as_deref(), matcher: matcher.as_ref(), kernel: args.kernel, motion: motion.as_ref() };
        let look = one_pair([&left, &right], &rig, &pose, how)?;
        work.finish_and_clear();
        let out = out_of(args, &left)?;
        write_whole(&out, ply(&look.points).as_bytes())?;
        for format in &args.also {
            let table = Table::of_points(&look.points).text(*format);
            write_whole(&out.with_extension(format.extension()), table.as_bytes())?;
        }
        console.say(format!("{} points in {}{}", look.points.len(), out.display(), in_words(&look.dropped)))?;
        if let Some(warning) = look.warning() {
            console.say(format!("warning: {warning}"))?;
        }
        results.push(result(&look, &out));
    }
    console.result(&match (several, results.pop()) {
        (false, Some(only)) => only,
        (_, last) => json!({ "pairs": results.into_iter().chain(last).collect::<Vec<_>>() }),
    })?;
    if empty.is_empty() { Ok(()) } else { Err(dense::nothing_seen(&empty)) }
}

/// Where the cameras were: fixed by the rig file, or said on the command line.
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

/// The cloud's file; for folders, in the folder of clouds, which is made.
fn out_of(args: &Args, left: &Frame) -> Result<PathBuf, Failure> {
    if !args.left.is_dir() {
        return Ok(args.out.clone());
    }
    make_folder(&args.out)?;
    Ok(args.out.join(format!("{}.ply", left.name)))
}

/// How homologous points are found, and points made of them.
#[derive(Clone, Copy)]
struct How<'a> {
    pairs: Option<&'a [(PixelPair, f64)]>,
    matcher: &'a dyn Matcher,
    kernel: Kernel,
    motion: Option<&'a (SteadyMotion, PairExposure)>,
}

fn one_pair([left, right]: [&Frame; 2], rig: &Rig, pose: &RigPose, how: How<'_>) -> Result<Look, Failure> {
    check_size(left, rig.left_camera.size(), "left")?;
    check_size(right, rig.right_camera.size(), "right")?;
    let eyes = Eyes { left: &left.image, right: &right.image };
    let fail = |error: &dyn std::fmt::Display| Failure::usage(format!("{} and {}: {error}", left.name, right.name));
    match (how.pairs, how.motion) {
        (Some(pairs), _) => Ok(triangulate(pairs, eyes, rig, pose, how.kernel)),
        (None, Some((motion, exposure))) => {
            look_exposed(eyes, rig, motion, exposure, how.matcher).map(|(look, _)| look).map_err(|error| fail(&error))
        }
        (None, None) => look_by(how.kernel, eyes, rig, pose, how.matcher).map_err(|error| fail(&error)),
    }
}

fn check_size(frame: &Frame, size: ImageSize, side: &str) -> Result<(), Failure> {
    let (width, height) = frame.image.dimensions();
    if (width, height) == (size.width, size.height) {
        return Ok(());
    }
    Err(Failure::usage(format!(
        "{side} image '{}' is {width} x {height}, but the {side} camera of the rig file is {} x {}: use the images the \
         camera was calibrated with, or its rig file",
        frame.name, size.width, size.height
    )))
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

fn in_words(dropped: &BTreeMap<&'static str, usize>) -> String {
    if dropped.is_empty() {
        return String::new();
    }
    let reasons: Vec<_> = dropped.iter().map(|(reason, count)| format!("{reason} {count}")).collect();
    format!("; dropped: {}", reasons.join(", "))
}

fn result(look: &Look, out: &Path) -> Value {
    let drift = look.pose_drift.as_ref().map(|drift| {
        json!({
            "deg": rounded(drift.angle.deg()),
            "chi_squared": rounded(drift.chi_squared),
            "significant": drift.is_significant(),
        })
    });
    json!({ "points": look.points.len(), "dropped": look.dropped, "pose_drift": drift, "out": out })
}
