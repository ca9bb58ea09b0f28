//! Calibrations kept under names, one of them active.
//!
//! The store is a folder: `NAME.toml` is a calibration that is written once and never changed; `active` lists the names
//! that were made active, the present one last. It is replaced as a whole, so that whoever reads it sees one calibration
//! or the other.

use std::path::PathBuf;

use vergence_files::{FileError, make_folder, read_text, write_whole};
use vergence_rig::{CameraDocument, Provenance, Rig};

use crate::StoreError;

/// The file with the history of active calibrations.
const ACTIVE: &str = "active";
const SUFFIX: &str = ".toml";
/// So many steps back are remembered.
const LONGEST_HISTORY: usize = 100;

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
    /// Its name.
    pub name: String,
    /// What it holds.
    pub kind: SlotKind,
    /// Whether it is the active one.
    pub active: bool,
    /// Where it comes from, where it says so.
    pub provenance: Option<Provenance>,
    /// Its file.
    pub path: PathBuf,
}

impl Slots {
    /// The store in `folder`, or else in vergence/calibrations in the user's data folder; nothing is written.
    ///
    /// # Errors
    /// [`StoreError::NoDataFolder`] where no folder is named and the user has no data folder.
    pub fn open(folder: Option<PathBuf>) -> Result<Self, StoreError> {
        Ok(Self { folder: folder.or_else(default_folder).ok_or(StoreError::NoDataFolder)? })
    }

    /// The rig file that is active; `None` where none is.
    ///
    /// # Errors
    /// Where the store is there and cannot be read.
    pub fn active_rig(&self) -> Result<Option<PathBuf>, StoreError> {
        Ok(self.active()?.map(|name| self.path(&name)))
    }

    /// The file of slot `name`.
    fn path(&self, name: &str) -> PathBuf {
        self.folder.join(format!("{name}{SUFFIX}"))
    }

    /// Whether a calibration can be kept as `name`.
    ///
    /// # Errors
    /// A name that is none, or is taken.
    pub fn check_free(&self, name: &str) -> Result<(), StoreError> {
        let letters = |c: char| c.is_ascii_alphanumeric() || matches!(c, '-' | '_' | '.');
        if name.is_empty() || name.starts_with('.') || !name.chars().all(letters) {
            return Err(StoreError::Name(name.to_owned()));
        }
        if self.path(name).exists() {
            return Err(StoreError::Taken(name.to_owned()));
        }
        Ok(())
    }

    /// Keeps `text` as `name`.
    ///
    /// # Errors
    /// As [`Self::check_free`], or where it cannot be written.
    pub fn keep(&self, name: &str, text: &str) -> Result<(), StoreError> {
        self.check_free(name)?;
        make_folder(&self.folder)?;
        Ok(write_whole(&self.path(name), text.as_bytes())?)
    }

    /// All of them, by name.
    ///
    /// # Errors
    /// Where the folder cannot be read; a folder that is not there has none.
    pub fn list(&self) -> Result<Vec<Slot>, StoreError> {
        let active = self.active()?;
        let entries = match std::fs::read_dir(&self.folder) {
            Ok(entries) => entries,
            Err(error) if error.kind() == std::io::ErrorKind::NotFound => return Ok(Vec::new()),
            Err(error) => return Err(FileError::read(&self.folder, error).into()),
        };
        let mut slots = Vec::new();
        for entry in entries {
            let path = entry.map_err(|error| FileError::read(&self.folder, error))?.path();
            let file = path.file_name().unwrap_or_default().to_string_lossy().into_owned();
            let Some(name) = file.strip_suffix(SUFFIX).filter(|name| !name.starts_with('.')) else { continue };
            let (kind, provenance) = read_text(&path).map_or((SlotKind::Unreadable, None), |text| describe(&text));
            slots.push(Slot { name: name.to_owned(), kind, active: active.as_deref() == Some(name), provenance, path });
        }
        slots.sort_by(|a, b| a.name.cmp(&b.name));
        Ok(slots)
    }

    /// Makes `name` the active one.
    ///
    /// # Errors
    /// No such slot, or none that holds a rig; the active one stays as it was.
    pub fn activate(&self, name: &str) -> Result<(), StoreError> {
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
    pub fn rollback(&self) -> Result<Option<String>, StoreError> {
        let mut history = self.history()?;
        if history.pop().is_none() {
            return Err(StoreError::NothingBefore);
        }
        let before = history.last().cloned();
        if let Some(name) = &before {
            self.check_rig(name)?;
        }
        self.write_history(&history)?;
        Ok(before)
    }

    fn active(&self) -> Result<Option<String>, StoreError> {
        Ok(self.history()?.pop())
    }

    fn history(&self) -> Result<Vec<String>, StoreError> {
        let path = self.folder.join(ACTIVE);
        match std::fs::read_to_string(&path) {
            Ok(text) => Ok(text.lines().filter(|line| !line.is_empty()).map(str::to_owned).collect()),
            Err(error) if error.kind() == std::io::ErrorKind::NotFound => Ok(Vec::new()),
            Err(error) => Err(FileError::read(&path, error).into()),
        }
    }

    fn write_history(&self, history: &[String]) -> Result<(), StoreError> {
        let from = history.len().saturating_sub(LONGEST_HISTORY);
        let text: String = history.iter().skip(from).map(|name| format!("{name}\n")).collect();
        Ok(write_whole(&self.folder.join(ACTIVE), text.as_bytes())?)
    }

    fn check_rig(&self, name: &str) -> Result<(), StoreError> {
        let slots = self.list()?;
        let Some(slot) = slots.iter().find(|slot| slot.name == name) else {
            let kept = slots.into_iter().map(|slot| slot.name).collect();
            return Err(StoreError::NotKept { name: name.to_owned(), kept });
        };
        match slot.kind {
            SlotKind::Rig => Ok(()),
            SlotKind::Camera => Err(StoreError::IsCamera { name: name.to_owned(), path: slot.path.clone() }),
            SlotKind::Unreadable => Err(StoreError::Unreadable(slot.path.clone())),
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
