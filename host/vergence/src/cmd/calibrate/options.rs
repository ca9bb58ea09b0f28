//! Options that the calibrations share: the lenses of a pair, and what becomes of a result.

use std::path::PathBuf;

use vergence_calibration::LensKnowledge;
use vergence_calibration_input::{InputHash, KnownLenses, LensFiles, LensFreedom};
pub use vergence_calibration_report::VerdictPlaces;
use vergence_files::write_whole;
use vergence_rig::Provenance;

use crate::cmd::force_option::ForceOption;
use crate::cmd::options::StoreOptions;
use crate::console::Console;
use crate::failure::Failure;

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

impl Lenses {
    fn freedom(self) -> LensFreedom {
        match self {
            Self::Exact => LensFreedom::Exact,
            Self::Known => LensFreedom::Known,
            Self::Free => LensFreedom::Free,
        }
    }
}

impl LensOptions {
    /// Reads the camera files; `None` where none are named.
    ///
    /// # Errors
    /// A file that is none, or that does not say how well it is known.
    pub fn read(&self, hash: &mut InputHash, console: Console) -> Result<Option<KnownLenses>, Failure> {
        let (Some(left), Some(right)) = (&self.left, &self.right) else { return Ok(None) };
        let files = LensFiles::read([left, right], hash)?;
        let sure = files.carry_covariance();
        if self.lenses.is_none() && !sure {
            console.say(
                "the camera files carry no covariance, so the lenses are held exact: their errors are not counted",
            )?;
        }
        let lenses = self.lenses.unwrap_or(if sure { Lenses::Known } else { Lenses::Exact });
        let known = files.lenses(lenses.freedom())?;
        for remark in &known.remarks {
            console.warn(remark);
        }
        Ok(Some(known))
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
    #[command(flatten)]
    pub force: ForceOption,
}

impl ResultOptions {
    /// Refuses a slot that cannot be written, before the work is done.
    ///
    /// # Errors
    /// A name that is none or taken.
    pub fn check(&self) -> Result<(), Failure> {
        match &self.slot {
            Some(name) => Ok(self.store.open()?.check_free(name)?),
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
            Some(name) => Ok(self.store.open()?.keep(name, calibration)?),
            None => Ok(()),
        }
    }
}
