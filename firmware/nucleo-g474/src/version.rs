//! Version of this program, oldest version that may replace it, and build id, in notes in flash: the tool that signs the
//! image and the boot loader's recovery read them as well.

use vergence_image::notes::VersionNote;

#[allow(unsafe_code, reason = "a note that only the linker knows")]
unsafe extern "C" {
    /// The ELF note with the build id: sizes of name and id, type, name "GNU", id.
    static __build_id: [u32; 6];
}

/// The note with the version.
#[allow(unsafe_code, reason = "a place that build-id.x keeps")]
// SAFETY: the section holds nothing else.
#[unsafe(link_section = ".note.vergence")]
#[used]
static NOTE: VersionNote = VersionNote::new([
    part(env!("CARGO_PKG_VERSION_MAJOR")),
    part(env!("CARGO_PKG_VERSION_MINOR")),
    part(env!("CARGO_PKG_VERSION_PATCH")),
]);

/// The note with the oldest version that may replace this one.
#[allow(unsafe_code, reason = "a place that build-id.x keeps")]
// SAFETY: the section holds nothing else but the note with the version.
#[unsafe(link_section = ".note.vergence")]
#[used]
static OLDEST: VersionNote = VersionNote::oldest([0, 1, 0]);

/// Version of the package, from the note in flash: major, minor, patch.
pub fn version() -> [u8; 3] {
    core::hint::black_box(&NOTE).version
}

/// Oldest version that may replace this one, from the note in flash: major, minor, patch.
pub fn oldest() -> [u8; 3] {
    core::hint::black_box(&OLDEST).version
}

/// The first eight bytes of the build id.
#[allow(unsafe_code, reason = "a note that only the linker knows")]
pub fn build_id() -> u64 {
    // SAFETY: build-id.x puts the note there, aligned to words, and nothing writes flash at this place.
    let note = unsafe { &__build_id };
    // Most significant byte first: the first hexadecimal digits that tools show.
    u64::from(note[4].swap_bytes()) << 32 | u64::from(note[5].swap_bytes())
}

const fn part(digits: &str) -> u8 {
    let (mut value, mut rest) = (0, digits.as_bytes());
    while let [digit, after @ ..] = rest {
        value = value * 10 + (*digit - b'0');
        rest = after;
    }
    value
}
