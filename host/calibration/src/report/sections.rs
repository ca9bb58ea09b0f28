//! The parts that all reports have.

use vergence_page::escape;

use super::checks::{self, Check};

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
