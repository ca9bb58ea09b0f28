//! Which version this is: one note in flash, for this program and for who signs its image.

use vergence_image::notes::VersionNote;

#[allow(unsafe_code, reason = "a place that build-id.x keeps")]
// SAFETY: the section holds nothing else.
#[unsafe(link_section = ".note.vergence")]
#[used]
static NOTE: VersionNote = VersionNote::new([
    part(env!("CARGO_PKG_VERSION_MAJOR")),
    part(env!("CARGO_PKG_VERSION_MINOR")),
    part(env!("CARGO_PKG_VERSION_PATCH")),
]);

/// The package's version, as it stands in flash.
pub fn version() -> [u8; 3] {
    core::hint::black_box(&NOTE).version
}

const fn part(digits: &str) -> u8 {
    let (mut value, mut rest) = (0, digits.as_bytes());
    while let [digit, after @ ..] = rest {
        value = value * 10 + (*digit - b'0');
        rest = after;
    }
    value
}
