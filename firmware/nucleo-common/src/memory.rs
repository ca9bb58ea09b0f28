//! Memory that outlives the program: RAM kept through resets, and flash read as memory.

use vergence_image::layout::{self, Region};
use vergence_image::{SURVIVOR_WORDS, Survivor};

/// Reads the memory kept through resets.
#[allow(unsafe_code, reason = "RAM outside the program's own")]
pub fn survivor() -> Survivor {
    let memory = layout::SURVIVOR.start as *const [u32; SURVIVOR_WORDS];
    // SAFETY: memory.x keeps this RAM free of variables and stack, any bits are valid words, and writers do not overlap
    // with readers: they run at start-up, in one task, or never return.
    Survivor::from_words(&unsafe { memory.read_volatile() })
}

/// Writes the memory kept through resets.
#[allow(unsafe_code, reason = "RAM outside the program's own")]
pub fn remember(survivor: &Survivor) {
    let memory = layout::SURVIVOR.start as *mut [u32; SURVIVOR_WORDS];
    // SAFETY: as in `survivor`.
    unsafe { memory.write_volatile(survivor.to_words()) };
}

/// The bytes of a flash region. Do not hold them while the region is written.
#[allow(unsafe_code, reason = "flash as memory")]
pub fn region(region: Region) -> &'static [u8] {
    let start = (layout::FLASH_BASE + region.start) as *const u8;
    // SAFETY: the layout lies inside the flash, which is readable; all users are done with it before they write.
    unsafe { core::slice::from_raw_parts(start, region.length as usize) }
}
