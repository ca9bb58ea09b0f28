//! `vergence camera`: cameras tested; camera files shown, converted, and used for single points.

use std::path::{Path, PathBuf};

use serde_json::{Value, json};
use vergence_calibration_input::{
    FileLens, bare_document, camera_toml, parse_pixel, parse_ray, project, read_camera_file, unproject,
};
use vergence_exchange::OursOrTheirs;
use vergence_files::write_whole;
use vergence_rig::{Shutter, camera_in_words};
use vergence_vision::{Camera, Pixel, UnitRay};

use super::camera_test;
use super::options::{BoardOptions, Choice, With};
use crate::console::Console;
use crate::failure::Failure;
use crate::rig_file::{read_lens, write_foreign};

/// Tests attached cameras, and works on camera files: this program's and those of OpenCV, Kalibr, Basalt, EuRoC, ROS, mrcal, COLMAP, ORB-SLAM, OCamCalib and librealsense.
/// One camera of several is FILE#NAME.
#[derive(Debug, clap::Args)]
pub struct Args {
    #[command(subcommand)]
    task: Task,
}

#[derive(Debug, clap::Subcommand)]
enum Task {
    /// Test both cameras of a rig: images, rate, exposure, sharpness, bandwidth, trigger, pairing.
    Test(Box<With<BoardOptions, camera_test::Args>>),
    /// Show the parameters and the valid field.
    Show {
        /// The camera file.
        file: PathBuf,
    },
    /// Write the camera in another format.
    Convert {
        /// The camera file.
        file: PathBuf,
        /// The format to write: toml, opencv, kalibr, basalt, ros, colmap, mrcal or tum-vi. mrcal gets a splined model, and a lens with a
        /// moving pupil a central one for points 500 mm away: how far these are off is said.
        #[arg(long, value_name = "FORMAT")]
        to: OursOrTheirs,
        /// The file to write. ROS and mrcal have one for each camera of a pair: FILE-left and FILE-right.
        #[arg(long, short, value_name = "FILE")]
        out: PathBuf,
    },
    /// The pixels of directions: x right, y down, z forward, of any length and any sign.
    Project {
        /// The camera file.
        file: PathBuf,
        /// A direction such as 0.1,-0.2,-0.05.
        #[arg(required = true, allow_hyphen_values = true, value_parser = parse_ray)]
        rays: Vec<UnitRay<Camera>>,
    },
    /// The directions of pixels.
    Unproject {
        /// The camera file.
        file: PathBuf,
        /// A pixel such as 480,299.5.
        #[arg(required = true, allow_hyphen_values = true, value_parser = parse_pixel)]
        pixels: Vec<Pixel>,
    },
}

pub async fn run(args: Args, console: Console) -> Result<(), Failure> {
    match &args.task {
        Task::Test(test) => camera_test::judge(&test.args, &test.options.chosen()?, console).await,
        Task::Show { file } => {
            let file = read_camera_file(file)?;
            for camera in &file.cameras {
                if file.cameras.len() > 1 {
                    console.say(format!("{}:", camera.name))?;
                }
                console.say(camera_in_words(&camera.lens))?;
                console.say_lines(camera.remark.clone())?;
            }
            let cameras: Vec<_> = file.cameras.iter().map(FileLens::json).collect();
            let format = file.format.map_or("toml".to_owned(), |format| format!("{format:?}").to_lowercase());
            console.result(&json!({ "format": format, "cameras": cameras }))
        }
        Task::Convert { file, to, out } => convert(file, *to, out, console),
        Task::Project { file, rays } => tell(project(&read_lens(file, console)?, rays), console),
        Task::Unproject { file, pixels } => tell(unproject(&read_lens(file, console)?, pixels), console),
    }
}

fn convert(path: &Path, OursOrTheirs(to): OursOrTheirs, out: &Path, console: Console) -> Result<(), Failure> {
    let file = read_camera_file(path)?;
    for remark in file.cameras.iter().filter_map(|camera| camera.remark.as_ref()) {
        console.warn(remark);
    }
    let Some(format) = to else {
        let camera = file.only(path)?;
        let remark = camera.remark.iter().map(|remark| format!("# {remark}\n")).collect::<String>();
        let document = file.document.clone().unwrap_or_else(|| bare_document(&camera.lens));
        write_whole(out, (remark + &camera_toml(&document)?).as_bytes())?;
        console.say(format!("wrote {}", out.display()))?;
        return console.result(&json!({ "out": out }));
    };
    if file.shutter() != Shutter::Global {
        console.warn("the file that is written says nothing of the rolling shutter (line_time)");
    }
    write_foreign(format, &file.to_write(path)?, out, console)
}

/// Prints what became of points, a line for each, and the result for programs.
fn tell((lines, result): (Vec<String>, Value), console: Console) -> Result<(), Failure> {
    console.say_lines(lines)?;
    console.result(&result)
}
