//! Version, oldest version accepted and build id of an application, in notes among its bytes (ELF notes: sizes of name and content, type, name,
//! content; each part fills whole words).

/// Head of the linker's note with the build id: 20 bytes of type 3, owner "GNU".
const BUILD: [u8; 16] = [4, 0, 0, 0, 20, 0, 0, 0, 3, 0, 0, 0, b'G', b'N', b'U', 0];
/// Head of the note with the version: 4 bytes of type 1, owner "VGC".
const VERSION: [u8; 16] = [4, 0, 0, 0, 4, 0, 0, 0, 1, 0, 0, 0, b'V', b'G', b'C', 0];

/// Head of the note with the oldest version accepted: 4 bytes of type 2, owner "VGC".
const OLDEST: [u8; 16] = [4, 0, 0, 0, 4, 0, 0, 0, 2, 0, 0, 0, b'V', b'G', b'C', 0];

/// The note with the version, as an application has it in flash.
#[repr(C, align(4))]
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct VersionNote {
    head: [u8; 16],
    /// Major, minor, patch.
    pub version: [u8; 3],
    padding: u8,
}

impl VersionNote {
    /// The note of this version: major, minor, patch.
    #[must_use]
    pub const fn new(version: [u8; 3]) -> Self {
        Self { head: VERSION, version, padding: 0 }
    }

    /// The note of the oldest version that may replace this application: major, minor, patch.
    #[must_use]
    pub const fn oldest(version: [u8; 3]) -> Self {
        Self { head: OLDEST, version, padding: 0 }
    }
}

/// Version of an application (major, minor, patch); `None` if it has no such note.
#[must_use]
pub fn version_of(image: &[u8]) -> Option<[u8; 3]> {
    image.get(content(image, &VERSION)?..)?.first_chunk().copied()
}

/// Oldest version that may replace an application (major, minor, patch); `None` if it has no such note.
#[must_use]
pub fn oldest_of(image: &[u8]) -> Option<[u8; 3]> {
    image.get(content(image, &OLDEST)?..)?.first_chunk().copied()
}

/// Offset of an application's build id: the first eight bytes of the linker's build id, most significant first. `None` if
/// it has no such note.
#[must_use]
pub fn build_at(image: &[u8]) -> Option<usize> {
    content(image, &BUILD).filter(|&at| image.len() >= at + 8)
}

/// Build id of an application; `None` if it has no such note.
#[must_use]
pub fn build_of(image: &[u8]) -> Option<u64> {
    image.get(build_at(image)?..)?.first_chunk().copied().map(u64::from_be_bytes)
}

fn content(image: &[u8], head: &[u8; 16]) -> Option<usize> {
    let (words, _) = image.as_chunks::<4>();
    let at = words.windows(4).position(|window| window.as_flattened() == head)?;
    Some(4 * at + head.len())
}
