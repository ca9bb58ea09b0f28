//! Reports as self-contained HTML pages with tables and SVG drawings, without scripts or external files.
//!
//! Every function is pure: the same arguments give the same text.

mod data_url;
mod html;
mod plot;
mod svg;
mod text;

pub use data_url::data_url;
pub use html::{
    Cell, Page, Row, count, figure, figures, gallery, note, number, page, panel, picture, plain, section, table, text,
};
pub use plot::{Axes, round_step};
pub use svg::{Anchor, Drawing, Path};
pub use text::{counted, escape, fixed, significant, with_sigma};
