//! The results of the live loop for people, as files and for programs. With `--json` each result is one line of JSON.

use std::path::Path;
use std::sync::Arc;

use serde_json::{Value, json};
use vergence_board::HostClock;
use vergence_live::{Ended, LiveResult, Notice, Rung, Totals};
use vergence_output::{
    LatestFiles, PoseSource, axes_by_images_json, axes_by_images_words, drift_warning, live_bearings_json,
    live_cloud_json, live_cloud_words, point_limit_json, point_limit_words, pose_told_words,
};
use vergence_peers::Publication;
use vergence_pipeline::Observation;
use vergence_recording::{Recorded, Recorder};
use vergence_rig::{Rig, rounded};
use vergence_scene::LensChoice;

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
    /// Where results go as files.
    pub files: LatestFiles,
    /// Number of results so far.
    pub number: u64,
    /// The clock of exposures.
    pub clock: HostClock,
    /// Where clouds are recorded too.
    pub recorder: Option<Recorder>,
    /// Where they are published for other machines.
    pub publication: Option<Publication>,
}

impl Publisher {
    /// Prints and writes one result.
    ///
    /// # Errors
    /// Where a file or standard output cannot be written.
    pub fn publish(&mut self, result: &LiveResult<'_>) -> Result<(), Failure> {
        self.number += 1;
        match &result.measurement.observation {
            Observation::Points { cloud, pose, moving, by_images } => {
                let dense = result.measurement.dense.as_ref();
                self.files.write_pair(self.number, (&cloud.points, dense), (&self.rig, pose))?;
                let exposed = result.exposed(self.clock.now());
                self.recorder.iter().for_each(|recorder| recorder.result(self.clock.now(), result));
                self.publication.iter().for_each(|publication| publication.cloud(exposed, cloud, pose));
                let by_axes = axes_by_images_words(&self.rig, by_images).map(|told| format!("pose by images: {told}"));
                let told = by_axes.or_else(|| pose_told_words(cloud)).map(|told| format!("; {told}"));
                let unseen = result.measurement.unseen.map(|time| time.as_secs_f64());
                let unseen_words = unseen.map(|time| format!("; no link, last readings {time:.1} s before"));
                let points = live_cloud_words(&self.rig, (cloud, dense), pose, *moving);
                self.console.say(
                    self.points_line(result, &points) + &told.unwrap_or_default() + &unseen_words.unwrap_or_default(),
                )?;
                // Where no encoder tells an axis, nothing is left for the images to disagree with.
                let warning = drift_warning(cloud, self.pose_source()).filter(|_| by_images.is_empty());
                if let Some(warning) = &warning {
                    self.console.warn(format!("cloud {}: {warning}", self.number));
                    self.recorder.iter().for_each(|recorder| recorder.warning(self.clock.now(), warning));
                }
                self.print_json(|| {
                    let told = live_cloud_json(&self.rig, (cloud, dense), pose, *moving);
                    let mut line = self.result_json("cloud", result, told);
                    line["rate_hz"] = json!(result.pace.map(|(rate, _)| rounded(rate)));
                    line["points_limit"] = point_limit_json(result.limited);
                    line["limited_by"] = json!(result.pace.map(|(_, limit)| limit.as_str()));
                    line["axes_by_images"] = axes_by_images_json(&self.rig, by_images);
                    line["link_lost_s"] = json!(unseen.map(rounded));
                    line["warning"] = json!(warning);
                    line
                })
            }
            Observation::Bearings { side, bearings, why } => {
                self.files.write_bearings(self.number, bearings)?;
                self.console.say(format!(
                    "{:5}  {} bearings of the {side} camera, no range: the {} camera is dead ({why}); {}",
                    self.number,
                    bearings.len(),
                    side.other(),
                    timing(result)
                ))?;
                self.print_json(|| self.result_json("bearings", result, live_bearings_json(*side, bearings, why)))
            }
        }
    }

    /// A whole cloud in JSON is only made where somebody reads it.
    fn print_json(&self, json: impl FnOnce() -> Value) -> Result<(), Failure> {
        if self.console.is_json() { self.console.result(&json()) } else { Ok(()) }
    }

    fn points_line(&self, result: &LiveResult<'_>, points: &str) -> String {
        let pace = result.pace.map(|(rate, limit)| format!("{rate:.1} Hz, limited by {}, ", limit.as_str()));
        let pace = pace.unwrap_or_default();
        let few = result.limited.map(point_limit_words).unwrap_or_default();
        format!("{:5}  {points}; {pace}{few}{}", self.number, timing(result))
    }

    /// What all results say, and `more` of this one.
    fn result_json(&self, kind: &str, result: &LiveResult<'_>, more: Value) -> Value {
        let mut line = self.head_json(kind, result);
        if let (Some(line), Value::Object(more)) = (line.as_object_mut(), more) {
            line.extend(more);
        }
        line
    }

    fn head_json(&self, kind: &str, result: &LiveResult<'_>) -> Value {
        let without: Vec<_> = Rung::of(result).into_iter().map(Rung::as_str).collect();
        json!({
            "kind": kind,
            "simulated_lens": self.lens.map(|lens| lens.to_string()),
            "number": self.number,
            "exposed_us": rounded(result.measurement.middle.us),
            "exposed_error_us": rounded(result.measurement.middle.error_us),
            "latency_ms": result.latency.as_micros() as f64 / 1000.0,
            "work_ms": rounded(result.measurement.seconds * 1e3),
            "skipped": result.totals.skipped_json(),
            "without": without,
        })
    }

    fn pose_source(&self) -> PoseSource {
        if self.rig.axes.is_empty() { PoseSource::RigFile } else { PoseSource::Encoders }
    }
}

fn timing(result: &LiveResult<'_>) -> String {
    let skipped: u64 = result.totals.skipped.values().sum();
    format!("{} ms after the exposure, {skipped} skipped so far", result.latency.as_millis())
}

/// Warns people, and tells programs of a step down or up.
pub fn tell_notice(notice: &Notice, console: Console) {
    console.warn(notice);
    // A closed standard output is found by the next result.
    let _ = notice.json().map(|step| console.result(&step));
}

/// Prints totals.
///
/// # Errors
/// Where standard output cannot be written.
pub fn tell(totals: &Totals, console: Console) -> Result<(), Failure> {
    let Totals { clouds, bearings, .. } = totals;
    console.say(format!("{clouds} clouds, {bearings} sets of bearings{}", totals.skipped_in_words()))?;
    console.result(&totals.json())
}

/// Says what is in a recording, and what is not.
pub fn tell_recorded(recorded: Recorded, folder: &Path, console: Console) -> Result<(), Failure> {
    recorded.warnings().into_iter().for_each(|said| console.warn(said));
    console.say(format!("recorded {} images in {}", recorded.images, folder.display()))
}

/// Whether a camera was alive at the end.
pub fn seen_to_the_end(ended: Option<Ended>) -> Result<(), Failure> {
    match ended {
        Some(Ended::Done) | None => Ok(()),
        Some(Ended::Blind) => Err(Failure::device("both cameras are dead: see what was said of each above")),
    }
}
