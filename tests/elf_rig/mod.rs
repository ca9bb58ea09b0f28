//! A host and a board on one wire, in virtual time. The board is the unmodified firmware on the simulated chip, boot
//! loader and all, or the native board that runs the same controller.
#![allow(dead_code, unused_imports, reason = "each test file uses its own part")]

mod board;
mod build;
#[path = "../conversation.rs"]
mod conversation;
mod log;
mod program;

pub use board::{Board, ElfBoard, Standing, programs};
pub use build::build_trusting;
pub use conversation::{BOTH, Conversation, LEASE_MS, Wired};
pub use log::decode;
pub use program::{DEVELOPMENT_SECRET, sealed_by};
