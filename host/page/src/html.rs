//! HTML elements that are also well-formed XML. All text is escaped.

use crate::svg::Drawing;
use crate::text::{escape, fixed, significant};

const STYLE: &str = include_str!("style.css");

/// The content of a cell of a table.
#[derive(Clone, Debug, PartialEq)]
pub enum Cell {
    /// Left-aligned text.
    Text(String),
    /// A right-aligned number.
    Number(String),
    /// A bar whose length is this fraction of the full width, 0 to 1.
    Bar(f64),
}

/// A row of a table.
#[derive(Clone, Debug, PartialEq)]
pub struct Row {
    /// The cells, one for each column.
    pub cells: Vec<Cell>,
    /// Whether the row is highlighted.
    pub marked: bool,
}

/// Makes a table. The heads of columns are aligned like the cells of the first row.
#[must_use]
pub fn table(heads: &[&str], rows: &[Row]) -> String {
    let first = rows.first().map_or(&[][..], |row| &row.cells);
    let is_number = |column: usize| matches!(first.get(column), Some(Cell::Number(_)));
    let head = |(column, head): (usize, &&str)| {
        let class = if is_number(column) { " class=\"number\"" } else { "" };
        format!("<th{class}>{}</th>", escape(head))
    };
    let heads: String = heads.iter().enumerate().map(head).collect();
    let rows: String = rows.iter().map(row).collect();
    format!("<div class=\"wide\"><table><thead><tr>{heads}</tr></thead><tbody>\n{rows}</tbody></table></div>\n")
}

fn row(row: &Row) -> String {
    let cell = |cell: &Cell| match cell {
        Cell::Text(text) => format!("<td>{}</td>", escape(text)),
        Cell::Number(text) => format!("<td class=\"number\">{}</td>", escape(text)),
        Cell::Bar(share) => {
            let percent = if share.is_finite() { fixed(100.0 * share.clamp(0.0, 1.0), 1) } else { "0".to_owned() };
            format!("<td class=\"bar\"><span style=\"width:{percent}%\"></span></td>")
        }
    };
    let cells: String = row.cells.iter().map(cell).collect();
    format!("<tr{}>{cells}</tr>\n", if row.marked { " class=\"marked\"" } else { "" })
}

/// Makes a figure of a drawing, with its title above and its caption below.
#[must_use]
pub fn figure(title: &str, drawing: &Drawing, caption: &str) -> String {
    let (svg, title, caption) = (drawing.svg(title), escape(title), escape(caption));
    format!("<figure><h3>{title}</h3>\n{svg}\n<figcaption>{caption}</figcaption></figure>\n")
}

/// Makes a section; `body` is HTML.
#[must_use]
pub fn section(title: &str, body: &str) -> String {
    format!("<section><h2>{}</h2>\n{body}</section>\n", escape(title))
}

/// Makes a note, a paragraph in small print.
#[must_use]
pub fn note(text: &str) -> String {
    format!("<p class=\"note\">{}</p>\n", escape(text))
}

/// Places figures side by side where the page is wide enough; each is HTML.
#[must_use]
pub fn figures(figures: &[String]) -> String {
    format!("<section class=\"figures\">\n{}</section>\n", figures.concat())
}

/// Makes a figure of an image file, given as a data URL of a PNG or SVG, with its caption below.
#[must_use]
pub fn picture(title: &str, data: &str, caption: &str) -> String {
    let (title, data, caption) = (escape(title), escape(data), escape(caption));
    format!(
        "<figure><h3>{title}</h3>\n<img src=\"{data}\" alt=\"{title}\"/>\n<figcaption>{caption}</figcaption></figure>\n"
    )
}

/// Small drawings in rows, each with a line of text below.
#[must_use]
pub fn gallery(items: &[(String, Drawing)]) -> String {
    let item = |(text, drawing): &(String, Drawing)| {
        format!("<figure>{}\n<figcaption>{}</figcaption></figure>\n", drawing.svg(text), escape(text))
    };
    format!("<div class=\"gallery\">\n{}</div>\n", items.iter().map(item).collect::<String>())
}

/// Makes a panel of titled tables among figures; the bodies are HTML.
#[must_use]
pub fn panel(tables: &[(&str, String)]) -> String {
    let part = |(title, body): &(&str, String)| format!("<h3>{}</h3>\n{body}", escape(title));
    format!("<div class=\"panel\">{}</div>\n", tables.iter().map(part).collect::<String>())
}

/// Makes a cell of text.
#[must_use]
pub fn text(text: impl Into<String>) -> Cell {
    Cell::Text(text.into())
}

/// Makes a cell with a number of `digits` significant digits; a dash for `None`.
#[must_use]
pub fn number(value: Option<f64>, digits: i32) -> Cell {
    Cell::Number(value.map_or_else(|| "–".to_owned(), |value| significant(value, digits)))
}

/// Makes a cell with a whole number.
#[must_use]
pub fn count(value: usize) -> Cell {
    Cell::Number(value.to_string())
}

/// Makes a row without highlighting.
#[must_use]
pub const fn plain(cells: Vec<Cell>) -> Row {
    Row { cells, marked: false }
}

/// The parts of a page.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Page {
    /// Kind of the page, such as "Stage calibration".
    pub kind: &'static str,
    /// Title, such as the camera's name.
    pub title: String,
    /// Provenance as names with texts; empty texts are left out.
    pub origin: Vec<(&'static str, String)>,
    /// Body in HTML.
    pub body: String,
    /// Footer in HTML.
    pub footer: String,
}

/// Makes the whole page as an HTML document.
#[must_use]
pub fn page(page: &Page) -> String {
    let Page { kind, origin, body, footer, .. } = page;
    let title = escape(&page.title);
    let origin: String = origin
        .iter()
        .filter(|(_, text)| !text.is_empty())
        .map(|(name, text)| format!("<span><b>{name}</b> {}</span>\n", escape(text)))
        .collect();
    format!(
        "<!DOCTYPE html>\n<html lang=\"en\">\n<head>\n<meta charset=\"utf-8\"/>\n\
         <meta name=\"viewport\" content=\"width=device-width, initial-scale=1\"/>\n\
         <title>{title} – {kind}</title>\n<style>\n{STYLE}</style>\n</head>\n<body>\n<main>\n\
         <header><p class=\"kind\">{kind}</p><h1>{title}</h1><p class=\"origin\">{origin}</p></header>\n\
         {body}<footer>{footer}</footer>\n</main>\n</body>\n</html>\n"
    )
}
