//! The files of a dense measurement, and what is said of it.

use std::path::{Path, PathBuf};

use image::RgbImage;
use rayon::prelude::*;
use serde_json::{Map, Value, json};
use vergence_files::{FileError, write_png, write_whole};
use vergence_matching::{DenseDepth, DenseSample};
use vergence_pipeline::{DenseRanges, PairImages, StageTimes, colour_at};
use vergence_rig::{Rig, RigPose, rounded};
use vergence_vision::{Left, Pixel, Point};

use crate::cloud_report::{drift_json, extrapolated_line};
use crate::pictures::{DepthView, confidence_image, dense_svg, makes_a_point, range_image, sigma_image, write_drawing};
use crate::points::{CloudFormat, DenseRow};

/// A range for every pixel of a left image, written as a cloud with images beside it.
pub struct DenseCloud<'a> {
    ranges: &'a DenseRanges,
    times: &'a StageTimes,
    points: usize,
    /// Those of them where a lens is extrapolated.
    extrapolated: usize,
    /// The file of the cloud.
    out: &'a Path,
}

impl<'a> DenseCloud<'a> {
    /// Writes `ranges`, which were measured in `images` taken at `pose`: the cloud to `out` in the format of its ending, as text where it
    /// `is_ascii`, and beside it PNG images of range, sigma and confidence, a preview as SVG, and the image of a depth camera with its K.
    ///
    /// # Errors
    /// [`FileError::Write`].
    pub fn write(
        ranges: &'a DenseRanges,
        times: &'a StageTimes,
        images: PairImages<'_>,
        (rig, pose): (&Rig, &RigPose),
        (out, is_ascii): (&'a Path, bool),
    ) -> Result<Self, FileError> {
        let depth = &ranges.depth;
        let rows = dense_rows(depth, images.left, (rig, pose));
        let format = CloudFormat::of_file(out);
        let cloud = || {
            let bytes = format.encoding(is_ascii).and_then(|encoding| format.dense_cloud(&rows, encoding));
            write_whole(out, &bytes.map_err(|error| FileError::write(out, error))?)
        };
        let view = || {
            let view = DepthView::new(depth, (images.left, &rig.left_camera), &pose.left_from_right)
                .map_err(|error| FileError::write(&beside(out, "depth", "png"), error))?;
            write_png(&beside(out, "depth", "png"), &view.depth)?;
            write_png(&beside(out, "depth-image", "png"), &view.image)?;
            write_whole(&beside(out, "depth", "yaml"), view.yaml().as_bytes())
        };
        // Files of some megabytes each, which have nothing to do with each other.
        let files: [&(dyn Fn() -> Result<(), FileError> + Sync); 6] = [
            &cloud,
            &view,
            &|| write_drawing(&beside(out, "preview", "svg"), dense_svg(images.left, depth)),
            &|| write_png(&beside(out, "range", "png"), &range_image(depth)),
            &|| write_png(&beside(out, "sigma", "png"), &sigma_image(depth)),
            &|| write_png(&beside(out, "confidence", "png"), &confidence_image(depth)),
        ];
        files.par_iter().map(|write| write()).collect::<Vec<_>>().into_iter().collect::<Result<(), _>>()?;
        let extrapolated = rows.iter().filter(|row| row.extrapolated).count();
        Ok(Self { ranges, times, points: rows.len(), extrapolated, out })
    }

    /// Whether no pixel has a range or is known to be far.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        let counts = self.ranges.depth.counts();
        counts.measured == 0 && counts.far == 0
    }

    /// Counts, gaps by reason, and times, for people.
    #[must_use]
    pub fn in_words(&self) -> String {
        let counts = self.ranges.depth.counts();
        let pixels = self.ranges.depth.samples().len();
        let percent = |count: usize| 100.0 * count as f64 / pixels.max(1) as f64;
        let gaps: Vec<_> = counts.gaps.iter().map(|(gap, &count)| format!("{gap} {:.1} %", percent(count))).collect();
        let seconds = self.times.seconds();
        let stages: Vec<_> =
            seconds.iter().map(|(stage, seconds)| format!("{} {seconds:.2}", stage.as_str())).collect();
        format!(
            "{} points in {}{}\n  pixels   {pixels}: {:.1} % have a range, {:.1} % are farther than measurable\n  \
             none     {}\n  seconds  {}, in all {:.2}",
            self.points,
            self.out.display(),
            extrapolated_line(self.extrapolated).map_or_else(String::new, |line| format!("\n{line}")),
            percent(counts.measured),
            percent(counts.far),
            if gaps.is_empty() { "nowhere".into() } else { gaps.join(", ") },
            stages.join(", "),
            seconds.iter().map(|(_, seconds)| seconds).sum::<f64>(),
        )
    }

    /// The same for programs, with the names of all files.
    #[must_use]
    pub fn json(&self) -> Value {
        let counts = self.ranges.depth.counts();
        let pixels = self.ranges.depth.samples().len();
        let gaps: Map<_, _> = counts.gaps.iter().map(|(gap, &count)| (gap.to_string(), json!(count))).collect();
        let seconds = self.times.seconds().iter();
        let seconds: Map<_, _> =
            seconds.map(|&(stage, seconds)| (stage.as_str().to_owned(), json!(rounded(seconds)))).collect();
        json!({
            "points": self.points,
            "extrapolated": self.extrapolated,
            "pixels": pixels,
            "measured": counts.measured,
            "measured_share": rounded(counts.measured as f64 / pixels.max(1) as f64),
            "far": counts.far,
            "gaps": gaps,
            "pose_drift": drift_json(self.ranges.pose_drift.as_ref()),
            "stage_seconds": seconds,
            "out": self.out,
            "range_png": beside(self.out, "range", "png"),
            "sigma_png": beside(self.out, "sigma", "png"),
            "confidence_png": beside(self.out, "confidence", "png"),
            "depth_png": beside(self.out, "depth", "png"),
            "depth_image_png": beside(self.out, "depth-image", "png"),
            "depth_yaml": beside(self.out, "depth", "yaml"),
            "preview_svg": beside(self.out, "preview", "svg"),
        })
    }
}

/// `cloud-range.png` beside `cloud.ply`.
fn beside(out: &Path, what: &str, ending: &str) -> PathBuf {
    let stem = out.file_stem().unwrap_or_default().to_string_lossy();
    out.with_file_name(format!("{stem}-{what}.{ending}"))
}

/// A row for each point whose own range is known to a twentieth, as in the sparse cloud.
pub(crate) fn dense_rows(depth: &DenseDepth, left: &RgbImage, (rig, pose): (&Rig, &RigPose)) -> Vec<DenseRow> {
    let right_from_left = pose.right_from_left();
    let width = depth.size().width.max(1);
    let row = |(pixel, sample): (Pixel, &DenseSample)| {
        let DenseSample::Measured(measured) = sample else { return None };
        if !makes_a_point(measured) {
            return None;
        }
        let ray = rig.left_camera.unproject::<Left>(pixel).ok()?;
        let start = rig.left_camera.origin_of(&ray);
        let point = Point::<Left>::from_mm(start.mm() + ray.at(measured.range().mm()).mm());
        let right_ray = rig.right_camera.ray_to(&(right_from_left * point))?;
        let in_right = rig.right_camera.project(&right_ray).ok()?;
        Some(DenseRow {
            point: point.mm().map(|mm| mm as f32).into(),
            colour: colour_at(left, pixel),
            pixels: [pixel.u, pixel.v, in_right.u, in_right.v].map(|value| value as f32),
            sigma: measured.sigma().mm() as f32,
            extrapolated: !(rig.left_camera.is_measured(&ray) && rig.right_camera.is_measured(&right_ray)),
        })
    };
    let line = |(v, samples): (usize, &[DenseSample])| {
        let pixels = (0..width).map(move |u| Pixel { u: f64::from(u), v: v as f64 });
        pixels.zip(samples).filter_map(row).collect::<Vec<_>>()
    };
    let lines: Vec<_> = depth.samples().par_chunks(width as usize).enumerate().map(line).collect();
    lines.concat()
}
