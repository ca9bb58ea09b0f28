//! The vergence command: moves the rig, sees, and measures.
//!
//! `cmd` holds one module per verb and what verbs share; `sim` reads, serves and drives simulated boards. Only this crate
//! touches the terminal.
//!
//! Exit codes: 0 ok, 1 check failed, 2 usage or bad input, 3 device, 4 protocol mismatch.

pub mod cli;
mod cmd;
mod console;
pub use vergence_failure as failure;
mod firmware;
mod interrupt;
mod rig_file;
pub mod sim;
mod stopwatch;

pub use cli::run;
