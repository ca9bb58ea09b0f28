//! Matches on the page.

use vergence_page::{Cell, count, data_url, figures, fixed, note, picture, plain, table, text};

use super::jpeg;
use crate::error::ReproduceError;
use crate::matching::{Matching, Picture};

/// The table, and a picture of every matcher.
pub fn body(matchings: &[Matching]) -> Result<String, ReproduceError> {
    if matchings.is_empty() {
        return Ok(note("Left out: --no-matching was given."));
    }
    let heads =
        ["mode", "matcher", "points", "median error of the range %", "95 % below", "off by more than 10 %", "note"];
    let percent = |share: f64| Cell::Number(fixed(100.0 * share, 2));
    let row = |matching: &Matching| {
        let mut cells = vec![text(matching.mode), text(matching.matcher.clone())];
        match &matching.outcome {
            Ok(outcome) => cells.extend([
                count(outcome.points),
                percent(outcome.score.all.median),
                percent(outcome.score.all.p95),
                percent(outcome.score.outlier_fraction),
                text(outcome.note.clone()),
            ]),
            Err(_) => {
                cells.extend(std::iter::repeat_n(Cell::Number("–".into()), 4));
                cells.push(text("not run, see below"));
            }
        }
        plain(cells)
    };
    let mut shown = Vec::new();
    for matching in matchings {
        if let Ok(outcome) = &matching.outcome {
            shown.push(picture(
                &format!("{}, {} mode", matching.matcher, matching.mode),
                &match &outcome.picture {
                    Picture::Svg(svg) => data_url("image/svg+xml", svg.as_bytes()),
                    Picture::Raster(pixels) => jpeg(pixels)?,
                },
                &outcome.note,
            ));
        }
    }
    Ok([
        table(&heads, &matchings.iter().map(row).collect::<Vec<_>>()),
        note(
            "The simulated room through the built-in bench's lenses of 960 × 960 pixels, with the poses known exactly. Our \
             matchers work on the unrectified pair over the whole shared field. Semi-global matching is dense, and is given a \
             pair that is rectified to a plane by the exact pose: it is scored on a sample of its pixels.",
        ),
        not_run(matchings),
        figures(&shown),
    ]
    .concat())
}

/// A sentence for each matcher that could not run.
fn not_run(matchings: &[Matching]) -> String {
    let mut sentences: Vec<String> = Vec::new();
    for matching in matchings {
        let Err(why) = &matching.outcome else { continue };
        let sentence = format!("{} was not run: {why}.", matching.matcher);
        if !sentences.contains(&sentence) {
            sentences.push(sentence);
        }
    }
    sentences.iter().map(|sentence| note(sentence)).collect()
}
