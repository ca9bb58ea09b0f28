//! The figures for programs and for people, as far as lines of text carry them.

use serde_json::{Value, json};

use vergence_rig::{rounded, zones_json};
use vergence_scene::LensChoice;

use crate::bench::MODES;
use crate::causes::Column;
use crate::matching::Matching;
use crate::method::METHODS;
use crate::tally::{Figures, Row, Table};
use crate::undistorted::Undistorted;
use crate::zones::ModeZones;

/// One for each method in each mode.
pub fn rows(table: &Table) -> Vec<Value> {
    table.rows.iter().map(row).collect()
}

fn row(row: &Row) -> Value {
    let mut value = figures(&row.figures);
    value["mode"] = row.mode.into();
    value["method"] = row.method.into();
    value["nees"] = row.nees.map(rounded).into();
    let step = |(from, figures_): &(f64, Figures)| {
        let mut value = figures(figures_);
        value["from_deg"] = (*from).into();
        value
    };
    value["field"] = row.field.iter().map(step).collect::<Vec<_>>().into();
    value
}

fn figures(figures: &Figures) -> Value {
    json!({
        "corners": figures.corners,
        "mean_abs_mm": rounded(figures.mean_abs_mm),
        "rel_percent": rounded(figures.rel_percent),
        "std_mm": rounded(figures.std_mm),
        "bias_mm": rounded(figures.bias_mm),
        "crb_mm": figures.crb_mm.map(rounded),
        "crb_pixels_mm": figures.crb_pixels_mm.map(rounded),
    })
}

/// Quality of the corners of all views.
pub fn corners(table: &Table) -> Value {
    json!({
        "seeds": table.seeds,
        "off_px": rounded(table.corner_px),
        "stated_px": rounded(table.stated_px),
        "nees_band": table.nees_band().map(rounded),
        "photographs": table.photographs[0],
        "without_board": table.photographs[1],
        "on_bench": table.corners[0],
        "refused": table.corners[1],
    })
}

/// One for each mode of the paper.
pub fn zones(modes: &[ModeZones]) -> Vec<Value> {
    let of = |mode: &ModeZones| {
        let published = &mode.published;
        json!({
            "mode": published.name,
            "baseline_mm": rounded(published.baseline.mm()),
            "separation_deg": rounded(published.separation.deg()),
            "radius_mm": rounded(published.radius.mm()),
            "published": {
                "stereo": rounded(published.stereo.deg()),
                "mono": published.mono.map(|mono| rounded(mono.deg())),
            },
            "paper_eq3": mode.paper_eq3.as_ref().map(zones_json),
            "exact": mode.exact.as_ref().map(zones_json),
        })
    };
    modes.iter().map(of).collect()
}

/// One for each matcher in each mode.
pub fn matchings(matchings: &[Matching]) -> Vec<Value> {
    let of = |matching: &Matching| match &matching.outcome {
        Ok(outcome) => json!({
            "mode": matching.mode,
            "matcher": matching.matcher,
            "points": outcome.points,
            "median": rounded(outcome.score.all.median),
            "p95": rounded(outcome.score.all.p95),
            "outlier_fraction": rounded(outcome.score.outlier_fraction),
        }),
        Err(why) => json!({ "mode": matching.mode, "matcher": matching.matcher, "missing": why }),
    };
    matchings.iter().map(of).collect()
}

/// A line for each table, and one for each of its methods in each mode.
pub fn bench_lines(tables: [&Table; 2]) -> Vec<String> {
    let mut lines = Vec::new();
    for table in tables {
        let [low, high] = table.nees_band();
        lines.push(format!(
            "{} rigs, corners off by {:.3} px (the rigs say {:.3}); {} of {} photographs without a target, {} of {} \
             corners refused; 95 % band of the NEES {low:.2} to {high:.2}",
            table.seeds,
            table.corner_px,
            table.stated_px,
            table.photographs[1],
            table.photographs[0],
            table.corners[1],
            table.corners[0],
        ));
        for row in &table.rows {
            let figures = &row.figures;
            let bounds = figures.crb_mm.zip(figures.crb_pixels_mm);
            let bound = bounds.map_or(String::new(), |(all, pixels)| format!(", bound {all:.3} (pixels {pixels:.3})"));
            let nees = row.nees.map_or(String::new(), |nees| format!(", NEES {nees:.2}"));
            lines.push(format!(
                "  {:<10} {:<20} {:.3} mm = {:.3} %, std {:.3}, bias {:+.3}{bound}{nees}",
                row.mode, row.method, figures.mean_abs_mm, figures.rel_percent, figures.std_mm, figures.bias_mm,
            ));
        }
    }
    lines
}

/// Each kind of error: its size, every method under it, and how it compares with the paper.
pub fn causes(columns: &[Column], lens: LensChoice) -> Vec<Value> {
    let undistorted = |(mode, seen): (&&str, &Undistorted)| {
        json!({
            "mode": mode,
            "corners": seen.corners,
            "inside": seen.inside,
            "found": seen.found,
            "stretch": rounded(seen.mean_stretch()),
            "off_px": rounded(seen.off_px()),
            "views": seen.views,
        })
    };
    let of = |column: &Column| {
        json!({
            "cause": column.cause.as_str(),
            "size": column.cause.size(lens),
            "bench": rows(&column.table),
            "corners": corners(&column.table),
            "times_for_paper": column.times().map(|times| times.map(rounded)),
            "closest_times": column.closest().map(|closest| rounded(closest.times)),
            "closest_off_by": column.closest().map(|closest| rounded(closest.worst)),
            "undistorted": MODES.iter().zip(&column.table.undistorted).map(undistorted).collect::<Vec<_>>(),
        })
    };
    columns.iter().map(of).collect()
}

/// A line for each method in each mode, with the error by each cause, and one for the paper's pattern.
pub fn cause_lines(columns: &[Column]) -> Vec<String> {
    let line = |name: &str, cell: &dyn Fn(&Column) -> String| {
        let cells: String = columns.iter().map(|column| format!("{:>16}", cell(column))).collect();
        format!("  {name:<31}{cells}")
    };
    let number = |value: Option<f64>| value.map_or("-".into(), |value| format!("{value:.3}"));
    let mut lines = vec![line("mean error in mm by cause", &|column| column.cause.as_str().into())];
    for (mode, method) in MODES.iter().flat_map(|mode| METHODS.map(|method| (mode, method))) {
        lines.push(line(&format!("{mode:<10} {}", method.as_str()), &|column| {
            number(column.table.row(mode, method.as_str()).map(|row| row.figures.mean_abs_mm))
        }));
    }
    lines.push(line("off from the paper by a factor", &|column| number(column.closest().map(|closest| closest.worst))));
    lines
}

/// A line for each matcher in each mode.
pub fn matching_lines(matchings: &[Matching]) -> Vec<String> {
    let line = |Matching { mode, matcher, outcome }: &Matching| match outcome {
        Ok(outcome) => format!(
            "  {mode:<10} {matcher:<24} {} points, median {:.2} %, {:.1} % off by more than 10 %",
            outcome.points,
            100.0 * outcome.score.all.median,
            100.0 * outcome.score.outlier_fraction
        ),
        Err(why) => format!("  {mode:<10} {matcher:<24} was not run: {why}"),
    };
    matchings.iter().map(line).collect()
}
