//! The vergence command: moves the rig, sees, and measures.
//!
//! `cmd` holds one module per verb and what verbs share; `sim` reads, serves and drives simulated boards; `live` measures while
//! the stages move. Only this crate touches the terminal.
//!
//! Exit codes: 0 ok, 1 check failed, 2 usage or bad input, 3 device, 4 protocol mismatch.

mod camera_files;
pub mod cli;
mod cmd;
mod console;
mod corners;
mod csv_file;
pub mod failure;
mod firmware;
mod interrupt;
pub mod live;
mod provenance;
mod rig_file;
mod serial_ports;
pub mod sim;
mod slots;
mod stopwatch;
mod target_images;
mod target_watch;

pub use cli::run;
