//! HTML that is well-formed XML too: text is escaped here and nowhere else.

use crate::svg::Drawing;

const STYLE: &str = include_str!("style.css");

/// Text of a page: `text` with the characters that mean something in XML replaced, and those that XML forbids too.
#[must_use]
pub fn escape(text: &str) -> String {
    let mut escaped = String::with_capacity(text.len());
    for character in text.chars() {
        match character {
            '&' => escaped.push_str("&amp;"),
            '<' => escaped.push_str("&lt;"),
            '>' => escaped.push_str("&gt;"),
            '"' => escaped.push_str("&quot;"),
            '\'' => escaped.push_str("&#39;"),
            '\u{fffe}' | '\u{ffff}' => escaped.push('\u{fffd}'),
            c if c.is_control() && !matches!(c, '\n' | '\t') => escaped.push('\u{fffd}'),
            c => escaped.push(c),
        }
    }
    escaped
}

/// `value` with so many significant digits, or a dash where it is not a number.
#[must_use]
pub fn significant(value: f64, digits: i32) -> String {
    if !value.is_finite() {
        return "–".to_owned();
    }
    if value == 0.0 {
        return "0".to_owned();
    }
    fixed(value, digits - 1 - value.abs().log10().floor() as i32)
}

/// `value` with so many decimals; none where they are negative.
#[must_use]
pub fn fixed(value: f64, decimals: i32) -> String {
    const MOST_DECIMALS: i32 = 9;
    if !value.is_finite() {
        return "–".to_owned();
    }
    let text = format!("{value:.*}", decimals.clamp(0, MOST_DECIMALS) as usize);
    // The typographic minus is as wide as the other digits.
    match text.strip_prefix('-') {
        Some(zero) if zero.chars().all(|c| matches!(c, '0' | '.')) => zero.to_owned(),
        Some(rest) => format!("−{rest}"),
        None => text,
    }
}

/// A value and its standard deviation, both to the deviation's second digit.
#[must_use]
pub fn with_sigma(value: f64, sigma: f64) -> [String; 2] {
    if !sigma.is_finite() || sigma <= 0.0 {
        return [significant(value, 6), "–".to_owned()];
    }
    let decimals = 1 - sigma.log10().floor() as i32;
    [fixed(value, decimals), fixed(sigma, decimals)]
}

/// "1 view", "2 views".
#[must_use]
pub fn counted(count: usize, noun: &str) -> String {
    format!("{count} {noun}{}", if count == 1 { "" } else { "s" })
}

/// What a cell of a table shows.
#[derive(Clone, Debug, PartialEq)]
pub enum Cell {
    /// Left-aligned.
    Text(String),
    /// Right-aligned.
    Number(String),
    /// A bar of this share of the full width.
    Bar(f64),
}

/// A row of a table.
#[derive(Clone, Debug, PartialEq)]
pub struct Row {
    /// One for each column.
    pub cells: Vec<Cell>,
    /// Whether it should catch the eye.
    pub marked: bool,
}

/// A table; the heads of columns of numbers are aligned like their first row.
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

/// A figure with its title above and what it means below.
#[must_use]
pub fn figure(title: &str, drawing: &Drawing, caption: &str) -> String {
    let (svg, title, caption) = (drawing.svg(title), escape(title), escape(caption));
    format!("<figure><h3>{title}</h3>\n{svg}\n<figcaption>{caption}</figcaption></figure>\n")
}

/// A section; `body` is HTML.
#[must_use]
pub fn section(title: &str, body: &str) -> String {
    format!("<section><h2>{}</h2>\n{body}</section>\n", escape(title))
}

/// A paragraph of small print.
#[must_use]
pub fn note(text: &str) -> String {
    format!("<p class=\"note\">{}</p>\n", escape(text))
}

/// Figures, side by side where the page is wide enough; each is HTML.
#[must_use]
pub fn figures(figures: &[String]) -> String {
    format!("<section class=\"figures\">\n{}</section>\n", figures.concat())
}

/// A figure that is a picture: `data` is a PNG or an SVG of its own, already as a data URL; what it means stands below.
#[must_use]
pub fn picture(title: &str, data: &str, caption: &str) -> String {
    let (title, data, caption) = (escape(title), escape(data), escape(caption));
    format!(
        "<figure><h3>{title}</h3>\n<img src=\"{data}\" alt=\"{title}\"/>\n<figcaption>{caption}</figcaption></figure>\n"
    )
}

/// Tables among figures: titles, and bodies in HTML.
#[must_use]
pub fn panel(tables: &[(&str, String)]) -> String {
    let part = |(title, body): &(&str, String)| format!("<h3>{}</h3>\n{body}", escape(title));
    format!("<div class=\"panel\">{}</div>\n", tables.iter().map(part).collect::<String>())
}

/// A cell of text.
#[must_use]
pub fn text(text: impl Into<String>) -> Cell {
    Cell::Text(text.into())
}

/// A cell with a number of so many significant digits; a dash where there is none.
#[must_use]
pub fn number(value: Option<f64>, digits: i32) -> Cell {
    Cell::Number(value.map_or_else(|| "–".to_owned(), |value| significant(value, digits)))
}

/// A cell with a whole number.
#[must_use]
pub fn count(value: usize) -> Cell {
    Cell::Number(value.to_string())
}

/// A row that does not catch the eye.
#[must_use]
pub const fn plain(cells: Vec<Cell>) -> Row {
    Row { cells, marked: false }
}

/// What stands around the body of a page.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Page {
    /// What the page is, such as "Stage calibration".
    pub kind: &'static str,
    /// Such as the camera's name.
    pub title: String,
    /// Where it comes from: names and texts; empty ones are left out.
    pub origin: Vec<(&'static str, String)>,
    /// HTML.
    pub body: String,
    /// HTML.
    pub footer: String,
}

/// The whole page.
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
