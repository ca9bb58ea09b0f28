//! Power cuts in the middle of whatever writes the flash ([`Journey`]): at any operation of the flash, with the word or
//! page in progress left torn. The boot loader and the application are those of the board, on the simulated chip.
//!
//! Only the flash persists without power. One whole journey is run and every flash operation listed; a cut at one of
//! them is the flash before it with that operation half done; then a board with this flash is started.

mod image;
mod journey;
mod known;
mod settings;
mod state;
mod sweep;
mod talk;
mod tally;

pub use image::{SignedImage, twin};
pub use journey::Journey;
pub use state::{CutState, CutStateError};
pub use sweep::{Cut, Ending, Sweep};
pub use tally::CutTally;
