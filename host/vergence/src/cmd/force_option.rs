//! The option that goes on where a plausibility check refuses.

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
    pub fn unless_forced(self, found: Result<(), impl Into<Failure>>, console: Console) -> Result<(), Failure> {
        match found.map_err(Into::into) {
            Err(failure) if self.force => {
                console.warn(failure);
                Ok(())
            }
            Err(failure) => Err(failure.and(" (--force goes on all the same)")),
            Ok(()) => Ok(()),
        }
    }
}
