//! Pages for people: one self-contained HTML file with tables and drawings (SVG), that runs no script and loads nothing.
//!
//! Pure: text in, text out. The same arguments give the same bytes.

mod data_url;
mod html;
mod plot;
mod svg;

pub use data_url::data_url;
pub use html::{
    Cell, Page, Row, count, counted, escape, figure, figures, fixed, note, number, page, panel, picture, plain,
    section, significant, table, text, with_sigma,
};
pub use plot::{Axes, round_step};
pub use svg::{Anchor, Drawing, Path};
