//! `vergence camera`: camera files shown, converted, and used for single points.

use std::path::PathBuf;

use nalgebra::Vector3;
use serde_json::json;
use vergence_calibration_input::{read_camera, read_camera_file};
use vergence_files::write_whole;
use vergence_rig::{CameraFormat, Shutter, camera_in_words, camera_json};
use vergence_vision::{Camera, KannalaBrandt, Pixel, UnitRay};

use crate::console::Console;
use crate::failure::Failure;

/// Works on camera files: this program's TOML, OpenCV's YAML (fisheye), Kalibr's camchain (pinhole-equidistant).
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
        /// The format to write.
        #[arg(long)]
        to: Format,
        /// The file to write.
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

#[derive(Clone, Copy, Debug, clap::ValueEnum)]
enum Format {
    Toml,
    Opencv,
    Kalibr,
}

pub fn run(args: &Args, console: Console) -> Result<(), Failure> {
    match &args.task {
        Task::Show { file } => {
            let file = read_camera_file(file)?;
            let right = file.cameras.right.map(|(camera, _)| camera);
            for camera in [Some(file.cameras.left), right].into_iter().flatten() {
                console.say(camera_in_words(&camera))?;
            }
            let cameras: Vec<_> =
                [Some(file.cameras.left), right].into_iter().flatten().map(|c| camera_json(&c)).collect();
            console.result(&json!({"format": format!("{:?}", file.format).to_lowercase(), "cameras": cameras}))
        }
        Task::Convert { file, to, out } => {
            let file = read_camera_file(file)?;
            let format = match to {
                Format::Toml => CameraFormat::Toml,
                Format::Opencv => CameraFormat::OpenCv,
                Format::Kalibr => CameraFormat::Kalibr,
            };
            if file.cameras.right.is_some() && format != CameraFormat::Kalibr {
                return Err(Failure::usage("the camchain holds a pair; only --to kalibr can hold one"));
            }
            if format != CameraFormat::Toml && !file.cameras.left.fits_opencv() {
                console.warn(
                    "the pupil of the lens moves or it is not symmetric, which the format cannot say: see the comment in the file that is written",
                );
            }
            if format != CameraFormat::Toml && file.shutter() != Shutter::Global {
                console.warn("the file that is written says nothing of the rolling shutter (line_time)");
            }
            write_whole(out, file.text(format)?.as_bytes())?;
            console.say(format!("wrote {}", out.display()))?;
            console.result(&json!({ "out": out }))
        }
        Task::Project { file, rays } => project(&read_camera(file)?, rays, console),
        Task::Unproject { file, pixels } => unproject(&read_camera(file)?, pixels, console),
    }
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
