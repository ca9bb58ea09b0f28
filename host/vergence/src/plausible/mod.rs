//! Checks of input and results that are well formed and still cannot be meant. One function is one check with its sentence; it
//! refuses with exit code 2 what is read, and with exit code 1 what is found. With `--force` the sentence is a warning.

pub mod images;
pub mod pose;
pub mod views;

use crate::console::Console;
use crate::failure::Failure;

/// Whether a person insists.
#[derive(Clone, Copy, Debug, clap::Args)]
pub struct ForceOption {
    /// Goes on where a plausibility check would refuse input or result, with a warning instead: swapped images, a square of
    /// 24 m, corners outside the image and the like (docs/troubleshooting.md lists the checks).
    #[arg(long)]
    force: bool,
}

impl ForceOption {
    /// Passes on what a check found, or only warns of it.
    ///
    /// # Errors
    /// The check's failure, unless a person insists.
    pub fn unless_forced(self, found: Result<(), Failure>, console: Console) -> Result<(), Failure> {
        match found {
            Err(failure) if self.force => {
                console.warn(failure);
                Ok(())
            }
            Err(failure) => Err(failure.and(" (--force goes on all the same)")),
            Ok(()) => Ok(()),
        }
    }
}
