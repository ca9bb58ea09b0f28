//! `vergence depth --dense`: a range for every pixel of the left image.

use std::path::{Path, PathBuf};

use serde_json::{Map, Value, json};
use vergence_matching::{DenseDepth, DenseSample};
use vergence_rig::{Rig, RigPose};
use vergence_vision::{Left, Pixel};

use super::check_size;
use crate::camera::Frame;
use crate::cmd::report::rounded;
use crate::console::Console;
use crate::dense::{DenseLook, dense_look};
use crate::failure::Failure;
use crate::look::{Eyes, MAX_RELATIVE_SIGMA, colour_at};
use crate::output::{
    DenseRow, confidence_image, dense_picture, dense_ply, range_image, sigma_image, write_png, write_whole,
};

/// Works through one pair and writes the cloud to `out` and images beside it.
pub(super) fn one_pair(
    [left, right]: [&Frame; 2],
    rig: &Rig,
    pose: &RigPose,
    out: &Path,
    console: Console,
) -> Result<Value, Failure> {
    check_size(left, rig.left_camera.size(), "left")?;
    check_size(right, rig.right_camera.size(), "right")?;
    let eyes = Eyes { left: &left.image, right: &right.image };
    let look = dense_look(eyes, rig, pose)
        .map_err(|error| Failure::usage(format!("{} and {}: {error}", left.name, right.name)))?;
    let rows = rows(&look.depth, eyes, rig, pose);
    write_whole(out, &dense_ply(&rows))?;
    let beside = |what: &str| beside(out, what);
    write_png(&beside("range"), &range_image(&look.depth))?;
    write_png(&beside("sigma"), &sigma_image(&look.depth))?;
    write_png(&beside("confidence"), &confidence_image(&look.depth))?;
    write_png(&beside("preview"), &dense_picture(eyes.left, &look.depth))?;
    tell(&look, rows.len(), out, console)?;
    Ok(result(&look, rows.len(), out))
}

/// `cloud-range.png` beside `cloud.ply`.
fn beside(out: &Path, what: &str) -> PathBuf {
    let stem = out.file_stem().unwrap_or_default().to_string_lossy();
    out.with_file_name(format!("{stem}-{what}.png"))
}

/// The points whose own range is known to a twentieth, as in the sparse cloud.
fn rows(depth: &DenseDepth, eyes: Eyes<'_>, rig: &Rig, pose: &RigPose) -> Vec<DenseRow> {
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
            colour: colour_at(eyes.left, pixel),
            pixels: [pixel.u, pixel.v, in_right.u, in_right.v].map(|value| value as f32),
            sigma: measured.sigma().mm() as f32,
        })
    };
    (0..).zip(depth.samples()).filter_map(row).collect()
}

fn tell(look: &DenseLook, points: usize, out: &Path, console: Console) -> Result<(), Failure> {
    let counts = look.depth.counts();
    let pixels = look.depth.samples().len();
    let percent = |count: usize| 100.0 * count as f64 / pixels.max(1) as f64;
    let gaps: Vec<_> = counts.gaps.iter().map(|(gap, &count)| format!("{gap} {:.1} %", percent(count))).collect();
    let times: Vec<_> = look.seconds.iter().map(|(stage, seconds)| format!("{stage} {seconds:.2}")).collect();
    console.say(format!(
        "{points} points in {}\n  pixels   {pixels}: {:.1} % have a range, {:.1} % are farther than measurable\n  \
         none     {}\n  seconds  {}, in all {:.2}",
        out.display(),
        percent(counts.measured),
        percent(counts.far),
        if gaps.is_empty() { "nowhere".into() } else { gaps.join(", ") },
        times.join(", "),
        look.seconds.iter().map(|(_, seconds)| seconds).sum::<f64>(),
    ))
}

/// Whether the result of a pair says that no pixel has a range, nor is known to be far.
pub(super) fn is_empty(result: &Value) -> bool {
    result["measured"] == 0 && result["far"] == 0
}

/// The files are written and say so too: every pixel is a gap.
pub(super) fn nothing_seen(names: &[String]) -> Failure {
    Failure::check(format!(
        "no pixel of {} has a range: the images are dark, without texture, or not of this pose",
        names.join(", ")
    ))
}

fn result(look: &DenseLook, points: usize, out: &Path) -> Value {
    let counts = look.depth.counts();
    let pixels = look.depth.samples().len();
    let seconds: Map<_, _> =
        look.seconds.iter().map(|&(stage, seconds)| (stage.to_owned(), json!(rounded(seconds)))).collect();
    let gaps: Map<_, _> = counts.gaps.iter().map(|(gap, &count)| (gap.to_string(), json!(count))).collect();
    json!({
        "points": points,
        "pixels": pixels,
        "measured": counts.measured,
        "measured_share": rounded(counts.measured as f64 / pixels.max(1) as f64),
        "far": counts.far,
        "gaps": gaps,
        "stage_seconds": seconds,
        "out": out,
        "range_png": beside(out, "range"),
        "sigma_png": beside(out, "sigma"),
        "confidence_png": beside(out, "confidence"),
        "preview_png": beside(out, "preview"),
    })
}
