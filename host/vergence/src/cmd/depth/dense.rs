//! `vergence depth --dense`: a range for every pixel of the left image.

use std::path::{Path, PathBuf};

use serde_json::{Map, Value, json};
use vergence_camera::CameraImage;
use vergence_matching::{DenseDepth, DenseSample};
use vergence_pipeline::gates::MAX_RELATIVE_SIGMA;
use vergence_pipeline::{PairImages, colour_at, dense_ranges};
use vergence_rig::{Rig, RigPose};
use vergence_vision::{Left, Pixel};

use super::check_size;
use crate::cmd::report::rounded;
use crate::console::Console;
use crate::failure::Failure;
use crate::output::{
    DenseRow, confidence_image, dense_ply, dense_svg, range_image, sigma_image, write_png, write_whole,
};
use crate::stage_times::StageTimes;

/// Measures one pair and writes the cloud to `out` and images beside it.
pub(super) fn one_pair(
    [left, right]: [&CameraImage; 2],
    rig: &Rig,
    pose: &RigPose,
    out: &Path,
    console: Console,
) -> Result<Value, Failure> {
    check_size(left, rig.left_camera.size(), "left")?;
    check_size(right, rig.right_camera.size(), "right")?;
    let images = PairImages { left: &left.image, right: &right.image };
    let mut times = StageTimes::start();
    let depth = dense_ranges(images, rig, pose, &mut |stage| times.ended(stage))
        .map_err(|error| Failure::usage(format!("{} and {}: {error}", left.name, right.name)))?;
    let rows = rows(&depth, images, rig, pose);
    write_whole(out, &dense_ply(&rows))?;
    let beside = |what: &str, ending: &str| beside(out, what, ending);
    write_png(&beside("range", "png"), &range_image(&depth))?;
    write_png(&beside("sigma", "png"), &sigma_image(&depth))?;
    write_png(&beside("confidence", "png"), &confidence_image(&depth))?;
    let preview = beside("preview", "svg");
    let drawn = dense_svg(images.left, &depth).map_err(|error| Failure::output(&preview, error))?;
    write_whole(&preview, drawn.as_bytes())?;
    print(&depth, &times, rows.len(), out, console)?;
    Ok(result(&depth, &times, rows.len(), out))
}

/// `cloud-range.png` beside `cloud.ply`.
fn beside(out: &Path, what: &str, ending: &str) -> PathBuf {
    let stem = out.file_stem().unwrap_or_default().to_string_lossy();
    out.with_file_name(format!("{stem}-{what}.{ending}"))
}

/// A row for each point whose own range is known to a twentieth, as in the sparse cloud.
fn rows(depth: &DenseDepth, images: PairImages<'_>, rig: &Rig, pose: &RigPose) -> Vec<DenseRow> {
    let right_from_left = pose.right_from_left();
    let width = depth.size().width.max(1);
    let row = |(index, sample): (u32, &DenseSample)| {
        let DenseSample::Measured(measured) = sample else { return None };
        if measured.own_sigma().mm() > MAX_RELATIVE_SIGMA * measured.range().mm() {
            return None;
        }
        let pixel = Pixel { u: f64::from(index % width), v: f64::from(index / width) };
        let point = rig.left_camera.unproject::<Left>(pixel).ok()?.at(measured.range().mm());
        let in_right = rig.right_camera.project_point(&(right_from_left * point)).ok()?;
        Some(DenseRow {
            point: point.mm().map(|mm| mm as f32).into(),
            colour: colour_at(images.left, pixel),
            pixels: [pixel.u, pixel.v, in_right.u, in_right.v].map(|value| value as f32),
            sigma: measured.sigma().mm() as f32,
        })
    };
    (0..).zip(depth.samples()).filter_map(row).collect()
}

fn print(depth: &DenseDepth, times: &StageTimes, points: usize, out: &Path, console: Console) -> Result<(), Failure> {
    let counts = depth.counts();
    let pixels = depth.samples().len();
    let percent = |count: usize| 100.0 * count as f64 / pixels.max(1) as f64;
    let gaps: Vec<_> = counts.gaps.iter().map(|(gap, &count)| format!("{gap} {:.1} %", percent(count))).collect();
    let stages: Vec<_> =
        times.seconds().iter().map(|(stage, seconds)| format!("{} {seconds:.2}", stage.as_str())).collect();
    console.say(format!(
        "{points} points in {}\n  pixels   {pixels}: {:.1} % have a range, {:.1} % are farther than measurable\n  \
         none     {}\n  seconds  {}, in all {:.2}",
        out.display(),
        percent(counts.measured),
        percent(counts.far),
        if gaps.is_empty() { "nowhere".into() } else { gaps.join(", ") },
        stages.join(", "),
        times.seconds().iter().map(|(_, seconds)| seconds).sum::<f64>(),
    ))
}

/// Whether no pixel of a result has a range or is known to be far.
pub(super) fn is_empty(result: &Value) -> bool {
    result["measured"] == 0 && result["far"] == 0
}

/// The failure for pairs without any range. Their files are written all the same: every pixel is a gap.
pub(super) fn nothing_seen(names: &[String]) -> Failure {
    Failure::check(format!(
        "no pixel of {} has a range: the images are dark, without texture, or not of this pose",
        names.join(", ")
    ))
}

fn result(depth: &DenseDepth, times: &StageTimes, points: usize, out: &Path) -> Value {
    let counts = depth.counts();
    let pixels = depth.samples().len();
    let gaps: Map<_, _> = counts.gaps.iter().map(|(gap, &count)| (gap.to_string(), json!(count))).collect();
    json!({
        "points": points,
        "pixels": pixels,
        "measured": counts.measured,
        "measured_share": rounded(counts.measured as f64 / pixels.max(1) as f64),
        "far": counts.far,
        "gaps": gaps,
        "stage_seconds": times.json(),
        "out": out,
        "range_png": beside(out, "range", "png"),
        "sigma_png": beside(out, "sigma", "png"),
        "confidence_png": beside(out, "confidence", "png"),
        "preview_svg": beside(out, "preview", "svg"),
    })
}
