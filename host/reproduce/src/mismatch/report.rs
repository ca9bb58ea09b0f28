//! The table of mismatches as lines of text and as JSON.

use serde_json::{Value, json};
use vergence_calibration::LensModel;
use vergence_rig::rounded;

use super::{MODELS, Mismatch, MismatchTable, RANGES_MM, Verdict};
use crate::bench::MODES;

/// How a model is called in tables.
pub fn model_words(model: LensModel) -> &'static str {
    match model {
        LensModel::Central => "one centre",
        _ => "as the views ask",
    }
}

/// A head, a line for each mismatch, model and mode, what becomes of each mismatch, and the paper's share.
pub fn lines(table: &MismatchTable) -> Vec<String> {
    let [low, high] = table.band;
    let ranges: String = RANGES_MM.iter().map(|range| format!("{:>25}", format!("{range:.0} mm"))).collect();
    let mut lines = vec![
        format!(
            "{} rigs, lenses: ideal in the first rows, then traced, {}; corners and matches projected with noise",
            table.plan.seeds,
            table.plan.lens.name()
        ),
        format!("mean |depth error| (stated) in mm, NEES of 3: an honest one lies between {low:.1} and {high:.1}"),
        format!("  {:<47}{ranges}", "mismatch, lens calibrated with, mode"),
    ];
    for (mismatch, model, mode) in rows() {
        let cells = (0..RANGES_MM.len()).map(|range| {
            let cell = table.cell(mismatch, model, mode, range);
            let words =
                cell.map_or("-".into(), |c| format!("{:.3} ({:.3}), {:.1}", c.mean_abs_mm, c.stated_mm, c.nees));
            format!("{words:>25}")
        });
        let cells: String = cells.collect();
        let name = mismatch.as_str();
        lines.push(format!("  {name:<20}{:<17}{:<10}{cells}", model_words(model), MODES[mode]));
    }
    lines
        .extend(Mismatch::ALL.map(|mismatch| format!("{}: {}", mismatch.as_str(), table.verdict(mismatch).sentence())));
    lines.extend(table.paper().iter().map(|share| {
        format!(
            "the paper's {} mm in {} mode: such lenses with one centre alone give {:.3} mm, {:.0} % of it (bound {:.3} mm)",
            share.published_mm,
            share.mode,
            share.central_mm,
            100.0 * share.share(),
            share.bound_mm
        )
    }));
    lines
}

/// Every row of the tables.
pub fn rows() -> impl Iterator<Item = (Mismatch, LensModel, usize)> {
    Mismatch::ALL.into_iter().flat_map(|mismatch| {
        MODELS.into_iter().flat_map(move |model| (0..MODES.len()).map(move |mode| (mismatch, model, mode)))
    })
}

/// All figures.
pub fn json(table: &MismatchTable) -> Value {
    let cells = table.cells.iter().map(|cell| {
        json!({
            "mismatch": cell.mismatch.as_str(),
            "lens_model": cell.model.to_string(),
            "mode": MODES[cell.mode],
            "range_mm": RANGES_MM[cell.range],
            "points": cell.points,
            "mean_abs_mm": rounded(cell.mean_abs_mm),
            "stated_mm": rounded(cell.stated_mm),
            "nees": rounded(cell.nees),
        })
    });
    let verdicts = Mismatch::ALL.map(|mismatch| {
        let verdict = table.verdict(mismatch);
        json!({
            "mismatch": mismatch.as_str(),
            "size": mismatch.size(),
            "caught": !matches!(verdict, Verdict::NotCaught { .. }),
            "sentence": verdict.sentence(),
        })
    });
    let notes = table.notes.iter().map(|note| {
        json!({
            "mismatch": note.mismatch.as_str(),
            "lens_model": note.model.to_string(),
            "corner_sigma_px": rounded(note.corner_px),
            "clouds_warned": note.warned[0],
            "clouds": note.warned[1],
            "matches_refused": note.refused[0],
            "matches": note.refused[1],
        })
    });
    let paper = table.paper();
    let shares = paper.iter().map(|share| {
        json!({
            "mode": share.mode,
            "published_mm": share.published_mm,
            "one_centre_mm": rounded(share.central_mm),
            "bound_mm": rounded(share.bound_mm),
            "share": rounded(share.share()),
            "rest_mm": rounded(share.rest_mm()),
        })
    });
    json!({
        "lens": table.plan.lens.name(),
        "seeds": table.plan.seeds,
        "nees_band": table.band.map(rounded),
        "cells": cells.collect::<Vec<_>>(),
        "verdicts": verdicts,
        "rigs": notes.collect::<Vec<_>>(),
        "paper": shares.collect::<Vec<_>>(),
    })
}
