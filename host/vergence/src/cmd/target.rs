//! `vergence target`: a target to print.

use std::path::PathBuf;

use serde_json::json;
use vergence_files::write_whole;
use vergence_output::{Paper, Sheet, check_ending};

use super::target_options::TargetOptions;
use crate::console::Console;
use crate::failure::Failure;

/// Draws a calibration target in true size, as SVG or PDF, with a ruler. Print it at 100 %, glue it to something flat, and
/// measure it.
#[derive(Debug, clap::Args)]
pub struct Args {
    #[command(flatten)]
    target: TargetOptions,
    /// The sheet; the long side lies across.
    #[arg(long, default_value = "a4")]
    paper: Paper,
    /// The file to write: its ending, .svg or .pdf, says which kind.
    #[arg(long, short, value_name = "FILE")]
    out: PathBuf,
}

pub fn run(args: &Args, console: Console) -> Result<(), Failure> {
    let target = args.target.spec()?;
    let (print, label) = (target.print(), target.to_string().replace('×', "x"));
    let sheet = Sheet::with_target(args.paper, &print.black, print.size_mm, label)?;
    let bytes = match check_ending(&args.out, &["svg", "pdf"])? {
        "pdf" => sheet.pdf(),
        _ => sheet.svg().into_bytes(),
    };
    write_whole(&args.out, &bytes)?;
    console.say(format!("wrote {}: print it at 100 % and check its ruler with yours", args.out.display()))?;
    console.result(&json!({ "out": args.out, "target": target.to_string() }))
}
