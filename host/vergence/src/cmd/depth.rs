//! `vergence depth`: a cloud from photographs.

mod dense;
mod motion;
mod uncertain;

use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::{AtomicUsize, Ordering};

use indicatif::ProgressBar;
use serde_json::{Value, json};
use vergence_board::check_range;
use vergence_camera::{CameraImage, FileCamera};
use vergence_files::make_folder;
use vergence_matching::{GuidedMatcher, Matcher};
use vergence_output::{
    CloudFormat, PoseSource, TableFormat, axes_by_images_json, axes_by_images_words, check_ending, check_folder,
    cloud_json, cloud_lines, drift_warning, match_svg, write_cloud, write_drawing,
};
use vergence_pipeline::limits::PIXEL_SIGMA;
use vergence_pipeline::{Method, PairCloud, PairImages, PairPose, cloud_of_pairs, pair_cloud};
use vergence_rig::{JointsAt, Rig, RigPose, closure_in_words, closure_json};
use vergence_vision::{Kernel, Pixel, PixelPair, Side};

use self::dense::one_dense_pair;
use self::motion::StageSpeed;
use self::uncertain::Uncertain;
use super::stage_pose::StagePose;
use crate::cli::CommonOptions;
use crate::cmd::force_option::ForceOption;
use crate::cmd::model_options::MatcherOptions;
use crate::cmd::options::TableOption;
use crate::cmd::search_options::SearchOptions;
use crate::console::Console;
use crate::failure::{Failure, FailureKind};
use crate::interrupt::{interrupted, on_own_thread};
use crate::rig_file;
use vergence_plausibility::images::{Taken, cloud_is_of_one_pair, images_differ, names_are_not_swapped};
use vergence_plausibility::pose::cameras_are_near;

/// Matches two photographs (or two folders of them, paired by name, number or time stamp) taken by the cameras of the rig
/// file, and writes the points as PLY, PCD, LAS or E57 in the left camera's frame.
#[derive(Debug, clap::Args)]
pub struct Args {
    /// The left image, or a folder.
    #[arg(long, value_name = "IMAGE")]
    left: PathBuf,
    /// The right image, or a folder.
    #[arg(long, value_name = "IMAGE")]
    right: PathBuf,
    /// The cloud to write, a name that ends in .ply, .pcd, .las or .e57; for folders, the folder for one cloud per pair.
    #[arg(long, value_name = "FILE")]
    out: PathBuf,
    /// For folders, the format of the clouds; ply without it.
    #[arg(long, value_parser = CloudFormat::ENDINGS, value_name = "FORMAT")]
    format: Option<String>,
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
    /// Measures a range for every pixel of the left image instead of matched points: a cloud, and beside it PNG images of range
    /// (mm, 16 bits; 0 none, 65535 too far), sigma (0.1 mm) and confidence (of 255), that of a depth camera (z in mm), a preview as SVG.
    #[arg(long, conflicts_with_all = ["points", "kernel", "matcher"])]
    dense: bool,
    /// Draws both images with the matched points, coloured by range, as SVG; for folders, the folder for one picture per pair.
    #[arg(long, value_name = "SVG", conflicts_with = "dense")]
    matches: Option<PathBuf>,
    /// Writes the points as tables too, beside the cloud.
    #[arg(long, value_delimiter = ',', value_name = "FORMAT")]
    also: Vec<TableOption>,
    /// Write the cloud as text, for a person to read; the default is binary.
    #[arg(long)]
    ascii: bool,
    #[command(flatten)]
    stage: StagePose,
    #[command(flatten)]
    speed: StageSpeed,
    #[command(flatten)]
    uncertain: Uncertain,
    #[command(flatten)]
    matching: MatcherOptions,
    #[command(flatten)]
    search: SearchOptions,
    #[command(flatten)]
    force: ForceOption,
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
    let rig = args.search.measuring(rig_file::load(rig)?)?;
    let (pose, joints) = pose(args, &rig)?;
    pose.check_closure().map_err(|error| Failure::check(error.to_string()))?;
    args.force.unless_forced(cameras_are_near(&pose.left_from_right), console)?;
    closure_in_words(&pose).iter().try_for_each(|line| console.say(line))?;
    for sentence in rig.extrapolations(&pose.axes) {
        console.warn(sentence);
    }
    let pair_pose = match args.speed.pose(&rig, &pose.axes)? {
        Some(moving) => moving,
        None => PairPose::standing(pose.clone()),
    };
    let (pairs, search) = (args.points.as_deref().map(read_pairs).transpose()?, args.search.search(&rig)?);
    if pairs.is_some() && args.search.is_given() {
        return Err(Failure::usage(
            "--nearest, --farthest and masks say where to look: nothing is sought beside --points",
        ));
    }
    let (mut cameras, alone) = FileCamera::open_pair(&args.left, &args.right)?;
    for file in &alone {
        console
            .warn(format!("{}: left out: the other camera has no image of this name, number or time", file.display()));
    }
    progress.all.store(cameras[0].remaining(), Ordering::Relaxed);
    let several = args.left.is_dir();
    if !several {
        args.force.unless_forced(names_are_not_swapped(&args.left, &args.right), console)?;
    }
    let matcher = if args.dense { None } else { Some(args.matching.matcher(console)?) };
    let setting = Setting {
        taken: Taken { rig: &rig, pose: &pair_pose, search: &search },
        joints,
        pairs: pairs.as_deref(),
        matcher: matcher.as_deref(),
    };
    let (mut results, mut empty, mut refused) = (Vec::new(), Vec::new(), Vec::new());
    while let Some([left, right]) = FileCamera::grab_pair(&mut cameras)? {
        let work = console.progress(&format!("{} and {}", left.name, right.name));
        let measured = one_pair(args, [&left, &right], &setting, (&work, console));
        work.finish_and_clear();
        progress.measured.fetch_add(1, Ordering::Relaxed);
        match measured {
            Ok(Measured { result, is_empty, .. }) => {
                empty.extend(is_empty.then(|| left.name.clone()));
                results.push(result);
            }
            // The other pairs of the folders may be good.
            Err(failure) if several && failure.kind() == FailureKind::CheckFailed => {
                console.warn(failure);
                refused.push(left.name);
            }
            Err(failure) => return Err(failure),
        }
    }
    console.result(&match (several, results.pop()) {
        (false, Some(only)) => only,
        (_, last) => json!({
            "pairs": results.into_iter().chain(last).collect::<Vec<_>>(), "refused": refused, "left_out": alone,
        }),
    })?;
    if !refused.is_empty() {
        return Err(Failure::check(format!("no cloud of {}: they are no pairs, as said above", refused.join(", "))));
    }
    if empty.is_empty() {
        return Ok(());
    }
    // Their files are written all the same: no point, or every pixel a gap.
    let why = match args.points {
        Some(_) => "no line of --points gives a point in this pose",
        None => "the images are dark, without texture, or not of this pose",
    };
    Err(Failure::check(format!("nothing in {} has a range: {why}", empty.join(", "))))
}

/// What holds for every pair.
struct Setting<'a> {
    taken: Taken<'a>,
    /// The joints, where some are known badly: each pair of images tells them.
    joints: Option<JointsAt>,
    /// The correspondences that are given.
    pairs: Option<&'a [(PixelPair, f64)]>,
    /// `None` where every pixel is measured.
    matcher: Option<&'a dyn Matcher>,
}

/// What became of a pair.
struct Measured {
    result: Value,
    /// The pose that joints and images told together.
    fused: Option<vergence_alignment::FusedPose>,
    /// Whether nothing in it has a range.
    is_empty: bool,
}

/// Checks, measures and writes one pair, with the joints as its images tell them.
fn one_pair(
    args: &Args,
    images @ [left, right]: [&CameraImage; 2],
    setting: &Setting<'_>,
    said: (&ProgressBar, Console),
) -> Result<Measured, Failure> {
    let Taken { rig, search, .. } = setting.taken;
    left.check_size(rig.left_camera.size(), Side::Left)?;
    right.check_size(rig.right_camera.size(), Side::Right)?;
    if setting.pairs.is_none() {
        args.force.unless_forced(images_differ(left, right), said.1)?;
    }
    let guided = GuidedMatcher::default();
    let matcher = setting.matcher.unwrap_or(&guided);
    let narrowed =
        setting.joints.as_ref().map(|joints| args.uncertain.narrowed(images, (rig, search), joints, matcher));
    let narrowed = narrowed.transpose()?;
    let by_images = narrowed.as_ref().map(|joints| PairPose::standing(rig.pose(joints)));
    let taken = Taken { pose: by_images.as_ref().unwrap_or(setting.taken.pose), ..setting.taken };
    let mut measured = written_pair(
        args,
        images,
        &Setting { taken, joints: None, pairs: setting.pairs, matcher: setting.matcher },
        said,
    )?;
    if let Some(joints) = &narrowed {
        let axes = args.uncertain.told(rig, joints, measured.fused.as_ref());
        let told = axes_by_images_words(rig, &axes);
        told.iter().try_for_each(|told| said.1.say(format!("  pose by images: {told}")))?;
        measured.result["axes_by_images"] = axes_by_images_json(rig, &axes);
    }
    measured.result = with_closure(measured.result, taken.pose.at_middle());
    Ok(measured)
}

/// Measures and writes one pair.
fn written_pair(
    args: &Args,
    images: [&CameraImage; 2],
    Setting { taken, pairs, matcher, .. }: &Setting<'_>,
    (work, console): (&ProgressBar, Console),
) -> Result<Measured, Failure> {
    let Taken { rig, pose, search } = *taken;
    let out = out_of(args, images[0])?;
    let Some(matcher) = matcher else {
        return one_dense_pair(images, *taken, (&out, args.ascii), args.force, console);
    };
    let method = Method { matcher: *matcher, kernel: args.kernel, search, points: None };
    let cloud = cloud_of(images, rig, pose, *pairs, method)?;
    if pairs.is_none() {
        args.force.unless_forced(cloud_is_of_one_pair(&cloud, images, *taken), console)?;
    }
    let result = work.suspend(|| write(args, images, &cloud, (rig, pose.at_middle()), &out, console))?;
    Ok(Measured { result, fused: cloud.fused_pose, is_empty: cloud.matches == 0 })
}

/// The result of a pair with how the trunk's joints fit its loop, where the rig has a trunk.
fn with_closure(mut result: Value, pose: &RigPose) -> Value {
    if pose.closure.is_some() {
        result["trunk"] = closure_json(pose);
    }
    result
}

/// Refuses names of output files that say another format than the one written.
fn check_names(args: &Args) -> Result<(), Failure> {
    let several = args.left.is_dir();
    match (several, &args.format) {
        (true, _) => check_folder(&args.out)?,
        (false, None) => CloudFormat::check_name(&args.out, args.ascii)?,
        _ => return Err(Failure::usage("--format is for folders: of a pair, the ending of --out says it")),
    }
    match &args.matches {
        Some(folder) if several => check_folder(folder)?,
        Some(file) => _ = check_ending(file, &["svg"])?,
        None => {}
    }
    Ok(())
}

/// Writes and prints the cloud of one pair, whose pose the joints alone tell to be `by_joints`.
fn write(
    args: &Args,
    [left, right]: [&CameraImage; 2],
    cloud: &PairCloud,
    (rig, by_joints): (&Rig, &RigPose),
    out: &Path,
    console: Console,
) -> Result<Value, Failure> {
    write_cloud(out, &cloud.points, args.ascii, args.also.iter().copied().map(TableFormat::from))?;
    if let Some(matches) = &args.matches {
        let path = if args.left.is_dir() { in_folder(matches, left, "svg")? } else { matches.clone() };
        let images = PairImages { left: &left.image, right: &right.image };
        write_drawing(&path, match_svg(images, cloud))?;
    }
    console.say(format!("{} points of {} matches in {}", cloud.points.len(), cloud.matches, out.display()))?;
    console.say_lines(cloud_lines(cloud))?;
    if let Some(warning) = drift_warning(cloud, PoseSource::of_photographs(rig)) {
        console.warn(format!("{} and {}: {warning}", left.name, right.name));
    }
    Ok(cloud_json(cloud, &cloud.pose(by_joints), out))
}

/// The pose of the cameras: fixed by the rig file, or given on the command line; beside it the joints, where some are known badly.
fn pose(args: &Args, rig: &Rig) -> Result<(RigPose, Option<JointsAt>), Failure> {
    let mut positions = match &args.mode {
        Some(name) => {
            let mode =
                rig.mode(name).ok_or_else(|| Failure::usage(format!("rig '{}' has no mode '{name}'", rig.name)))?;
            mode.targets.iter().copied().map(Some).collect()
        }
        None => args.stage.of_axes(rig)?,
    };
    args.uncertain.fill(rig, &mut positions);
    let positions: Option<Vec<_>> = positions.into_iter().collect();
    let positions = positions.ok_or_else(|| {
        Failure::usage(format!("rig '{}' moves: say its pose with --mode, or --baseline and --separation", rig.name))
    })?;
    check_range(rig, &positions)?;
    let values: Vec<f64> = positions.iter().map(|position| position.value()).collect();
    if args.uncertain.is_empty() {
        return Ok((rig.pose_at_values(&values), None));
    }
    let joints = args.uncertain.joints(rig, &values)?;
    Ok((rig.pose(&joints), Some(joints)))
}

/// The file for the cloud; where folders are given, in the folder for clouds, which is made.
fn out_of(args: &Args, left: &CameraImage) -> Result<PathBuf, Failure> {
    let ending = args.format.as_deref().unwrap_or(CloudFormat::default().ending());
    if args.left.is_dir() { in_folder(&args.out, left, ending) } else { Ok(args.out.clone()) }
}

/// The file of a pair in `folder`, which is made.
fn in_folder(folder: &Path, left: &CameraImage, ending: &str) -> Result<PathBuf, Failure> {
    make_folder(folder)?;
    Ok(folder.join(format!("{}.{ending}", left.name)))
}

/// The cloud of one pair: of the given correspondences, or of what the matcher finds.
fn cloud_of(
    [left, right]: [&CameraImage; 2],
    rig: &Rig,
    pose: &PairPose,
    pairs: Option<&[(PixelPair, f64)]>,
    method: Method<'_>,
) -> Result<PairCloud, Failure> {
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
