//! `vergence bench vision`: the cost of a point.

use vergence_bench::vision::vision;

use crate::console::Console;
use crate::failure::Failure;
use crate::stopwatch::clock;

/// Measures arrays of N x 3 and N x 2 numbers, on one thread: nanoseconds per point, the least of several runs, with OpenCV
/// and this program taking turns. Results of both go into arrays that exist; "anew" is this program into new ones.
/// cv2.fisheye.projectPoints always computes derivatives: projection with derivatives by point and lens is compared with it,
/// projection alone with distortPoints, which ends at 90 degrees. Without OpenCV (python3 -m pip install
/// opencv-python-headless numpy) its figures are null.
#[derive(Debug, clap::Args)]
pub struct Args {
    /// How many points.
    #[arg(long, default_value_t = 1_000_000, value_parser = clap::value_parser!(u32).range(100..=20_000_000))]
    points: u32,
    /// How often each is measured.
    #[arg(long, default_value_t = 15, value_parser = clap::value_parser!(u32).range(1..=1000))]
    repeats: u32,
    /// The Python that has OpenCV.
    #[arg(long, default_value = "python3", value_name = "PROGRAM")]
    python: String,
}

pub fn run(args: &Args, console: Console) -> Result<(), Failure> {
    let bench = vision(args.points, args.repeats, &args.python, clock)?;
    let opencv = bench.opencv.as_ref();
    console.say(format!("{} points, one thread, ns per point (ratio to OpenCV)", args.points))?;
    for (name, times) in [(bench.instructions, &bench.best), ("baseline", &bench.baseline)] {
        console.say(format!("{name:>10}: {}", times.in_words(opencv.ok())))?;
    }
    console.say(format!("{:>10}: {}", "anew", bench.anew.in_words(None)))?;
    match opencv {
        Ok(peer) => console.say(format!(
            "{:>10}: project {:.1} (distortPoints), with derivatives {:.1} (projectPoints), unproject {:.1} (version {})",
            "OpenCV", peer.project_ns, peer.derivatives_ns, peer.unproject_ns, peer.version
        ))?,
        Err(why) => console.say(format!("OpenCV was not measured: {why}"))?,
    }
    console.say(format!("largest error of a ray over 0° to 99°: {:.1e} rad", bench.max_ray_error))?;
    for lens in &bench.lenses {
        console.say(format!("{:>30}: {}", lens.name, lens.in_words()))?;
    }
    for level in &bench.levels {
        console.say(format!("{:>30}: {}", level.model.to_string(), level.in_words()))?;
    }
    for (points, times) in &bench.growth {
        console.say(format!("{points:>10} points: {}", times.in_words(None)))?;
    }
    console.result(&bench.json())
}
