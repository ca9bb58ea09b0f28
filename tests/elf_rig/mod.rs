//! A host and a board on one wire, in virtual time. The board is the unmodified firmware on the simulated chip, boot
//! loader and all, or the native board that runs the same controller.
#![allow(dead_code, unused_imports, reason = "each test file uses its own part")]

mod adapter;
mod board;
mod build;
mod continuity;
#[path = "../conversation.rs"]
mod conversation;
mod full_speed;
mod log;
mod program;
mod stories;

pub use adapter::{Adapter, AdapterKind};
pub use board::{Board, ElfBoard, Standing, programs};
pub use build::{build_trusting, build_wired};
pub use continuity::Continuity;
pub use conversation::{BOTH, Conversation, LEASE_MS, Wired};
pub use full_speed::{POSE_PERIOD_US, at_full_speed, cruise, far_from, geared};
pub use log::decode;
pub use program::{DEVELOPMENT_SECRET, sealed_by};
pub(crate) use stories::stories;
