//! Files of simulated boards: the programs in their flash, and the flash itself.

use std::io::ErrorKind;
use std::path::{Path, PathBuf};

use vergence_board::Served;
use vergence_files::write_whole;
use vergence_rig::Rig;
use vergence_sim::{Program, SimError, SimulatedChip, SimulatedRig};

use crate::failure::Failure;

/// Powers a simulated chip with these programs, each an ELF file or a signed image, as [`SimulatedChip::new`].
///
/// # Errors
/// A file that cannot be read, or those of [`SimulatedChip::new`].
pub fn simulated_chip(programs: &[impl AsRef<Path>], rig: &Rig, seed: u64) -> Result<SimulatedChip, Failure> {
    let read = |path: &Path| {
        let advice = |error| Failure::input(path, format!("{error}; docs/firmware.md says how the firmware is built"));
        Ok((path.display().to_string(), std::fs::read(path).map_err(advice)?))
    };
    let files: Vec<_> = programs.iter().map(|path| read(path.as_ref())).collect::<Result<_, Failure>>()?;
    let programs: Vec<_> = files.iter().map(|(name, bytes)| Program { name, bytes }).collect();
    Ok(SimulatedChip::new(&programs, rig, seed)?)
}

/// A simulated rig, with the controller core alone or with this firmware on a simulated chip. `seed` decides where its stages stand.
///
/// # Errors
/// As of [`simulated_chip`] and [`SimulatedRig::new`].
pub fn simulated_rig(firmware: Option<&Path>, rig: &Rig, seed: u64) -> Result<SimulatedRig, Failure> {
    match firmware {
        None => Ok(SimulatedRig::new(rig, seed)?),
        Some(path) => Ok(SimulatedRig::on_chip(simulated_chip(&[path], rig, seed)?, rig)),
    }
}

/// A simulated rig whose settings flash is kept in a file.
pub struct KeptRig {
    rig: SimulatedRig,
    file: PathBuf,
}

impl KeptRig {
    /// Powers `rig` with the settings in `file`, and keeps later ones there. A missing file is erased flash.
    ///
    /// # Errors
    /// A file that cannot be read, or is not the flash of this board.
    pub fn new(mut rig: SimulatedRig, file: &Path) -> Result<Self, Failure> {
        let bytes = match std::fs::read(file) {
            // An empty file would pass for erased flash.
            Ok(bytes) if bytes.is_empty() => return Err(Failure::input(file, SimError::NotFlash)),
            Ok(bytes) => bytes,
            Err(error) if error.kind() == ErrorKind::NotFound => Vec::new(),
            Err(error) => return Err(Failure::input(file, error)),
        };
        rig.power_on_with_flash(&bytes).map_err(|error| Failure::input(file, error))?;
        Ok(Self { rig, file: file.to_owned() })
    }
}

impl Served for KeptRig {
    type Error = Failure;

    fn run_until(&mut self, elapsed_us: u64) {
        self.rig.run_until(elapsed_us);
    }

    fn receive(&mut self, bytes: &[u8]) {
        self.rig.receive(bytes);
    }

    fn take_output(&mut self) -> Vec<u8> {
        self.rig.take_output()
    }

    fn settle(&mut self) -> Result<(), Failure> {
        self.rig.changed_flash().map_or(Ok(()), |bytes| Ok(write_whole(&self.file, bytes)?))
    }
}
