//! The rig and the lenses that a command works with: files of this program or of others, or the built-in bench.

use std::path::Path;

use serde_json::json;
use vergence_calibration_input::{FileLens, ImportedRig, read_camera, read_rig};
use vergence_exchange::{Cameras, FileName, WriteFormat};
use vergence_files::write_whole;
use vergence_rig::{BENCH_TOML, Rig};
use vergence_vision::KannalaBrandt;

use crate::console::Console;
use crate::failure::Failure;

/// Reads and checks the rig file at `path`, ours or another program's; without one, the bench. Says on standard error how far lenses are off
/// the cameras of another program's file.
///
/// # Errors
/// Says which file and what is wrong with it.
pub fn load(path: Option<&Path>) -> Result<Rig, Failure> {
    let Some(path) = path else { return bench() };
    let ImportedRig { rig, remarks } = read_rig(path)?;
    for remark in remarks {
        Console::new(false).warn(format!("{}: {remark}", path.display()));
    }
    // Whole names, so that they stay right in the files that calibrations write elsewhere.
    let whole = std::path::absolute(path).map_err(|error| Failure::input(path, error))?;
    Ok(rig.with_masks_from(whole.parent().unwrap_or(&whole)))
}

/// The lens of the camera file at `path`, ours or another program's. Says on standard error how far it is off the file's camera.
///
/// # Errors
/// Says which file and what is wrong with it.
pub fn read_lens(path: &Path, console: Console) -> Result<KannalaBrandt, Failure> {
    let FileLens { lens, remark, .. } = read_camera(path)?;
    if let Some(remark) = remark {
        console.warn(remark);
    }
    Ok(lens)
}

/// The built-in bench with sensors of the same size that have `width` pixels across.
///
/// # Errors
/// Where `width` leaves no pixels.
pub fn bench_with_sensors(width: u32) -> Result<Rig, Failure> {
    let rig = bench()?.with_sensors(width);
    rig.map_err(|error| Failure::usage(format!("sensors of {width} pixels: {error}")))
}

fn bench() -> Result<Rig, Failure> {
    Rig::from_toml(BENCH_TOML).map_err(|error| Failure::usage(format!("the built-in rig: {error}")))
}

/// Writes cameras for another program to `out`, or to a file beside it for each camera, and says what the format cannot hold.
///
/// # Errors
/// A lens that the format cannot hold, a file that cannot be written, or one that the user did not name and that is there.
pub fn write_foreign(format: WriteFormat, cameras: &Cameras, out: &Path, console: Console) -> Result<(), Failure> {
    let written = vergence_exchange::write(format, cameras).map_err(|error| Failure::usage(error.to_string()))?;
    written.remarks.iter().for_each(|remark| console.warn(remark));
    let paths: Vec<_> = written.files.iter().map(|file| file.path(out)).collect();
    let unnamed = paths.iter().zip(&written.files).filter(|(_, file)| matches!(file.name, FileName::Beside(_)));
    if let Some((path, _)) = unnamed.into_iter().find(|(path, _)| path.exists()) {
        return Err(Failure::output(path, "it is there already: name a file in another folder, or remove this one"));
    }
    for (path, file) in paths.iter().zip(&written.files) {
        write_whole(path, file.text.as_bytes())?;
        console.say(format!("wrote {}", path.display()))?;
    }
    console.result(&json!({ "out": paths, "remarks": written.remarks }))
}
