//! The zones on the page.

use vergence_page::{Cell, data_url, figures, fixed, note, picture, plain, table, text};
use vergence_vision::{Angle, Zones};

use crate::page::Findings;
use crate::zones::ModeZones;

/// The table, and curves of the herbivore mode.
pub fn body(findings: &Findings<'_>) -> String {
    let heads = [
        "mode",
        "baseline, separation, radius",
        "published stereo / mono",
        "equation 3 as printed",
        "exact: stereo / mono / blind",
    ];
    let rows: Vec<_> = findings.zones.iter().map(row).collect();
    let curves = picture(
        "Zones over separation and over radius",
        &data_url("image/svg+xml", findings.zones_svg.as_bytes()),
        "Solid: exact; dashed: equation 3 where it applies; the red line is the herbivore mode of the bench.",
    );
    [
        table(&heads, &rows.into_iter().map(plain).collect::<Vec<_>>()),
        note(
            "Degrees of a horizontal circle around the rig. The paper prints neither baselines nor separations: those here are \
             nominal ones that come near its figures. Its mono and blind zones follow from an equation that is exact for lenses \
             of 180°; exact ones are found by counting intervals, for any pose. The figures of the stick-bug mode fit neither.",
        ),
        figures(&[curves]),
    ]
    .concat()
}

fn row(mode: &ModeZones) -> Vec<Cell> {
    let published = &mode.published;
    let degrees = |angle: Angle| fixed(angle.deg(), 1);
    let all = |zones: &Zones| [zones.stereo, zones.mono, zones.blind].map(degrees).join(" / ");
    vec![
        text(published.name),
        text(format!("{:.0}, {:.0}, {:.0}", published.baseline, published.separation, published.radius)),
        text(format!(
            "{} / {}",
            fixed(published.stereo.deg(), 0),
            published.mono.map_or_else(|| "–".to_owned(), |mono| fixed(mono.deg(), 0))
        )),
        text(mode.paper_eq3.as_ref().map_or_else(|| "outside its domain".to_owned(), all)),
        text(mode.exact.as_ref().map_or_else(|| "–".to_owned(), all)),
    ]
}
