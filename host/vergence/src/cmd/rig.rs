//! `vergence rig`: rigs of two fixed cameras from and for other programs.

use std::path::{Path, PathBuf};

use serde_json::json;
use vergence_calibration_input::{ImportedRig, InputHash, import_rig};
use vergence_exchange::{Cameras, WriteFormat};
use vergence_files::write_whole;

use crate::cmd::options::{Choice, RigFileOptions, With};
use crate::cmd::stage_pose::named_mode;
use crate::console::Console;
use crate::failure::Failure;
use crate::rig_file;

/// Makes rig files of other programs' cameras, and other programs' files of rigs.
#[derive(Debug, clap::Args)]
pub struct Args {
    #[command(subcommand)]
    task: Task,
}

#[derive(Debug, clap::Subcommand)]
enum Task {
    /// Makes a rig file of two cameras of OpenCV, Kalibr, Basalt, EuRoC, ROS, mrcal, ORB-SLAM or librealsense.
    ///
    /// What is not understood in full is refused. Lenses of other models get the nearest lens of this program, and it is said how far that is
    /// off.
    Import(Import),
    /// Writes the two cameras of a rig for another program.
    Export(With<RigFileOptions, Export>),
}

#[derive(Debug, clap::Args)]
struct Import {
    /// The file, or two files of one camera each, left and right, with poses relative to the same body.
    #[arg(required = true, num_args = 1..=2)]
    files: Vec<PathBuf>,
    /// The left and the right camera of a file that has several: names, or numbers from zero.
    #[arg(long, value_name = "LEFT,RIGHT")]
    cameras: Option<String>,
    /// The rig file to write.
    #[arg(long, short, value_name = "FILE")]
    out: PathBuf,
}

#[derive(Debug, clap::Args)]
struct Export {
    /// The program to write for: opencv, kalibr, basalt, ros, colmap, mrcal or tum-vi. mrcal gets a splined model, and a lens with a moving pupil a
    /// central one for points 500 mm away: how far these are off is said.
    #[arg(long, alias = "format", value_name = "FORMAT")]
    to: WriteFormat,
    /// The mode of a rig whose cameras move.
    #[arg(long, value_name = "MODE")]
    mode: Option<String>,
    /// The file to write. ROS and mrcal have one for each camera: FILE-left and FILE-right; COLMAP has images.txt and points3D.txt beside FILE,
    /// which must not be there.
    #[arg(long, short, value_name = "FILE")]
    out: PathBuf,
}

pub fn run(args: &Args, console: Console) -> Result<(), Failure> {
    match &args.task {
        Task::Import(args) => import(args, console),
        Task::Export(verb) => export(&verb.args, verb.options.chosen()?.rig.as_deref(), console),
    }
}

fn import(args: &Import, console: Console) -> Result<(), Failure> {
    let files: Vec<&Path> = args.files.iter().map(PathBuf::as_path).collect();
    let ImportedRig { rig, remarks } = import_rig(&files, args.cameras.as_deref())?;
    let mut hash = InputHash::default();
    files.iter().try_for_each(|file| hash.add(file))?;
    let toml = rig.to_toml(&hash.provenance(None)).map_err(Failure::check)?;
    let comments: String = remarks.iter().map(|remark| format!("# {remark}\n")).collect();
    write_whole(&args.out, (comments + &toml).as_bytes())?;
    remarks.iter().for_each(|remark| console.warn(remark));
    let baseline = rig.pose_at_values(&[]).left_from_right.origin().mm().norm();
    console.say(format!("{}: baseline {baseline:.3} mm\nwrote {}", rig.name, args.out.display()))?;
    console.result(&json!({ "name": rig.name, "baseline_mm": baseline, "remarks": remarks, "out": args.out }))
}

fn export(args: &Export, rig: Option<&Path>, console: Console) -> Result<(), Failure> {
    let rig = rig_file::load(rig)?;
    let values = match &args.mode {
        Some(mode) => named_mode(&rig, mode)?.targets.iter().map(|position| position.value()).collect(),
        None if rig.axes.is_empty() => Vec::new(),
        None => return Err(Failure::usage("the cameras of this rig move: choose a pose with --mode")),
    };
    let pose = rig.pose_at_values(&values);
    pose.check_closure().map_err(|error| Failure::check(error.to_string()))?;
    let cameras = Cameras { left: rig.left_camera, right: Some((rig.right_camera, pose.left_from_right)) };
    rig_file::write_foreign(args.to, &cameras, &args.out, console)
}
