//! `vergence target`: a chessboard to print.

use std::path::PathBuf;

use serde_json::json;
use vergence_files::write_whole;
use vergence_output::{Paper, Sheet, check_ending};
use vergence_vision::Length;

use super::target_options::parse_inner_corners;
use crate::console::Console;
use crate::failure::Failure;

/// Draws a chessboard in true size, as SVG or PDF. Print it at 100 %, glue it to something flat, and measure the squares.
#[derive(Debug, clap::Args)]
pub struct Args {
    /// Inner corners, such as 9x6.
    #[arg(long = "corners", alias = "board", value_parser = parse_inner_corners, value_name = "CxR")]
    inner_corners: (u32, u32),
    /// Side of a square.
    #[arg(long)]
    square: Length,
    /// The sheet; the long side lies across.
    #[arg(long, default_value = "a4")]
    paper: Paper,
    /// The file to write: its ending, .svg or .pdf, says which kind.
    #[arg(long, short, value_name = "FILE")]
    out: PathBuf,
}

pub fn run(args: &Args, console: Console) -> Result<(), Failure> {
    let sheet = Sheet::with_target(args.paper, args.inner_corners, args.square)?;
    let bytes = match check_ending(&args.out, &["svg", "pdf"])? {
        "pdf" => sheet.pdf(),
        _ => sheet.svg().into_bytes(),
    };
    write_whole(&args.out, &bytes)?;
    console.say(format!("wrote {}: print it at 100 % and check a square with a ruler", args.out.display()))?;
    console.result(&json!({ "out": args.out }))
}
