//! Power cuts in the middle of a firmware update: at any operation of the flash, with the word or page in progress
//! left torn. The boot loader and the application are those of the board, on the simulated chip.
//!
//! Only the flash persists without power. One whole update is run and every flash operation listed; a cut at one of
//! them is the flash before it with that operation half done; then a board with this flash is started.

mod image;
mod known;
mod state;
mod sweep;
mod talk;
mod tally;

pub use image::{SignedImage, twin};
pub use state::{CutState, CutStateError};
pub use sweep::{Cut, Ending, Journey, Sweep};
pub use tally::CutTally;
