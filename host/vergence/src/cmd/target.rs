//! `vergence target`: a chessboard to print.

use std::path::PathBuf;

use serde_json::json;
use vergence_vision::Length;

use super::target_options::parse_inner_corners;
use crate::console::Console;
use crate::failure::Failure;
use crate::output::{Sheet, check_ending, write_whole};

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

/// ISO 216 sheets.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Paper {
    A4,
    A3,
    A2,
    A1,
    A0,
}

impl std::str::FromStr for Paper {
    type Err = String;
    fn from_str(text: &str) -> Result<Self, Self::Err> {
        match text.to_ascii_lowercase().as_str() {
            "a4" => Ok(Self::A4),
            "a3" => Ok(Self::A3),
            "a2" => Ok(Self::A2),
            "a1" => Ok(Self::A1),
            "a0" => Ok(Self::A0),
            _ => Err("choose A4, A3, A2, A1 or A0".into()),
        }
    }
}

impl std::fmt::Display for Paper {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(match self {
            Self::A4 => "A4",
            Self::A3 => "A3",
            Self::A2 => "A2",
            Self::A1 => "A1",
            Self::A0 => "A0",
        })
    }
}

impl Paper {
    /// Long and short side in millimetres.
    const fn size(self) -> (f64, f64) {
        match self {
            Self::A4 => (297.0, 210.0),
            Self::A3 => (420.0, 297.0),
            Self::A2 => (594.0, 420.0),
            Self::A1 => (841.0, 594.0),
            Self::A0 => (1189.0, 841.0),
        }
    }
}

pub fn run(args: &Args, console: Console) -> Result<(), Failure> {
    let (columns, rows) = args.inner_corners;
    let (width, height) = args.paper.size();
    let side = args.square.mm();
    if side.is_nan() || side <= 0.0 {
        return Err(Failure::usage(format!("squares cannot have a side of {}: give a positive length", args.square)));
    }
    // The squares around the inner corners, and a white border of half a square that detectors need.
    let (needed_width, needed_height) = (side * (f64::from(columns) + 2.0), side * (f64::from(rows) + 2.0));
    if needed_width > width || needed_height > height {
        return Err(Failure::usage(format!(
            "{columns}x{rows} corners of {side} mm need {needed_width:.0} x {needed_height:.0} mm with their border, \
             and {} has {width:.0} x {height:.0} mm: choose smaller squares or a larger sheet",
            args.paper
        )));
    }
    let sheet = Sheet {
        size: (width, height),
        squares: (columns + 1, rows + 1),
        side,
        label: format!("{columns}x{rows} inner corners, {side} mm squares"),
    };
    let bytes = match check_ending(&args.out, &["svg", "pdf"])? {
        "pdf" => sheet.pdf(),
        _ => sheet.svg().into_bytes(),
    };
    write_whole(&args.out, &bytes)?;
    console.say(format!("wrote {}: print it at 100 % and check a square with a ruler", args.out.display()))?;
    console.result(&json!({ "out": args.out }))
}
