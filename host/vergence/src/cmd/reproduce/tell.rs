//! The figures for people, as far as lines of text carry them.

use crate::console::Console;
use crate::failure::Failure;
use vergence_reproduce::{Matching, Table};

pub fn bench(tables: [&Table; 2], console: Console) -> Result<(), Failure> {
    for table in tables {
        let [low, high] = table.nees_band();
        console.say(format!(
            "{} rigs, corners off by {:.3} px (the rigs say {:.3}); {} of {} photographs without a target, {} of {} \
             corners refused; 95 % band of the NEES {low:.2} to {high:.2}",
            table.seeds,
            table.corner_px,
            table.stated_px,
            table.photographs[1],
            table.photographs[0],
            table.corners[1],
            table.corners[0],
        ))?;
        for row in &table.rows {
            let figures = &row.figures;
            let nees = row.nees.map_or(String::new(), |nees| format!(", NEES {nees:.2}"));
            console.say(format!(
                "  {:<10} {:<20} {:.3} mm = {:.3} %, std {:.3}, bias {:+.3}, bound {:.3} (pixels {:.3}){nees}",
                row.mode,
                row.method,
                figures.mean_abs_mm,
                figures.rel_percent,
                figures.std_mm,
                figures.bias_mm,
                figures.crb_mm,
                figures.crb_pixels_mm,
            ))?;
        }
    }
    Ok(())
}

pub fn matchings(matchings: &[Matching], console: Console) -> Result<(), Failure> {
    for Matching { mode, matcher, outcome } in matchings {
        match outcome {
            Ok(outcome) => console.say(format!(
                "  {mode:<10} {matcher:<24} {} points, median {:.2} %, {:.1} % off by more than 10 %",
                outcome.points,
                100.0 * outcome.score.all.median,
                100.0 * outcome.score.outlier_fraction
            ))?,
            Err(why) => console.say(format!("  {mode:<10} {matcher:<24} was not run: {why}"))?,
        }
    }
    Ok(())
}
