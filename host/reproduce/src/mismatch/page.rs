//! The table of mismatches on one self-contained page.

use vergence_calibration::LensModel;
use vergence_page::{Cell, Page, Row, escape, fixed, note, page, plain, section, table, text};

use super::report::{model_words, rows};
use super::{Mismatch, MismatchTable, RANGES_MM, RowNote, Verdict};
use crate::bench::MODES;
use crate::conditions::NOISE_PX;

/// The page.
#[must_use]
pub fn mismatch_page(findings: &MismatchTable) -> String {
    let modes =
        MODES.iter().enumerate().map(|(mode, name)| section(&format!("In {name} mode"), &of_mode(findings, mode)));
    let body = [
        verdicts(findings),
        modes.collect(),
        section("What the rig itself says", &said(findings)),
        section("The paper's errors", &paper(findings)),
    ];
    page(&Page {
        kind: "Mismatches",
        title: "Worlds that are not as the calibration assumes".into(),
        origin: vec![
            ("Made by", concat!("vergence ", env!("CARGO_PKG_VERSION")).into()),
            ("Command", findings.plan.command()),
            ("Lenses", format!("ideal in the first rows, then {}, traced", findings.plan.lens.name())),
        ],
        body: body.concat(),
        footer: note("The same command gives the same page, byte for byte, on the same machine."),
    })
}

fn verdicts(findings: &MismatchTable) -> String {
    let all = Mismatch::ALL.map(|mismatch| (mismatch, findings.verdict(mismatch)));
    let missed = all.iter().filter(|(_, verdict)| matches!(verdict, Verdict::NotCaught { .. })).count();
    let item = |(mismatch, verdict): &(Mismatch, Verdict)| {
        let (class, sign) = match verdict {
            Verdict::Harmless => ("good", "✓"),
            Verdict::Stated(_) => ("attention", "~"),
            Verdict::NotCaught { .. } => ("attention", "!"),
        };
        let words = format!("{}, {}: {}", mismatch.as_str(), mismatch.size(), verdict.sentence());
        format!("<li class=\"{class}\"><span class=\"sign\">{sign}</span> {}</li>\n", escape(&words))
    };
    let class = if missed == 0 { "good" } else { "attention" };
    format!(
        "<section class=\"verdict {class}\"><p class=\"sentence\">{missed} of {} mismatches are not caught where the views choose \
         the model of the lens.</p>\n<p>{}</p>\n<ul class=\"checks\">\n{}</ul></section>\n",
        all.len(),
        escape(&circumstances(findings)),
        all.iter().map(item).collect::<String>()
    )
}

fn circumstances(findings: &MismatchTable) -> String {
    let [low, high] = findings.band;
    format!(
        "No hardware was used. {} rigs, each with its own lenses and its own imperfect mechanism; corners and matches are projected \
         with noise of {NOISE_PX} px, nothing is rendered or detected. Lenses and stage are calibrated by the functions of 'vergence \
         calibrate', and points are measured by the rig file that this writes. All mismatches but the first come on top of traced lenses. \
         An honest NEES of 3 lies between {} and {} here, three standard deviations; one above is not caught.",
        findings.plan.seeds,
        fixed(low, 1),
        fixed(high, 1)
    )
}

fn of_mode(findings: &MismatchTable, mode: usize) -> String {
    let ranges = RANGES_MM.map(|range| [format!("{range:.0} mm: error"), "stated".into(), "NEES".into()]);
    let mut heads = vec!["mismatch".to_owned(), "lens calibrated with".to_owned()];
    heads.extend(ranges.into_iter().flatten());
    let heads: Vec<&str> = heads.iter().map(String::as_str).collect();
    let row = |(mismatch, model, _): (Mismatch, LensModel, usize)| {
        let cells = (0..RANGES_MM.len()).flat_map(|range| {
            let cell = findings.cell(mismatch, model, mode, range);
            let figure = |value: Option<f64>, decimals| Cell::Number(value.map_or("–".into(), |v| fixed(v, decimals)));
            let of = |value: fn(&super::Cell) -> f64| cell.map(value);
            [figure(of(|c| c.mean_abs_mm), 3), figure(of(|c| c.stated_mm), 3), figure(of(|c| c.nees), 1)]
        });
        let names = [text(mismatch.as_str()), text(model_words(model))];
        Row { cells: names.into_iter().chain(cells).collect(), marked: model == LensModel::default() }
    };
    let rows: Vec<Row> = rows().filter(|(_, _, of)| *of == mode).map(row).collect();
    table(&heads, &rows)
        + &note(
            "Mean absolute error of the depth in millimetres, what the rig files state it to be, which is the bound if nothing but noise is \
             in it, and the mean square of a point's error in units of its covariance. Lenses with displaced elements or a tilted sensor have no axis: \
             their points are compared in the frame that the calibration gives the left lens.",
        )
}

fn said(findings: &MismatchTable) -> String {
    let row = |note: &RowNote| {
        plain(vec![
            text(note.mismatch.as_str()),
            text(model_words(note.model)),
            Cell::Number(fixed(note.corner_px, 3)),
            Cell::Number(format!("{} of {}", note.warned[0], note.warned[1])),
            Cell::Number(format!("{} of {}", note.refused[0], note.refused[1])),
        ])
    };
    let heads = [
        "mismatch",
        "lens calibrated with",
        "corners off by, as calibrations find (px)",
        "clouds with a warning",
        "matches refused",
    ];
    table(&heads, &findings.notes.iter().map(row).collect::<Vec<_>>())
        + &note(&format!(
            "Corners are off by {NOISE_PX} px: a model that does not fit makes them seem worse. The warning is that images disagree \
             with lenses or encoders, of a cloud of matches all over the field that both cameras share."
        ))
}

fn paper(findings: &MismatchTable) -> String {
    let row = |share: &super::PaperShare| {
        plain(vec![
            text(share.mode),
            Cell::Number(share.published_mm.to_string()),
            Cell::Number(fixed(share.central_mm, 3)),
            Cell::Number(fixed(share.bound_mm, 3)),
            Cell::Number(format!("{} %", fixed(100.0 * share.share(), 0))),
            Cell::Number(fixed(share.rest_mm(), 2)),
        ])
    };
    let heads = ["mode", "the paper, mm", "traced lenses, one centre", "bound of noise", "share", "not explained, mm"];
    table(&heads, &findings.paper().iter().map(row).collect::<Vec<_>>())
        + &note(
            "Mean absolute error of the depth at 350 mm. The share is what the rig shows with such lenses, calibrated with one centre, and \
             this noise alone; what is not explained is √(published² - that²). Nobody knows the lenses of the paper.",
        )
}
