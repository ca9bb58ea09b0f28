//! What the calibrations share on the command line: the lenses of a pair, and what becomes of a result.

use std::path::{Path, PathBuf};

use nalgebra::SMatrix;
use serde_json::{Value, json};
use vergence_calibration::{LensKnowledge, Validation};
use vergence_calibration_report::Verdict;
use vergence_files::write_whole;
use vergence_rig::{CalibrationTable, Provenance, Shutter};
use vergence_vision::KannalaBrandt;

use crate::camera_files::{self, CameraFile};
use crate::console::Console;
use crate::failure::Failure;
use crate::provenance::InputHash;
use crate::slots::{Slots, StoreOptions};

/// Two lenses that are known, and how well.
#[derive(Debug, clap::Args)]
pub struct LensOptions {
    /// The left camera file.
    #[arg(long, value_name = "FILE", requires = "right")]
    left: Option<PathBuf>,
    /// The right camera file.
    #[arg(long, value_name = "FILE", requires = "left")]
    right: Option<PathBuf>,
    /// What may change of the lenses: nothing (exact), as much as the covariance in the camera files allows (known), or
    /// everything (free). Unless given: known where both camera files carry a covariance, exact otherwise.
    #[arg(long)]
    lenses: Option<Lenses>,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, clap::ValueEnum)]
enum Lenses {
    Exact,
    Known,
    Free,
}

/// The lenses of a pair.
pub struct KnownLenses {
    pub left: KannalaBrandt,
    pub right: KannalaBrandt,
    /// How they expose their rows, as far as the files say.
    pub shutters: [Shutter; 2],
    pub knowledge: LensKnowledge,
}

impl LensOptions {
    /// Reads the camera files; `None` where none are named.
    ///
    /// # Errors
    /// A file that is none, or that does not say how well it is known.
    pub fn read(&self, hash: &mut InputHash, console: Console) -> Result<Option<KnownLenses>, Failure> {
        let (Some(left), Some(right)) = (&self.left, &self.right) else { return Ok(None) };
        hash.add(left)?;
        hash.add(right)?;
        let files = (camera_files::read(left)?, camera_files::read(right)?);
        let sure = [&files.0, &files.1].iter().all(|file| calibration_table(file).is_some());
        if self.lenses.is_none() && !sure {
            console.say(
                "the camera files carry no covariance, so the lenses are held exact: their errors are not counted",
            )?;
        }
        let knowledge = match self.lenses.unwrap_or(if sure { Lenses::Known } else { Lenses::Exact }) {
            Lenses::Exact => LensKnowledge::Exact,
            Lenses::Free => LensKnowledge::Free,
            Lenses::Known => LensKnowledge::within(covariance(left, &files.0)?, covariance(right, &files.1)?),
        };
        let shutters = [&files.0, &files.1].map(CameraFile::shutter);
        Ok(Some(KnownLenses { left: files.0.cameras.left, right: files.1.cameras.left, shutters, knowledge }))
    }

    /// What is known of lenses that come from elsewhere than camera files.
    ///
    /// # Errors
    /// Where a covariance is asked for that only camera files have.
    pub fn without_files(&self) -> Result<LensKnowledge, Failure> {
        match self.lenses.unwrap_or(Lenses::Exact) {
            Lenses::Exact => Ok(LensKnowledge::Exact),
            Lenses::Free => Ok(LensKnowledge::Free),
            Lenses::Known => {
                Err(Failure::usage("--lenses known needs camera files: name them with --left and --right"))
            }
        }
    }
}

fn calibration_table(file: &CameraFile) -> Option<&CalibrationTable> {
    file.document.as_ref().and_then(|document| document.calibration.as_ref())
}

fn covariance(path: &Path, file: &CameraFile) -> Result<SMatrix<f64, 8, 8>, Failure> {
    let table = calibration_table(file)
        .ok_or_else(|| Failure::input(path, "it has no covariance: calibrate it here, or use --lenses exact"))?;
    Ok(SMatrix::from_fn(|row, column| table.covariance[row][column]))
}

/// Where the result goes.
#[derive(Debug, clap::Args)]
pub struct ResultOptions {
    /// The calibration file to write.
    #[arg(long, value_name = "FILE")]
    pub out: Option<PathBuf>,
    /// Keeps the calibration under this name; `vergence calibrate use NAME` makes it the active one.
    #[arg(long, value_name = "NAME")]
    slot: Option<String>,
    #[command(flatten)]
    store: StoreOptions,
    /// The report to write: one HTML page.
    #[arg(long, value_name = "FILE")]
    pub report: Option<PathBuf>,
    /// The date to keep with the calibration.
    #[arg(long)]
    date: Option<String>,
}

impl ResultOptions {
    /// Refuses a slot that cannot be written, before the work is done.
    ///
    /// # Errors
    /// A name that is none or taken.
    pub fn check(&self) -> Result<(), Failure> {
        match &self.slot {
            Some(name) => Slots::open(&self.store)?.check_free(name),
            None => Ok(()),
        }
    }

    /// The provenance of what is written.
    pub fn provenance(&self, hash: InputHash) -> Provenance {
        hash.provenance(self.date.as_deref())
    }

    /// What the result is called: after its slot, or its file.
    pub fn name(&self, otherwise: &str) -> String {
        let file = || Some(self.out.as_deref()?.file_stem()?.to_string_lossy().into_owned());
        self.slot.clone().or_else(file).unwrap_or_else(|| otherwise.to_owned())
    }

    /// Writes the calibration wherever it is wanted, each file whole or not at all.
    ///
    /// # Errors
    /// Says which file and why.
    pub fn write(&self, calibration: &str, report: impl FnOnce() -> String) -> Result<(), Failure> {
        if let Some(path) = &self.report {
            write_whole(path, report().as_bytes())?;
        }
        if let Some(path) = &self.out {
            write_whole(path, calibration.as_bytes())?;
        }
        match &self.slot {
            Some(name) => Slots::open(&self.store)?.keep(name, calibration),
            None => Ok(()),
        }
    }
}

/// No target and no lens of the model leaves residuals like these, in pixels.
const WORST_RMS_PX: f64 = 3.0;
/// Where more corners are left out, what fits the rest is an accident.
const FEWEST_INLIERS: f64 = 0.7;

/// The check that every result must pass before anything is written.
///
/// # Errors
/// Exit code 1, with what is wrong.
pub fn check_fit(rms_inlier_px: f64, corners_inlier: usize, corners_total: usize) -> Result<(), Failure> {
    if rms_inlier_px.is_nan() || rms_inlier_px > WORST_RMS_PX {
        return Err(Failure::check(format!(
            "the best fit is {rms_inlier_px:.1} px off: target, images or cameras are not what they are said to be"
        )));
    }
    if (corners_inlier as f64) < FEWEST_INLIERS * corners_total as f64 {
        return Err(Failure::check(format!(
            "only {corners_inlier} of {corners_total} corners fit together: were images, corners or cameras mixed up?"
        )));
    }
    Ok(())
}

/// Tells of held-out views and refuses a result that they contradict.
///
/// # Errors
/// Exit code 1 where held-out views fit much worse than `rms_px`.
pub fn check_held_out(validation: &Validation, rms_px: f64) -> Result<(), Failure> {
    if validation.is_sound(rms_px) {
        return Ok(());
    }
    Err(Failure::check(format!(
        "views that the calibration did not see fit to {:.3} px rms only, those that it saw to {rms_px:.3} px: take more views",
        validation.rms_px
    )))
}

/// Says how well held-out views are predicted.
///
/// # Errors
/// Where standard output cannot be written.
pub fn tell_held_out(validation: Option<&Validation>, console: Console) -> Result<(), Failure> {
    let Some(Validation { folds, rms_px, views }) = validation else { return Ok(()) };
    console.say(format!("  held out: {rms_px:.3} px rms over {} views in {folds} parts", views.len()))
}

/// For programs.
pub fn held_out_json(validation: Option<&Validation>) -> Value {
    let Some(Validation { folds, rms_px, views }) = validation else { return Value::Null };
    let views: Vec<_> =
        views.iter().map(|view| json!({ "name": view.view, "corners": view.corners, "rms_px": view.rms_px })).collect();
    json!({ "folds": folds, "rms_px": rms_px, "views": views })
}

/// For programs.
pub fn verdict_json(verdict: &Verdict) -> Value {
    json!({
        "text": verdict.sentence,
        "depth_sigma_mm": verdict.depth_sigma.map(|sigma| sigma.mm()),
        "worst_sigma_mm": verdict.worst_sigma.map(|sigma| sigma.mm()),
        "range_mm": 350.0,
    })
}
