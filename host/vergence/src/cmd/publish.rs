//! The results of the live loop for people, as files and for programs.
//!
//! In a folder, `cloud.ply` is always the newest cloud, written whole; it is removed while one camera is dead, so that nobody
//! takes an old cloud for a new one, and `bearings.csv` is written instead. With `--json` each result is one line of JSON.

use std::io::ErrorKind;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use serde_json::{Value, json};
use vergence_board::HostClock;
use vergence_files::write_whole;
use vergence_live::{Limit, LiveResult, Pace, Totals};
use vergence_output::{
    PlyEncoding, PoseSource, Table, TableFormat, axes_by_images_json, axes_by_images_words, drift_warning,
    dropped_json, ply, pose_told_json, pose_told_words,
};
use vergence_pipeline::{Bearing, CameraGone, Observation, PairCloud};
use vergence_protocol::Microseconds;
use vergence_recording::Recorder;
use vergence_rig::{Rig, RigPose, axes_json, rounded};
use vergence_scene::LensChoice;
use vergence_vision::{Side, median};

use crate::console::Console;
use crate::failure::Failure;

/// Where results go.
pub struct Publisher {
    /// Prints lines for people or programs.
    pub console: Console,
    /// The rig that measures.
    pub rig: Arc<Rig>,
    /// The lenses of simulated cameras; `None` of attached ones.
    pub lens: Option<LensChoice>,
    /// A folder for files; `None` writes none.
    pub out: Option<PathBuf>,
    /// Write a numbered file for every result, instead of one file with the newest.
    pub keep: bool,
    /// Tables beside the PLY files.
    pub also: Vec<TableFormat>,
    /// How clouds are written.
    pub encoding: PlyEncoding,
    /// Number of results so far.
    pub number: u64,
    /// Where clouds are recorded too, and the clock of their exposures.
    pub recorder: Option<(Recorder, HostClock)>,
    /// How often they come.
    pub pace: Pace,
}

impl Publisher {
    /// Prints and writes one result.
    ///
    /// # Errors
    /// Where a file or standard output cannot be written.
    pub fn publish(&mut self, result: &LiveResult<'_>) -> Result<(), Failure> {
        self.number += 1;
        let pace = self.pace.note(result);
        match &result.measurement.observation {
            Observation::Points { cloud, pose, moving, by_images } => {
                self.write_cloud(cloud)?;
                if let Some((recorder, clock)) = &self.recorder {
                    let exposed =
                        clock.now().0.saturating_sub(u64::try_from(result.latency.as_micros()).unwrap_or(u64::MAX));
                    recorder.cloud(Microseconds(exposed), cloud, pose);
                }
                let by_axes = axes_by_images_words(&self.rig, by_images).map(|told| format!("pose by images: {told}"));
                let told = by_axes.or_else(|| pose_told_words(cloud)).map(|told| format!("; {told}"));
                self.console.say(self.points_line(result, cloud, pose, (*moving, pace)) + &told.unwrap_or_default())?;
                // Where no encoder tells an axis, nothing is left for the images to disagree with.
                let warning = drift_warning(cloud, self.pose_source()).filter(|_| by_images.is_empty());
                if let Some(warning) = &warning {
                    self.console.warn(format!("cloud {}: {warning}", self.number));
                    if let Some((recorder, clock)) = &self.recorder {
                        recorder.warning(clock.now(), warning);
                    }
                }
                self.print_json(|| {
                    let mut line = self.points_json(result, cloud, pose, *moving);
                    line["rate_hz"] = json!(pace.map(|(rate, _)| rounded(rate)));
                    line["limited_by"] = json!(pace.map(|(_, limit)| limit.as_str()));
                    line["axes_by_images"] = axes_by_images_json(&self.rig, by_images);
                    line["warning"] = json!(warning);
                    line
                })
            }
            Observation::Bearings { side, bearings, why } => {
                self.write_bearings(bearings)?;
                self.console.say(format!(
                    "{:5}  {} bearings of the {side} camera, no range: the {} camera is dead ({why}); {}",
                    self.number,
                    bearings.len(),
                    side.other(),
                    timing(result)
                ))?;
                self.print_json(|| self.bearings_json(result, *side, bearings, why))
            }
        }
    }

    /// Prints the totals.
    ///
    /// # Errors
    /// Where standard output cannot be written.
    pub fn end(&self, totals: &Totals) -> Result<(), Failure> {
        let skipped = in_words(totals);
        self.console.say(format!("{} clouds, {} sets of bearings{skipped}", totals.clouds, totals.bearings))?;
        self.console.result(&json!({
            "kind": "end",
            "clouds": totals.clouds,
            "bearings": totals.bearings,
            "skipped": skipped_json(totals),
        }))
    }

    /// A whole cloud in JSON is only made where somebody reads it.
    fn print_json(&self, json: impl FnOnce() -> Value) -> Result<(), Failure> {
        if self.console.is_json() { self.console.result(&json()) } else { Ok(()) }
    }

    fn points_line(
        &self,
        result: &LiveResult<'_>,
        cloud: &PairCloud,
        pose: &RigPose,
        (moving, pace): (bool, Option<(f64, Limit)>),
    ) -> String {
        let axes = self.rig.axes.iter().zip(&pose.axes).map(|(axis, at)| format!("{} {at:.2}", axis.name));
        let axes = axes.collect::<Vec<_>>().join(", ");
        let moving = if moving { ", moving" } else { "" };
        let place = if axes.is_empty() { String::new() } else { format!(" at {axes}{moving}") };
        let extrapolated = match cloud.extrapolated() {
            0 => String::new(),
            count => format!(", {count} of them extrapolated"),
        };
        let parts = cloud.points.iter().map(|point| point.point.sigma_range.mm() / point.point.point.mm().norm());
        let sigma =
            median(parts.collect()).map_or_else(String::new, |part| format!(", ranges to {:.1} %", 100.0 * part));
        let pace =
            pace.map(|(rate, limit)| format!("{rate:.1} Hz, limited by {}, ", limit.as_str())).unwrap_or_default();
        format!(
            "{:5}  {} points{extrapolated}{sigma}{place}; {pace}{}",
            self.number,
            cloud.points.len(),
            timing(result)
        )
    }

    fn points_json(&self, result: &LiveResult<'_>, cloud: &PairCloud, pose: &RigPose, moving: bool) -> Value {
        let placed = pose.base_from_left;
        let mut line = self.head_json("cloud", result);
        line["points"] = cloud.points.len().into();
        line["extrapolated"] = cloud.extrapolated().into();
        line["matches"] = cloud.matches.into();
        line["dropped"] = dropped_json(&cloud.dropped);
        line["axes"] = axes_json(&self.rig, &pose.axes);
        line["moving"] = moving.into();
        line["beyond_calibration"] = json!(self.rig.extrapolations(&pose.axes));
        line["base_from_left"] = json!({
            "origin_mm": placed.origin().mm().as_slice(),
            "rotation_vector": placed.rotation().scaled_axis().as_slice(),
        });
        line["pose_source"] = pose_told_json(pose, cloud);
        line["cloud"] = Table::of_points(&cloud.points).json();
        line
    }

    fn bearings_json(&self, result: &LiveResult<'_>, side: Side, bearings: &[Bearing], why: &CameraGone) -> Value {
        let mut line = self.head_json("bearings", result);
        line["camera"] = side.to_string().into();
        line["dead"] = json!({ "camera": side.other().to_string(), "why": why.to_string() });
        line["bearings"] = Table::of_bearings(bearings).json();
        line
    }

    fn head_json(&self, kind: &str, result: &LiveResult<'_>) -> Value {
        json!({
            "kind": kind,
            "simulated_lens": self.lens.map(|lens| lens.to_string()),
            "number": self.number,
            "exposed_us": rounded(result.measurement.middle.us),
            "exposed_error_us": rounded(result.measurement.middle.error_us),
            "latency_ms": result.latency.as_micros() as f64 / 1000.0,
            "work_ms": rounded(result.measurement.seconds * 1e3),
            "skipped": skipped_json(result.totals),
        })
    }

    fn write_cloud(&self, cloud: &PairCloud) -> Result<(), Failure> {
        let Some(folder) = &self.out else { return Ok(()) };
        self.withdraw(folder, "bearings", &["csv", "json"])?;
        write_whole(&self.file(folder, "cloud", "ply"), &ply(&cloud.points, self.encoding))?;
        let table = Table::of_points(&cloud.points);
        self.also.iter().try_for_each(|format| {
            Ok(write_whole(&self.file(folder, "cloud", format.extension()), table.text(*format).as_bytes())?)
        })
    }

    fn write_bearings(&self, bearings: &[Bearing]) -> Result<(), Failure> {
        let Some(folder) = &self.out else { return Ok(()) };
        self.withdraw(folder, "cloud", &["ply", "csv", "json"])?;
        let table = Table::of_bearings(bearings);
        let formats = if self.also.is_empty() { &[TableFormat::Csv][..] } else { &self.also };
        formats.iter().try_for_each(|format| {
            Ok(write_whole(&self.file(folder, "bearings", format.extension()), table.text(*format).as_bytes())?)
        })
    }

    fn pose_source(&self) -> PoseSource {
        if self.rig.axes.is_empty() { PoseSource::RigFile } else { PoseSource::Encoders }
    }

    fn file(&self, folder: &Path, stem: &str, extension: &str) -> PathBuf {
        match self.keep {
            true => folder.join(format!("{stem}{:06}.{extension}", self.number)),
            false => folder.join(format!("{stem}.{extension}")),
        }
    }

    /// Removes files that are no longer the newest result.
    fn withdraw(&self, folder: &Path, stem: &str, extensions: &[&str]) -> Result<(), Failure> {
        if self.keep {
            return Ok(());
        }
        for extension in extensions {
            let path = folder.join(format!("{stem}.{extension}"));
            match std::fs::remove_file(&path) {
                Err(error) if error.kind() != ErrorKind::NotFound => return Err(Failure::output(&path, error)),
                _ => {}
            }
        }
        Ok(())
    }
}

fn timing(result: &LiveResult<'_>) -> String {
    let skipped: u64 = result.totals.skipped.values().sum();
    format!("{} ms after the exposure, {skipped} skipped so far", result.latency.as_millis())
}

fn skipped_json(totals: &Totals) -> Value {
    totals.skipped.iter().map(|(reason, count)| (reason.as_str().to_owned(), json!(count))).collect()
}

fn in_words(totals: &Totals) -> String {
    let reasons: Vec<_> = totals.skipped.iter().map(|(reason, count)| format!("{} {count}", reason.as_str())).collect();
    if reasons.is_empty() { String::new() } else { format!("; skipped: {}", reasons.join(", ")) }
}
