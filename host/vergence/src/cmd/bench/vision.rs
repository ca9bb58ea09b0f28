//! `vergence bench vision`: the cost of a point.

use serde_json::{Value, json};
use vergence_bench::vision::{OpenCvTimes, VisionTimes, vision};

use crate::console::Console;
use crate::failure::Failure;
use crate::stopwatch::clock;

/// Measures arrays of N x 3 and N x 2 numbers, on one thread: nanoseconds per point, the least of several runs, with OpenCV
/// and this program taking turns. Pixels, rays, and points with the errors they share go into new arrays; points with
/// their closed-form covariance, 56 bytes each, into arrays that exist ("anew": into new ones). Without OpenCV (python3 -m
/// pip install opencv-python-headless numpy) its figures are null.
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
        console.say(format!("{name:>10}: {}", in_words(times, opencv.ok())))?;
    }
    match opencv {
        Ok(peer) => console.say(format!(
            "{:>10}: project {:.1}, unproject {:.1} (version {})",
            "OpenCV", peer.project_ns, peer.unproject_ns, peer.version
        ))?,
        Err(why) => console.say(format!("OpenCV was not measured: {why}"))?,
    }
    console.say(format!("largest error of a ray over 0° to 99°: {:.1e} rad", bench.max_ray_error))?;
    for (points, times) in &bench.growth {
        console.say(format!("{points:>10} points: {}", in_words(times, None)))?;
    }
    let opencv = |peer: &OpenCvTimes| json!({ "project_ns": peer.project_ns, "unproject_ns": peer.unproject_ns, "version": peer.version });
    console.result(&json!({
        "project_ns": bench.best.project_ns,
        "unproject_ns": bench.best.unproject_ns,
        "max_ray_error_rad": bench.max_ray_error,
        "triangulate_mpts_per_s": 1e3 / bench.best.triangulate_ns,
        "triangulate_allocated_anew_mpts_per_s": 1e3 / bench.best.triangulate_anew_ns,
        "triangulate_full_mpts_per_s": 1e3 / bench.best.full_ns,
        "instructions": bench.instructions,
        "baseline": {
            "project_ns": bench.baseline.project_ns,
            "unproject_ns": bench.baseline.unproject_ns,
            "triangulate_mpts_per_s": 1e3 / bench.baseline.triangulate_ns,
            "triangulate_full_mpts_per_s": 1e3 / bench.baseline.full_ns,
        },
        "opencv": bench.opencv.as_ref().map_or(Value::Null, opencv),
        "growth": bench.growth.iter().map(|(points, times)| growth(*points, times)).collect::<Vec<_>>(),
    }))
}

fn in_words(times: &VisionTimes, peer: Option<&OpenCvTimes>) -> String {
    let ratio = |ours: f64, theirs: f64| format!(" ({:.3})", ours / theirs);
    let project = peer.map_or(String::new(), |peer| ratio(times.project_ns, peer.project_ns));
    let unproject = peer.map_or(String::new(), |peer| ratio(times.unproject_ns, peer.unproject_ns));
    format!(
        "project {:.1}{project}, unproject {:.1}{unproject}, triangulate {:.1} (anew {:.1}, with shared errors {:.0})",
        times.project_ns, times.unproject_ns, times.triangulate_ns, times.triangulate_anew_ns, times.full_ns
    )
}

fn growth(points: u32, times: &VisionTimes) -> Value {
    json!({
        "points": points,
        "project_ns": times.project_ns,
        "unproject_ns": times.unproject_ns,
        "triangulate_ns": times.triangulate_ns,
        "triangulate_anew_ns": times.triangulate_anew_ns,
        "triangulate_full_ns": times.full_ns,
    })
}
