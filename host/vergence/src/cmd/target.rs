//! `vergence target`: a chessboard to print.

use std::fmt::Write;
use std::path::PathBuf;

use serde_json::json;
use vergence_calibration::BoardSpec;
use vergence_vision::Length;

use super::board_options::parse_inner_corners;
use crate::console::Console;
use crate::failure::Failure;
use crate::output::write_whole;

/// Draws a chessboard as SVG in true size. Print it at 100 %, glue it to something flat, and measure the squares.
#[derive(Debug, clap::Args)]
pub struct Args {
    /// Inner corners, such as 9x6.
    #[arg(long, value_parser = parse_inner_corners)]
    board: (u32, u32),
    /// Side of a square.
    #[arg(long)]
    square: Length,
    /// The sheet; the long side lies across.
    #[arg(long, default_value = "a4")]
    paper: Paper,
    /// The file to write.
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
    let (columns, rows) = args.board;
    let board = BoardSpec { columns, rows, square: args.square };
    let (width, height) = args.paper.size();
    let side = args.square.mm();
    if side.is_nan() || side <= 0.0 {
        return Err(Failure::usage(format!("squares of {} are none", args.square)));
    }
    // The squares around the inner corners, and a white border of half a square that detectors need.
    let (needed_width, needed_height) = (side * (f64::from(columns) + 2.0), side * (f64::from(rows) + 2.0));
    if needed_width > width || needed_height > height {
        return Err(Failure::usage(format!(
            "{columns}x{rows} corners of {side} mm need {needed_width:.0} x {needed_height:.0} mm with their border, \
             and {:?} has {width:.0} x {height:.0} mm: choose smaller squares or a larger sheet",
            args.paper
        )));
    }
    write_whole(&args.out, svg(&board, (width, height)).as_bytes())?;
    console.say(format!("wrote {}: print it at 100 % and check a square with a ruler", args.out.display()))?;
    console.result(&json!({ "out": args.out }))
}

fn svg(board: &BoardSpec, (width, height): (f64, f64)) -> String {
    let side = board.square.mm();
    let (columns, rows) = (board.columns + 1, board.rows + 1);
    let (left, top) = ((width - side * f64::from(columns)) / 2.0, (height - side * f64::from(rows)) / 2.0);
    let mut text = format!(
        "<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"{width}mm\" height=\"{height}mm\" viewBox=\"0 0 {width} {height}\">\n\
         <rect width=\"{width}\" height=\"{height}\" fill=\"white\"/>\n<g fill=\"black\" shape-rendering=\"crispEdges\">\n"
    );
    for (row, column) in (0..rows).flat_map(|row| (0..columns).map(move |column| (row, column))) {
        if (row + column).is_multiple_of(2) {
            let (x, y) = (left + side * f64::from(column), top + side * f64::from(row));
            let _ = writeln!(text, "<rect x=\"{x}\" y=\"{y}\" width=\"{side}\" height=\"{side}\"/>");
        }
    }
    let _ = writeln!(
        text,
        "</g>\n<text x=\"{left}\" y=\"{}\" font-family=\"sans-serif\" font-size=\"3\" fill=\"#888\">{}x{} inner corners, \
         {side} mm squares</text>\n</svg>",
        height - 2.0,
        board.columns,
        board.rows
    );
    text
}
