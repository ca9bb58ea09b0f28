//! What the live loop gives to people, to files and to programs.
//!
//! In a folder, `cloud.ply` is always the newest cloud, written whole; it is taken away while one camera is dead, so that nobody
//! takes an old cloud for a new one, and `bearings.csv` stands in its place. To programs each result is one line of JSON.

use std::io::ErrorKind;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use serde_json::{Value, json};
use vergence_rig::{Rig, RigPose};
use vergence_vision::Side;

use super::live_loop::{Told, Totals};
use super::measure::Seen;
use crate::cmd::report::{axes_json, rounded};
use crate::console::Console;
use crate::failure::Failure;
use crate::look::{Bearing, Look};
use crate::output::{Table, TableFormat, ply, write_whole};

/// Where results go.
pub struct Publisher {
    /// Lines for people or programs.
    pub console: Console,
    /// The rig that measures.
    pub rig: Arc<Rig>,
    /// A folder for files.
    pub out: Option<PathBuf>,
    /// A numbered file for every result, instead of one with the newest.
    pub keep: bool,
    /// Tables beside the PLY files.
    pub also: Vec<TableFormat>,
    /// Results so far.
    pub number: u64,
}

impl Publisher {
    /// Gives out one result.
    ///
    /// # Errors
    /// Where a file or standard output cannot be written.
    pub fn publish(&mut self, told: &Told<'_>) -> Result<(), Failure> {
        self.number += 1;
        match &told.measured.seen {
            Seen::Points { look, pose, moving } => {
                self.write_cloud(look)?;
                self.console.say(self.points_line(told, look, pose, *moving))?;
                if let Some(warning) = look.warning() {
                    self.console.say(format!("  warning: {warning}"))?;
                }
                self.result(|| self.points_json(told, look, pose, *moving))
            }
            Seen::Bearings { side, bearings, why } => {
                self.write_bearings(bearings)?;
                self.console.say(format!(
                    "{:5}  {} bearings of the {side} camera, no range: the {} camera is dead ({why}); {}",
                    self.number,
                    bearings.len(),
                    side.other(),
                    timing(told)
                ))?;
                self.result(|| self.bearings_json(told, *side, bearings, why))
            }
        }
    }

    /// What became of everything.
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
            "skipped": totals.skipped,
        }))
    }

    /// A whole cloud in JSON is only made where somebody reads it.
    fn result(&self, json: impl FnOnce() -> Value) -> Result<(), Failure> {
        if self.console.is_json() { self.console.result(&json()) } else { Ok(()) }
    }

    fn points_line(&self, told: &Told<'_>, look: &Look, pose: &RigPose, moving: bool) -> String {
        let axes = self.rig.axes.iter().zip(&pose.axes).map(|(axis, at)| format!("{} {at:.2}", axis.name));
        let axes = axes.collect::<Vec<_>>().join(", ");
        let moving = if moving { ", moving" } else { "" };
        let place = if axes.is_empty() { String::new() } else { format!(" at {axes}{moving}") };
        format!("{:5}  {} points{place}; {}", self.number, look.points.len(), timing(told))
    }

    fn points_json(&self, told: &Told<'_>, look: &Look, pose: &RigPose, moving: bool) -> Value {
        let placed = pose.base_from_left;
        let mut line = self.head_json("cloud", told);
        line["points"] = look.points.len().into();
        line["matches"] = look.matches.into();
        line["dropped"] = json!(look.dropped);
        line["axes"] = axes_json(&self.rig, &pose.axes);
        line["moving"] = moving.into();
        line["beyond_calibration"] = json!(self.rig.extrapolations(&pose.axes));
        line["base_from_left"] = json!({
            "origin_mm": placed.origin().mm().as_slice(),
            "rotation_vector": placed.rotation().scaled_axis().as_slice(),
        });
        line["warning"] = json!(look.warning());
        line["cloud"] = Table::of_points(&look.points).json();
        line
    }

    fn bearings_json(&self, told: &Told<'_>, side: Side, bearings: &[Bearing], why: &str) -> Value {
        let mut line = self.head_json("bearings", told);
        line["camera"] = side.to_string().into();
        line["dead"] = json!({ "camera": side.other().to_string(), "why": why });
        line["bearings"] = Table::of_bearings(bearings).json();
        line
    }

    fn head_json(&self, kind: &str, told: &Told<'_>) -> Value {
        json!({
            "kind": kind,
            "number": self.number,
            "exposed_us": rounded(told.measured.middle.us),
            "exposed_error_us": rounded(told.measured.middle.error_us),
            "latency_ms": told.latency.as_micros() as f64 / 1000.0,
            "work_ms": rounded(told.measured.seconds * 1e3),
            "skipped": told.totals.skipped,
        })
    }

    fn write_cloud(&self, look: &Look) -> Result<(), Failure> {
        let Some(folder) = &self.out else { return Ok(()) };
        self.withdraw(folder, "bearings", &["csv", "json"])?;
        write_whole(&self.file(folder, "cloud", "ply"), ply(&look.points).as_bytes())?;
        let table = Table::of_points(&look.points);
        self.also.iter().try_for_each(|format| {
            write_whole(&self.file(folder, "cloud", format.extension()), table.text(*format).as_bytes())
        })
    }

    fn write_bearings(&self, bearings: &[Bearing]) -> Result<(), Failure> {
        let Some(folder) = &self.out else { return Ok(()) };
        self.withdraw(folder, "cloud", &["ply", "csv", "json"])?;
        let table = Table::of_bearings(bearings);
        let formats = if self.also.is_empty() { &[TableFormat::Csv][..] } else { &self.also };
        formats.iter().try_for_each(|format| {
            write_whole(&self.file(folder, "bearings", format.extension()), table.text(*format).as_bytes())
        })
    }

    fn file(&self, folder: &Path, stem: &str, extension: &str) -> PathBuf {
        match self.keep {
            true => folder.join(format!("{stem}{:06}.{extension}", self.number)),
            false => folder.join(format!("{stem}.{extension}")),
        }
    }

    /// Takes away what is not the newest any more.
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

fn timing(told: &Told<'_>) -> String {
    let skipped: u64 = told.totals.skipped.values().sum();
    format!("{} ms after the exposure, {skipped} skipped so far", told.latency.as_millis())
}

fn in_words(totals: &Totals) -> String {
    let reasons: Vec<_> = totals.skipped.iter().map(|(reason, count)| format!("{reason} {count}")).collect();
    if reasons.is_empty() { String::new() } else { format!("; skipped: {}", reasons.join(", ")) }
}
