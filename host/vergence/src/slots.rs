//! Calibrations kept under names, one of them active.
//!
//! The store is a folder: `NAME.toml` is a calibration that is written once and never changed; `active` lists the names
//! that were made active, the present one last. It is replaced as a whole, so that whoever reads it sees one calibration
//! or the other.

use std::path::PathBuf;

use vergence_files::{make_folder, write_whole};
use vergence_rig::{CameraDocument, Provenance, Rig};

use crate::failure::Failure;

const STORE_VARIABLE: &str = "VERGENCE_STORE";
/// The file with the history of active calibrations.
const ACTIVE: &str = "active";
const SUFFIX: &str = ".toml";
/// So many steps back are remembered.
const LONGEST_HISTORY: usize = 100;

/// Where calibrations are kept.
#[derive(Clone, Debug, Default, clap::Args)]
pub struct StoreOptions {
    /// The folder that calibrations are kept in. Without it, vergence/calibrations in the user's data folder.
    #[arg(long, env = STORE_VARIABLE, value_name = "DIR")]
    pub store: Option<PathBuf>,
}

/// The kept calibrations.
pub struct Slots {
    folder: PathBuf,
}

/// What a slot holds.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum SlotKind {
    /// A rig: a pair or a stage.
    Rig,
    /// A camera.
    Camera,
    /// Nothing that this program understands.
    Unreadable,
}

/// A kept calibration.
#[derive(Clone, Debug)]
pub struct Slot {
    pub name: String,
    pub kind: SlotKind,
    pub active: bool,
    /// Where it comes from, where it says so.
    pub provenance: Option<Provenance>,
    pub path: PathBuf,
}

/// The rig file that is active in the store of the environment; `None` where there is no store, or none is active.
///
/// # Errors
/// Where the store is there and cannot be read.
pub fn active_rig() -> Result<Option<PathBuf>, Failure> {
    let store = std::env::var_os(STORE_VARIABLE).map(PathBuf::from);
    let Ok(slots) = Slots::open(&StoreOptions { store }) else { return Ok(None) };
    Ok(slots.active()?.map(|name| slots.path(&name)))
}

impl Slots {
    /// The store that the options name; nothing is written.
    ///
    /// # Errors
    /// Where no folder is named and the user has no data folder.
    pub fn open(options: &StoreOptions) -> Result<Self, Failure> {
        let folder = options.store.clone().or_else(default_folder).ok_or_else(|| {
            Failure::usage("there is no data folder for calibrations: name one with --store, or set VERGENCE_STORE")
        })?;
        Ok(Self { folder })
    }

    /// The file of slot `name`.
    fn path(&self, name: &str) -> PathBuf {
        self.folder.join(format!("{name}{SUFFIX}"))
    }

    /// Whether a calibration can be kept as `name`.
    ///
    /// # Errors
    /// A name that is none, or is taken.
    pub fn check_free(&self, name: &str) -> Result<(), Failure> {
        let letters = |c: char| c.is_ascii_alphanumeric() || matches!(c, '-' | '_' | '.');
        if name.is_empty() || name.starts_with('.') || !name.chars().all(letters) {
            return Err(Failure::usage(format!("'{name}' is no name for a calibration: use letters, digits, - _ .")));
        }
        if self.path(name).exists() {
            return Err(Failure::usage(format!(
                "a calibration '{name}' is kept already and is not overwritten: choose another name"
            )));
        }
        Ok(())
    }

    /// Keeps `text` as `name`.
    ///
    /// # Errors
    /// As [`Self::check_free`], or where it cannot be written.
    pub fn keep(&self, name: &str, text: &str) -> Result<(), Failure> {
        self.check_free(name)?;
        make_folder(&self.folder)?;
        Ok(write_whole(&self.path(name), text.as_bytes())?)
    }

    /// All of them, by name.
    ///
    /// # Errors
    /// Where the folder cannot be read; a folder that is not there has none.
    pub fn list(&self) -> Result<Vec<Slot>, Failure> {
        let active = self.active()?;
        let entries = match std::fs::read_dir(&self.folder) {
            Ok(entries) => entries,
            Err(error) if error.kind() == std::io::ErrorKind::NotFound => return Ok(Vec::new()),
            Err(error) => return Err(Failure::input(&self.folder, error)),
        };
        let mut slots = Vec::new();
        for entry in entries {
            let path = entry.map_err(|error| Failure::input(&self.folder, error))?.path();
            let file = path.file_name().unwrap_or_default().to_string_lossy().into_owned();
            let Some(name) = file.strip_suffix(SUFFIX).filter(|name| !name.starts_with('.')) else { continue };
            let (kind, provenance) =
                std::fs::read_to_string(&path).map_or((SlotKind::Unreadable, None), |text| describe(&text));
            slots.push(Slot { name: name.to_owned(), kind, active: active.as_deref() == Some(name), provenance, path });
        }
        slots.sort_by(|a, b| a.name.cmp(&b.name));
        Ok(slots)
    }

    /// Makes `name` the active one.
    ///
    /// # Errors
    /// No such slot, or none that holds a rig; the active one stays as it was.
    pub fn activate(&self, name: &str) -> Result<(), Failure> {
        self.check_rig(name)?;
        let mut history = self.history()?;
        if history.last().map(String::as_str) != Some(name) {
            history.push(name.to_owned());
        }
        self.write_history(&history)
    }

    /// Makes the one active that was so before, and returns its name; `None`: the built-in rig.
    ///
    /// # Errors
    /// Where nothing was active before, or what was is no longer usable; the active one stays as it was.
    pub fn rollback(&self) -> Result<Option<String>, Failure> {
        let mut history = self.history()?;
        if history.pop().is_none() {
            return Err(Failure::usage("no calibration is active: there is nothing to go back to"));
        }
        let before = history.last().cloned();
        if let Some(name) = &before {
            self.check_rig(name)?;
        }
        self.write_history(&history)?;
        Ok(before)
    }

    fn active(&self) -> Result<Option<String>, Failure> {
        Ok(self.history()?.pop())
    }

    fn history(&self) -> Result<Vec<String>, Failure> {
        let path = self.folder.join(ACTIVE);
        match std::fs::read_to_string(&path) {
            Ok(text) => Ok(text.lines().filter(|line| !line.is_empty()).map(str::to_owned).collect()),
            Err(error) if error.kind() == std::io::ErrorKind::NotFound => Ok(Vec::new()),
            Err(error) => Err(Failure::input(&path, error)),
        }
    }

    fn write_history(&self, history: &[String]) -> Result<(), Failure> {
        let from = history.len().saturating_sub(LONGEST_HISTORY);
        let text: String = history.iter().skip(from).map(|name| format!("{name}\n")).collect();
        Ok(write_whole(&self.folder.join(ACTIVE), text.as_bytes())?)
    }

    fn check_rig(&self, name: &str) -> Result<(), Failure> {
        let slots = self.list()?;
        let Some(slot) = slots.iter().find(|slot| slot.name == name) else {
            let names: Vec<_> = slots.into_iter().map(|slot| slot.name).collect();
            let known = if names.is_empty() { "none is".to_owned() } else { format!("there are {}", names.join(", ")) };
            return Err(Failure::usage(format!("no calibration '{name}' is kept: {known}")));
        };
        match slot.kind {
            SlotKind::Rig => Ok(()),
            SlotKind::Camera => Err(Failure::usage(format!(
                "'{name}' is a camera, not a rig: give {} to --left or --right",
                slot.path.display()
            ))),
            SlotKind::Unreadable => Err(Failure::input(&slot.path, "not a calibration that this program understands")),
        }
    }
}

fn default_folder() -> Option<PathBuf> {
    let folder = |name: &str| std::env::var_os(name).map(PathBuf::from).filter(|path| path.is_absolute());
    let data = folder("XDG_DATA_HOME").or_else(|| Some(folder("HOME")?.join(".local/share")))?;
    Some(data.join("vergence").join("calibrations"))
}

fn describe(text: &str) -> (SlotKind, Option<Provenance>) {
    #[derive(serde::Deserialize)]
    struct Origin {
        provenance: Option<Provenance>,
    }
    let provenance = toml::from_str::<Origin>(text).ok().and_then(|origin| origin.provenance);
    let kind = if Rig::from_toml(text).is_ok() {
        SlotKind::Rig
    } else if toml::from_str::<CameraDocument>(text).is_ok() {
        SlotKind::Camera
    } else {
        SlotKind::Unreadable
    };
    (kind, provenance)
}
