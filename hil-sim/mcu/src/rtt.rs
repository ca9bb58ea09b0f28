//! Logs that firmware leaves in RAM for a debugger, in the manner of SEGGER RTT (UM08001 §16.3).

use crate::memory::{RAM_BASE, RAM_SIZE};

/// The identifier at the beginning of a control block.
const MAGIC: &[u8; 16] = b"SEGGER RTT\0\0\0\0\0\0";
/// Bytes before the first description of a buffer, and of each.
const HEADER: usize = 24;
const DESCRIPTION: usize = 24;
/// Offsets in a description.
const BUFFER: usize = 4;
const SIZE: usize = 8;
const WRITE: usize = 12;
const READ: usize = 16;

/// The place of a buffer towards the host.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct RttBuffer {
    description: usize,
    start: usize,
    size: usize,
}

impl RttBuffer {
    /// Finds buffer `index` in RAM (128 KiB from `0x2000_0000`); `None` before the firmware has set it up.
    #[must_use]
    pub fn find(ram: &[u8], index: usize) -> Option<Self> {
        let block = find_magic(ram)?;
        let buffers = word(ram, block + 16)? as usize;
        let description = block + HEADER + index * DESCRIPTION;
        let start = (word(ram, description + BUFFER)?).checked_sub(RAM_BASE)? as usize;
        let size = word(ram, description + SIZE)? as usize;
        (index < buffers && size > 0 && start + size <= RAM_SIZE).then_some(Self { description, start, size })
    }
}

/// Takes the bytes that the firmware has written since the last call, and advances its read position.
pub fn read_rtt(ram: &mut [u8], buffer: RttBuffer) -> Vec<u8> {
    let offset = |field: usize| word(ram, buffer.description + field).unwrap_or(0) as usize % buffer.size;
    let (write, read) = (offset(WRITE), offset(READ));
    let length = (write + buffer.size - read) % buffer.size;
    let content = ram.get(buffer.start..buffer.start + buffer.size).unwrap_or_default();
    let bytes = content.iter().cycle().skip(read).take(length).copied().collect();
    let field = buffer.description + READ;
    if let Some(field) = ram.get_mut(field..field + 4) {
        field.copy_from_slice(&(write as u32).to_le_bytes());
    }
    bytes
}

fn find_magic(ram: &[u8]) -> Option<usize> {
    (0..ram.len().saturating_sub(HEADER)).step_by(4).find(|&at| ram.get(at..at + 16) == Some(MAGIC))
}

fn word(ram: &[u8], offset: usize) -> Option<u32> {
    Some(u32::from_le_bytes(ram.get(offset..offset + 4)?.try_into().ok()?))
}
