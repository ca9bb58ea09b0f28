//! How a chessboard is named on the command line.

use vergence_calibration::BoardSpec;
use vergence_vision::Length;

use crate::failure::Failure;

/// The chessboard.
#[derive(Clone, Copy, Debug, clap::Args)]
pub struct BoardOptions {
    /// Inner corners, such as 9x6.
    #[arg(long, value_parser = parse_inner_corners, value_name = "CxR")]
    pub board: Option<(u32, u32)>,
    /// Side of a square, such as 24.23mm.
    #[arg(long, value_name = "LENGTH")]
    pub square: Option<Length>,
}

impl BoardOptions {
    /// The board.
    ///
    /// # Errors
    /// Where an option is missing or the square is none.
    pub fn spec(&self) -> Result<BoardSpec, Failure> {
        let (Some((columns, rows)), Some(square)) = (self.board, self.square) else {
            return Err(Failure::usage("describe the chessboard: --board 9x6 --square 24.23mm"));
        };
        if square.mm().is_nan() || square.mm() <= 0.0 {
            return Err(Failure::usage(format!("squares of {square} are none")));
        }
        Ok(BoardSpec { columns, rows, square })
    }
}

/// `9x6`: columns and rows of inner corners.
///
/// # Errors
/// Says what is expected.
pub fn parse_inner_corners(text: &str) -> Result<(u32, u32), String> {
    const HINT: &str = "count the inner corners, such as 9x6, from 3x3 to 99x99";
    let (columns, rows) = text.split_once(['x', 'X', '×']).ok_or(HINT)?;
    let count = |part: &str| part.trim().parse().ok().filter(|n| (3..=99).contains(n)).ok_or(HINT);
    Ok((count(columns)?, count(rows)?))
}
