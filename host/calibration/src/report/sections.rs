//! The parts that all reports have.

use super::checks::{self, Check};
use super::html::{Cell, Row, escape, significant};

/// The verdict, its figures, and the checks.
pub(super) fn verdict(sentence: &str, explanation: &str, facts: &[(&str, String)], list: &[Check]) -> String {
    let class = if list.iter().all(Check::is_good) { "good" } else { "attention" };
    let fact =
        |(name, value): &(&str, String)| format!("<div><dt>{}</dt><dd>{}</dd></div>\n", escape(name), escape(value));
    format!(
        "<section class=\"verdict {class}\"><p class=\"sentence\">{}</p>\n<p>{}</p>\n<dl class=\"facts\">\n{}</dl>\n{}\
         </section>\n",
        escape(sentence),
        escape(explanation),
        facts.iter().map(fact).collect::<String>(),
        checks::html(list)
    )
}

/// Tables among figures: titles, and bodies in HTML.
pub(super) fn panel(tables: &[(&str, String)]) -> String {
    let part = |(title, body): &(&str, String)| format!("<h3>{}</h3>\n{body}", escape(title));
    format!("<div class=\"panel\">{}</div>\n", tables.iter().map(part).collect::<String>())
}

/// Figures, side by side where the page is wide enough.
pub(super) fn figures(figures: &[String]) -> String {
    format!("<section class=\"figures\">\n{}</section>\n", figures.concat())
}

pub(super) fn text(text: impl Into<String>) -> Cell {
    Cell::Text(text.into())
}

pub(super) fn number(value: Option<f64>, digits: i32) -> Cell {
    Cell::Number(value.map_or_else(|| "–".to_owned(), |value| significant(value, digits)))
}

pub(super) fn count(value: usize) -> Cell {
    Cell::Number(value.to_string())
}

pub(super) fn plain(cells: Vec<Cell>) -> Row {
    Row { cells, marked: false }
}
