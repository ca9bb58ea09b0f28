//! The vergence command: moves the rig, sees, and measures.
//!
//! Only this crate touches devices, files, sockets, clocks and the terminal. `cmd` holds one module per verb; `link`
//! speaks to a board; `sim` is a board without hardware; `camera` gives images; `look` turns a pair of images and a pose
//! into a cloud; `output` writes files, whole or not at all.
//!
//! Exit codes: 0 ok, 1 check failed, 2 usage or bad input, 3 device, 4 protocol mismatch.

pub mod board;
mod board_watch;
mod boards;
pub mod camera;
mod camera_files;
pub mod cli;
mod cmd;
mod console;
mod corners;
pub mod dense;
pub mod failure;
mod firmware;
pub mod flashing;
mod interrupt;
pub mod link;
pub mod live;
pub mod look;
pub mod models;
pub mod move_plan;
mod output;
mod provenance;
mod python;
mod reproduce;
mod rig_file;
mod rig_zones;
mod score;
pub mod setting_text;
pub mod sim;
mod slots;
mod stage_plan;
mod stopwatch;

pub use cli::run;
