//! `vergence export`: recordings and images for other programs.

use std::path::PathBuf;

use vergence_export::{ExportFormat, Options, export};
use vergence_vision::{Angle, Face};

use crate::console::Console;
use crate::failure::Failure;
use crate::interrupt::interrupted;
use crate::rig_file;

/// Writes a recording, or images, as folders and bags for other programs.
#[derive(Debug, clap::Args)]
pub struct Args {
    /// A recording; or, for --to pinhole, the left and the right image, or a folder of each.
    #[arg(required = true, num_args = 1..=2)]
    inputs: Vec<PathBuf>,
    /// tum-vi: a folder with the fisheye images as they are. euroc: the same with a pinhole view of each camera. pinhole: views to several sides,
    /// of a recording as a ROS 2 bag, of images as PNG files.
    #[arg(long, value_name = "FORMAT")]
    to: ExportFormat,
    /// The views of each camera: front, left, right, up, down. Without it, all five.
    #[arg(long, value_delimiter = ',', value_name = "VIEWS")]
    faces: Vec<Face>,
    /// The field across a view, 10deg to 150deg; 90deg without it.
    #[arg(long, value_name = "ANGLE")]
    field: Option<Angle>,
    /// Pixels across a view. Without it, as many as show the middle as large as the camera does.
    #[arg(long, value_name = "PIXELS")]
    size: Option<u32>,
    /// The rig file of images; of a recording, instead of the one that is attached.
    #[arg(long, value_name = "FILE")]
    rig: Option<PathBuf>,
    /// The folder to write, which must be empty or not there.
    #[arg(long, short, value_name = "FOLDER")]
    out: PathBuf,
}

pub async fn run(Args { inputs, to, faces, field, size, rig, out }: Args, console: Console) -> Result<(), Failure> {
    let rig = rig.map(|file| rig_file::load(Some(&file))).transpose()?;
    let exported = export(inputs, rig, Options { to, faces, field, size, out }, interrupted()).await?;
    exported.warnings.iter().for_each(|warning| console.warn(warning));
    console.say(exported.in_words())?;
    console.result(&exported.json())
}
