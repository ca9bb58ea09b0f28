//! How a chessboard is named on the command line.

use vergence_calibration::TargetSpec;
use vergence_vision::Length;

use crate::console::Console;
use crate::failure::Failure;
use crate::plausible::ForceOption;
use crate::plausible::target::square_can_be_held;

/// The chessboard.
#[derive(Clone, Copy, Debug, clap::Args)]
pub struct TargetOptions {
    /// Inner corners, such as 9x6.
    #[arg(long = "corners", alias = "board", value_parser = parse_inner_corners, value_name = "CxR")]
    pub inner_corners: Option<(u32, u32)>,
    /// Side of a square, such as 24.23mm.
    #[arg(long, value_name = "LENGTH")]
    pub square: Option<Length>,
}

impl TargetOptions {
    /// The target.
    ///
    /// # Errors
    /// Where an option is missing or the square is none, or none that a person can mean.
    pub fn checked_spec(&self, force: ForceOption, console: Console) -> Result<TargetSpec, Failure> {
        let spec = self.spec()?;
        force.unless_forced(square_can_be_held(&spec), console)?;
        Ok(spec)
    }

    /// The target, whatever its size.
    ///
    /// # Errors
    /// Where an option is missing or the square is none.
    pub fn spec(&self) -> Result<TargetSpec, Failure> {
        let (Some((columns, rows)), Some(square)) = (self.inner_corners, self.square) else {
            return Err(Failure::usage("describe the target: --corners 9x6 --square 24.23mm"));
        };
        if square.mm().is_nan() || square.mm() <= 0.0 {
            return Err(Failure::usage(format!("squares cannot have a side of {square}: give a positive length")));
        }
        Ok(TargetSpec { columns, rows, square })
    }
}

/// `9x6`: columns and rows of inner corners.
///
/// # Errors
/// Says what is expected.
pub fn parse_inner_corners(text: &str) -> Result<(u32, u32), String> {
    const HINT: &str = "count the inner corners, such as 9x6, from 3x3 to 99x99";
    if text.ends_with(".csv") {
        return Err("corners in a file are given with --csv".into());
    }
    let (columns, rows) = text.split_once(['x', 'X', '×']).ok_or(HINT)?;
    let count = |part: &str| part.trim().parse().ok().filter(|n| (3..=99).contains(n)).ok_or(HINT);
    Ok((count(columns)?, count(rows)?))
}
