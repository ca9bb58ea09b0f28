//! What an application says of itself in notes among its bytes (ELF notes: sizes of name and content, type, name,
//! content; each part fills whole words).

/// The linker's build id: 20 bytes of type 3, owner "GNU".
const BUILD: [u8; 16] = [4, 0, 0, 0, 20, 0, 0, 0, 3, 0, 0, 0, b'G', b'N', b'U', 0];
/// The version: 4 bytes of type 1, owner "VGC".
const VERSION: [u8; 16] = [4, 0, 0, 0, 4, 0, 0, 0, 1, 0, 0, 0, b'V', b'G', b'C', 0];

/// A note that names a version, as an application puts it into flash.
#[repr(C, align(4))]
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct VersionNote {
    head: [u8; 16],
    /// Major, minor, patch.
    pub version: [u8; 3],
    padding: u8,
}

impl VersionNote {
    /// The note of a version.
    #[must_use]
    pub const fn new(version: [u8; 3]) -> Self {
        Self { head: VERSION, version, padding: 0 }
    }
}

/// The version that an application names.
#[must_use]
pub fn version_of(image: &[u8]) -> Option<[u8; 3]> {
    image.get(content(image, &VERSION)?..)?.first_chunk().copied()
}

/// Where an application keeps its build: the first eight bytes of the linker's build id, most significant first.
#[must_use]
pub fn build_at(image: &[u8]) -> Option<usize> {
    content(image, &BUILD).filter(|&at| image.len() >= at + 8)
}

/// The build that an application names.
#[must_use]
pub fn build_of(image: &[u8]) -> Option<u64> {
    image.get(build_at(image)?..)?.first_chunk().copied().map(u64::from_be_bytes)
}

fn content(image: &[u8], head: &[u8; 16]) -> Option<usize> {
    let (words, _) = image.as_chunks::<4>();
    let at = words.windows(4).position(|window| window.as_flattened() == head)?;
    Some(4 * at + head.len())
}
