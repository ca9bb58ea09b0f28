//! Folders that are there whole or not at all.

use std::fs::Permissions;
use std::os::unix::fs::PermissionsExt;
use std::path::{Path, PathBuf};

use tempfile::TempDir;

use crate::{FileError, make_folder};

/// A folder that is being written under a temporary name beside the one that it gets at the end. Dropped before, it leaves nothing.
#[derive(Debug)]
pub struct WholeFolder {
    written: TempDir,
    name: PathBuf,
}

impl WholeFolder {
    /// Begins a folder that will be at `name`, where nothing is, or an empty folder.
    ///
    /// # Errors
    /// [`FileError::Write`], also where something is there.
    pub fn begin(name: &Path) -> Result<Self, FileError> {
        let fail = |error| FileError::write(name, error);
        let is_there = name.exists();
        if is_there && std::fs::read_dir(name).map_err(fail)?.next().is_some() {
            return Err(FileError::write(
                name,
                "there is something already; name a folder that does not exist or is empty",
            ));
        }
        // A folder that is there may be the root of a file system, to which nothing can be moved from beside it.
        let parent = name.parent().filter(|parent| !parent.as_os_str().is_empty()).unwrap_or(Path::new("."));
        let around = if is_there { name } else { parent };
        make_folder(around)?;
        let written = tempfile::Builder::new()
            .prefix(".vergence-")
            .permissions(Permissions::from_mode(0o777))
            .tempdir_in(around)
            .map_err(fail)?;
        Ok(Self { written, name: name.to_owned() })
    }

    /// Where its files are written.
    #[must_use]
    pub fn path(&self) -> &Path {
        self.written.path()
    }

    /// Gives the folder its name.
    ///
    /// # Errors
    /// [`FileError::Write`]
    pub fn finish(self) -> Result<(), FileError> {
        let fail = |error| FileError::write(&self.name, error);
        if !self.name.exists() {
            std::fs::rename(self.written.path(), &self.name).map_err(fail)?;
            // Nothing is left to remove.
            _ = self.written.keep();
            return Ok(());
        }
        for entry in std::fs::read_dir(self.written.path()).map_err(fail)? {
            let entry = entry.map_err(fail)?;
            std::fs::rename(entry.path(), self.name.join(entry.file_name())).map_err(fail)?;
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{read_text, write_whole};

    fn names(folder: &Path) -> Vec<String> {
        let entries = std::fs::read_dir(folder).expect("a folder");
        entries.map(|entry| entry.expect("an entry").file_name().to_string_lossy().into_owned()).collect()
    }

    #[test]
    fn a_folder_has_its_name_when_it_is_finished_and_leaves_nothing_otherwise() {
        let around = tempfile::tempdir().expect("a folder");
        let (new, empty) = (around.path().join("above/new"), around.path().join("empty"));
        make_folder(&empty).expect("made");
        for name in [&new, &empty] {
            let folder = WholeFolder::begin(name).expect("begun");
            write_whole(&folder.path().join("file"), b"lost").expect("written");
            assert!(!name.join("file").exists());
            drop(folder);
            assert_eq!(names(if name.exists() { name } else { name.parent().expect("above") }).len(), 0);
            let folder = WholeFolder::begin(name).expect("begun");
            write_whole(&folder.path().join("file"), b"kept").expect("written");
            folder.finish().expect("finished");
            assert_eq!(names(name), ["file"]);
            assert_eq!(read_text(&name.join("file")).as_deref(), Ok("kept"));
            let mode = std::fs::metadata(name).expect("there").permissions().mode();
            assert_eq!(mode & 0o500, 0o500);
            let refused = WholeFolder::begin(name).expect_err("it is full").to_string();
            assert!(refused.contains("there is something already"), "{refused}");
        }
        assert_eq!(names(&around.path().join("above")), ["new"]);
    }
}
