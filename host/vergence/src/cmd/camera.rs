//! `vergence camera`: camera files shown, converted, and used for single points.

use std::path::{Path, PathBuf};

use nalgebra::Vector3;
use serde_json::json;
use vergence_calibration_input::{FileLens, bare_document, camera_toml, read_camera_file};
use vergence_exchange::OursOrTheirs;
use vergence_files::write_whole;
use vergence_rig::{Shutter, camera_in_words, camera_json};
use vergence_vision::{Camera, KannalaBrandt, Pixel, UnitRay};

use crate::console::Console;
use crate::failure::Failure;
use crate::rig_file::{read_lens, write_foreign};

/// Works on camera files: this program's and those of OpenCV, Kalibr, Basalt, EuRoC, ROS, mrcal, COLMAP, ORB-SLAM, OCamCalib and librealsense.
/// One camera of several is FILE#NAME.
#[derive(Debug, clap::Args)]
pub struct Args {
    #[command(subcommand)]
    task: Task,
}

#[derive(Debug, clap::Subcommand)]
enum Task {
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
        #[arg(required = true, allow_hyphen_values = true, value_parser = parse_numbers::<3>)]
        rays: Vec<[f64; 3]>,
    },
    /// The directions of pixels.
    Unproject {
        /// The camera file.
        file: PathBuf,
        /// A pixel such as 480,299.5.
        #[arg(required = true, allow_hyphen_values = true, value_parser = parse_numbers::<2>)]
        pixels: Vec<[f64; 2]>,
    },
}

pub fn run(args: &Args, console: Console) -> Result<(), Failure> {
    match &args.task {
        Task::Show { file } => {
            let file = read_camera_file(file)?;
            for camera in &file.cameras {
                if file.cameras.len() > 1 {
                    console.say(format!("{}:", camera.name))?;
                }
                console.say(camera_in_words(&camera.lens))?;
                console.say_lines(camera.remark.clone())?;
            }
            let json = |camera: &FileLens| {
                let mut json = camera_json(&camera.lens);
                json["name"] = json!(camera.name);
                json["remark"] = json!(camera.remark);
                json
            };
            let cameras: Vec<_> = file.cameras.iter().map(json).collect();
            let format = file.format.map_or("toml".to_owned(), |format| format!("{format:?}").to_lowercase());
            console.result(&json!({ "format": format, "cameras": cameras }))
        }
        Task::Convert { file, to, out } => convert(file, *to, out, console),
        Task::Project { file, rays } => project(&read_lens(file, console)?, rays, console),
        Task::Unproject { file, pixels } => unproject(&read_lens(file, console)?, pixels, console),
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

fn project(camera: &KannalaBrandt, rays: &[[f64; 3]], console: Console) -> Result<(), Failure> {
    let mut pixels = Vec::new();
    for &ray in rays {
        let ray = UnitRay::<Camera>::new(Vector3::from(ray)).ok_or_else(|| {
            Failure::usage(format!("({}, {}, {}) has no direction: give a ray other than zero", ray[0], ray[1], ray[2]))
        })?;
        let pixel = camera.project(&ray).ok();
        console.say(pixel.map_or("outside the lens's valid cone".into(), |p| format!("{:.6} {:.6}", p.u, p.v)))?;
        pixels.push(pixel.map(|p| [p.u, p.v]));
    }
    console.result(&json!({ "pixels": pixels }))
}

fn unproject(camera: &KannalaBrandt, pixels: &[[f64; 2]], console: Console) -> Result<(), Failure> {
    let (mut rays, mut origins) = (Vec::new(), Vec::new());
    for &[u, v] in pixels {
        let ray = camera.unproject::<Camera>(Pixel { u, v }).ok();
        origins.push(ray.map(|ray| camera.origin_of(&ray).mm().as_slice().to_vec()));
        let ray = ray.map(|ray| ray.vector());
        console
            .say(ray.map_or("outside the lens's valid cone".into(), |d| format!("{:.9} {:.9} {:.9}", d.x, d.y, d.z)))?;
        rays.push(ray.map(|d| [d.x, d.y, d.z]));
    }
    console.result(&json!({ "rays": rays, "origins_mm": origins }))
}

/// `N` numbers between commas.
fn parse_numbers<const N: usize>(text: &str) -> Result<[f64; N], String> {
    let numbers: Result<Vec<f64>, _> = text.split(',').map(|part| part.trim().parse::<f64>()).collect();
    let numbers = numbers.map_err(|error| format!("{error}: write {N} numbers between commas"))?;
    numbers.try_into().map_err(|numbers: Vec<f64>| format!("{} numbers where {N} are needed", numbers.len()))
}
