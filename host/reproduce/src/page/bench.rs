//! The precision bench on the page.

use vergence_page::{
    Anchor, Axes, Cell, Drawing, Path, Row, count, escape, figure, figures, fixed, note, picture, table, text,
};

use vergence_scene::LensChoice;

use super::{Findings, jpeg};
use crate::error::ReproduceError;
use crate::method::Method;
use crate::tally::{Figures, Row as Finding, Table};

const OURS: &str = Method::Ours.as_str();
/// What the project asks of its own method.
const GOAL_MM: f64 = 0.26;
const GOAL_OVER_BOUND: f64 = 1.2;

/// The first lines of the page.
pub fn verdict(findings: &Findings<'_>) -> String {
    let [table, _] = findings.tables;
    let ours: Vec<&Finding> = table.rows.iter().filter(|row| row.method == OURS).collect();
    let sentence = ours
        .iter()
        .map(|row| format!("{} mm in {} mode", fixed(row.figures.mean_abs_mm, 3), row.mode))
        .collect::<Vec<_>>()
        .join(", ");
    let checks: Vec<(bool, String)> = ours.iter().flat_map(|row| goals(row, table)).collect();
    let is_good = findings.rendered && checks.iter().all(|(met, _)| *met);
    let class = if is_good { "good" } else { "attention" };
    let item = |(met, words): &(bool, String)| {
        let (class, sign) = if *met { ("good", "✓") } else { ("attention", "!") };
        format!("<li class=\"{class}\"><span class=\"sign\">{sign}</span> {}</li>\n", escape(words))
    };
    format!(
        "<section class=\"verdict {class}\"><p class=\"sentence\">Mean depth error at 350 mm by our method, simulated: \
         {}.</p>\n<p>{}</p>\n<ul class=\"checks\">\n{}</ul></section>\n",
        escape(&sentence),
        escape(&circumstances(findings)),
        checks.iter().map(item).collect::<String>()
    )
}

fn goals(row: &Finding, table: &Table) -> [(bool, String); 3] {
    let (figures, mode) = (&row.figures, row.mode);
    let bound = figures.crb_mm.unwrap_or(f64::NAN);
    let ratio = figures.mean_abs_mm / bound;
    let [low, high] = table.nees_band();
    let nees = row.nees.unwrap_or(f64::NAN);
    [
        (
            figures.mean_abs_mm <= GOAL_MM,
            format!("{mode}: {} mm, goal at most {GOAL_MM} mm.", fixed(figures.mean_abs_mm, 3)),
        ),
        (
            ratio <= GOAL_OVER_BOUND,
            format!("{mode}: {} times the bound of {} mm, goal {GOAL_OVER_BOUND}.", fixed(ratio, 2), fixed(bound, 3)),
        ),
        (
            (low..=high).contains(&nees),
            format!(
                "{mode}: mean NEES {} of one corner for each of {} rigs, 95 % band {} to {}.",
                fixed(nees, 2),
                table.seeds,
                fixed(low, 2),
                fixed(high, 2)
            ),
        ),
    ]
}

fn circumstances(findings: &Findings<'_>) -> String {
    let [table, _] = findings.tables;
    let corners = if findings.rendered {
        "Photographs are rendered, and our detector finds the corners"
    } else {
        "NOT the whole chain: corners are projected and moved by Gaussian noise, nothing is rendered or detected"
    };
    let cameras = match findings.lens {
        LensChoice::Ideal => "the simulated cameras are exactly of the kind that the calibration assumes".to_owned(),
        lens => {
            format!("the simulated cameras look through {lens}, a published design that the calibration does not know")
        }
    };
    format!(
        "No hardware was used: everything here is simulated, and {cameras}. {corners}; they are off by {} px in u and v (root mean square, against the truth; \
         the rigs themselves say {}). Each of {} rigs has its own lenses and its own imperfect mechanism, and is \
         calibrated from such views alone. The paper's figures come from its hardware, with lenses, noise and a \
         calibration that we do not know: they stand beside ours for orientation, not as a comparison of methods.",
        fixed(table.corner_px, 3),
        fixed(table.stated_px, 3),
        table.seeds
    )
}

/// Tables, curves and pictures.
pub fn body(findings: &Findings<'_>) -> Result<String, ReproduceError> {
    let [table, noisier] = findings.tables;
    let mut shown = vec![
        figure(
            "Error over the angle from straight ahead",
            &over_field(table),
            "Mean absolute depth error of our method in steps of 10°; thin: what the bound allows, from pixels and calibration.",
        ),
        figure(
            "The same with twice the noise",
            &over_field(noisier),
            &format!("Corners off by {} px, {} rigs.", fixed(noisier.corner_px, 3), noisier.seeds),
        ),
    ];
    for (mode, picture_) in findings.targets {
        shown.push(picture(
            &format!("The target in {mode} mode"),
            &jpeg(picture_)?,
            "Left and right camera, drawn small; the bench uses 2048 × 2048 pixels.",
        ));
    }
    let photographs = format!(
        "{} photographs for calibration, in {} of them no target was found; {} corners seen by both cameras on the \
         bench, {} refused by the epipolar gate.{}",
        table.photographs[0],
        table.photographs[1],
        table.corners[0],
        table.corners[1],
        if findings.rendered {
            " Only the part of each 2048 × 2048 photograph that shows the target is rendered, by the same lens."
        } else {
            ""
        }
    );
    Ok([
        of_methods(table),
        note(
            "Depth is measured from the baseline along the rig's forward direction. Bound: √(2/π) √(mean variance), \
             the mean absolute error of a method at the Cramér-Rao bound, from the noise of the pixels and of the \
             calibration over the same corners, as the rigs themselves state it corner by corner: no method beats a \
             bound, and errors below it mean that too much noise is stated. NEES: the square of one corner's error in \
             units of its covariance, 3 on average if that is right. Bound and NEES need a stated covariance: only ours states one.",
        ),
        note(&photographs),
        format!("<h3>With corners off by {} px</h3>\n", fixed(noisier.corner_px, 3)),
        of_methods(noisier),
        figures(&shown),
    ]
    .concat())
}

fn of_methods(table_: &Table) -> String {
    let heads = [
        "mode",
        "method",
        "mean |error| mm",
        "% of depth",
        "std mm",
        "bias mm",
        "bound mm",
        "of pixels alone",
        "error / bound",
        "NEES",
        "corners",
    ];
    let row = |row: &Finding| {
        let f = &row.figures;
        let cells = vec![
            text(row.mode),
            text(row.method),
            three(f.mean_abs_mm),
            three(f.rel_percent),
            three(f.std_mm),
            three(f.bias_mm),
            bound(f.crb_mm, 3),
            bound(f.crb_pixels_mm, 3),
            bound(f.crb_mm.map(|bound| f.mean_abs_mm / bound), 2),
            row.nees.map_or(Cell::Number("–".into()), |nees| Cell::Number(fixed(nees, 2))),
            count(f.corners),
        ];
        Row { cells, marked: row.method == OURS }
    };
    table(&heads, &table_.rows.iter().map(row).collect::<Vec<_>>())
}

/// Of a method that states a covariance.
fn bound(value: Option<f64>, decimals: i32) -> Cell {
    Cell::Number(value.map_or("–".into(), |value| fixed(value, decimals)))
}

fn three(value: f64) -> Cell {
    Cell::Number(fixed(value, 3))
}

fn over_field(table: &Table) -> Drawing {
    const COLOURS: [&str; 2] = ["#2357a5", "#b25e09"];
    let mut drawing = Drawing::new(620.0, 320.0);
    let ours: Vec<&Finding> = table.rows.iter().filter(|row| row.method == OURS).collect();
    let steps = ours.iter().flat_map(|row| &row.field);
    let bound = |f: &Figures| f.crb_mm.unwrap_or(0.0);
    let highest = steps.clone().map(|(_, f)| f.mean_abs_mm.max(bound(f))).fold(0.0, f64::max);
    let widest = steps.map(|(from, _)| from + 10.0).fold(10.0, f64::max);
    let axes = Axes::filling(&drawing, [0.0, widest], [0.0, 1.15 * highest.max(1e-3)]);
    axes.draw(&mut drawing, "angle from straight ahead (°)", "depth error (mm)");
    for (index, (row, colour)) in ours.iter().zip(COLOURS).enumerate() {
        let line = |of: &dyn Fn(&Figures) -> f64| {
            Path::through(&row.field.iter().map(|(from, f)| axes.at(from + 5.0, of(f))).collect::<Vec<_>>())
        };
        drawing.path(&line(&|f| f.mean_abs_mm), "run", &format!("stroke:{colour}"));
        drawing.path(&line(&bound), "level", &format!("stroke:{colour}"));
        let y = 30.0 + 18.0 * index as f64;
        drawing.path(&Path::through(&[[80.0, y], [104.0, y]]), "run", &format!("stroke:{colour}"));
        drawing.text([110.0, y + 4.0], Anchor::Start, "tick", row.mode);
    }
    drawing
}
