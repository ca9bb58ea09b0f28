//! The files of the page, which are parts of this program.

use axum::http::header;
use axum::response::{IntoResponse, Response};

/// Address, kind and text of each file.
const FILES: &[(&str, &str, &str)] = &[
    ("/", "text/html; charset=utf-8", include_str!("../page/index.html")),
    ("/rigs.html", "text/html; charset=utf-8", include_str!("../page/rigs.html")),
    ("/rigs.css", "text/css; charset=utf-8", include_str!("../page/rigs.css")),
    ("/rigs.js", JAVASCRIPT, include_str!("../page/rigs.js")),
    ("/style.css", "text/css; charset=utf-8", include_str!("../page/style.css")),
    ("/main.js", JAVASCRIPT, include_str!("../page/main.js")),
    ("/link.js", JAVASCRIPT, include_str!("../page/link.js")),
    ("/colours.js", JAVASCRIPT, include_str!("../page/colours.js")),
    ("/control.js", JAVASCRIPT, include_str!("../page/control.js")),
    ("/axes.js", JAVASCRIPT, include_str!("../page/axes.js")),
    ("/health.js", JAVASCRIPT, include_str!("../page/health.js")),
    ("/pictures.js", JAVASCRIPT, include_str!("../page/pictures.js")),
    ("/cloud.js", JAVASCRIPT, include_str!("../page/cloud.js")),
    ("/gl.js", JAVASCRIPT, include_str!("../page/gl.js")),
    ("/point.js", JAVASCRIPT, include_str!("../page/point.js")),
    ("/sphere.js", JAVASCRIPT, include_str!("../page/sphere.js")),
    ("/top_view.js", JAVASCRIPT, include_str!("../page/top_view.js")),
    ("/plots.js", JAVASCRIPT, include_str!("../page/plots.js")),
    ("/capture.js", JAVASCRIPT, include_str!("../page/capture.js")),
    ("/playback.js", JAVASCRIPT, include_str!("../page/playback.js")),
    ("/plan.js", JAVASCRIPT, include_str!("../page/plan.js")),
    ("/log.js", JAVASCRIPT, include_str!("../page/log.js")),
];

const JAVASCRIPT: &str = "text/javascript; charset=utf-8";

/// Nothing comes from elsewhere, nothing goes elsewhere, and no other page frames this one.
const POLICY: &str = "default-src 'none'; script-src 'self'; style-src 'self'; img-src 'self' blob: data:; connect-src 'self'; \
                      base-uri 'none'; form-action 'none'; frame-ancestors 'none'";

/// Kind and text of the file at an address.
pub fn asset(path: &str) -> Option<(&'static str, &'static str)> {
    FILES.iter().find(|(address, ..)| *address == path).map(|(_, content_type, text)| (*content_type, *text))
}

/// A file as an answer. It is never kept: the program may be another one tomorrow.
pub fn secured(content_type: &'static str, text: &'static str) -> Response {
    let headers = [
        (header::CONTENT_TYPE, content_type),
        (header::CONTENT_SECURITY_POLICY, POLICY),
        (header::X_CONTENT_TYPE_OPTIONS, "nosniff"),
        (header::REFERRER_POLICY, "no-referrer"),
        (header::CACHE_CONTROL, "no-store"),
    ];
    (headers, text).into_response()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Every file that a file imports or names is there.
    #[test]
    fn the_page_needs_nothing_that_is_not_embedded() {
        for (address, _, text) in FILES {
            for foreign in ["http://", "https://", "//cdn", "import("] {
                let known = text.matches(foreign).count()
                    - text.matches("http://www.w3.org/").count() * usize::from(foreign == "http://");
                assert_eq!(known, 0, "{address} names {foreign}");
            }
            let named = text.split(['"', '\'']).filter(|part| part.starts_with("./") || part.starts_with('/'));
            for part in named.filter(|part| part.ends_with(".js") || part.ends_with(".css")) {
                assert!(asset(part.trim_start_matches('.')).is_some(), "{address} needs {part}");
            }
        }
    }
}
