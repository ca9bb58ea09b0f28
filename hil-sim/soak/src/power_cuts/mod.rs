//! Power cuts in the middle of a firmware update: at any operation of the flash, with the word or page under way left
//! torn. The boot loader and the application are those of the board, on the simulated chip.
//!
//! Nothing outlives the power but the flash. So one whole update is run and every operation of its flash listed; a cut
//! at one of them is the flash before it, with that operation half done; and a board with this flash gets power.

mod image;
mod known;
mod sweep;
mod talk;
mod tally;

pub use image::{SignedImage, twin};
pub use sweep::{Cut, Ending, Journey, Sweep};
pub use tally::CutTally;
