//! Rigs of two fixed cameras, made of the files of other programs.

use std::path::Path;

use vergence_exchange::{ForeignPair, ForeignRig, Recognised};
use vergence_rig::Rig;

use crate::InputError;
use crate::camera_files::{file_lens, named_camera};

/// A rig, and what is to be said of it.
pub struct ImportedRig {
    /// The rig.
    pub rig: Rig,
    /// How far its lenses are off the cameras of the file, in words.
    pub remarks: Vec<String>,
}

/// Reads a rig file: ours, or another program's file of cameras. `FILE#LEFT,RIGHT` chooses two of the cameras of another program's file.
///
/// # Errors
/// Says which file and what is wrong.
pub fn read_rig(path: &Path) -> Result<ImportedRig, InputError> {
    let (file, cameras) = named_camera(path);
    let text = vergence_files::read_text(&file)?;
    if Recognised::of(&text) == Recognised::Ours {
        let rig = Rig::from_toml(&text).map_err(|error| InputError::wrong(&file, error))?;
        return Ok(ImportedRig { rig, remarks: Vec::new() });
    }
    let cameras = cameras.as_deref().map(|names| {
        names
            .split_once(',')
            .ok_or_else(|| InputError::wrong(&file, format!("'#{names}' names no two cameras: write #LEFT,RIGHT")))
    });
    import_rig(&[&file], cameras.transpose()?.map(|(left, right)| [left, right]))
}

/// Makes a rig of two cameras: of one file, the two that `cameras` names, left and right, or the only two; of two files, the only one of
/// each.
///
/// # Errors
/// Says which file and what is wrong.
pub fn import_rig(files: &[&Path], cameras: Option<[&str; 2]>) -> Result<ImportedRig, InputError> {
    let read = |file: &&Path| {
        let text = vergence_files::read_text(file)?;
        vergence_exchange::read(&text).map_err(|error| InputError::wrong(file, error))
    };
    let rigs = files.iter().map(read).collect::<Result<Vec<ForeignRig>, InputError>>()?;
    let (pair, at) = match (rigs.as_slice(), files) {
        ([rig], [file]) => (rig.pair(cameras), *file),
        ([left, right], [_, file]) => {
            let both = left.camera(None).and_then(|left| Ok((left, right.camera(None)?)));
            (both.and_then(|(left, right)| ForeignPair::new(left, right)), *file)
        }
        _ => return Err(InputError::TwoCameras),
    };
    let pair = pair.map_err(|error| InputError::wrong(at, error))?;
    let lens = |camera| file_lens(camera).map_err(|error| InputError::wrong(at, error));
    let (left, right) = (lens(pair.left)?, lens(pair.right)?);
    let stems = files.iter().map(|file| file.file_stem().unwrap_or_default().to_string_lossy()).collect::<Vec<_>>();
    let name = format!("{} ({}, {})", stems.join(" and "), left.name, right.name);
    let remarks = [left.remark, right.remark].into_iter().flatten().collect();
    Ok(ImportedRig { rig: Rig::fixed_pair(&name, (left.lens, right.lens), pair.left_from_right), remarks })
}
