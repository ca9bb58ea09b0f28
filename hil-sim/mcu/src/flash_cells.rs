//! The cells of flash, intact or torn: what persists without power.

use std::collections::BTreeSet;
use std::hash::{DefaultHasher, Hash, Hasher};
use std::sync::Arc;

use crate::flash::{FlashOperation, PAGE};
use crate::memory::FLASH_SIZE;
use crate::power_cut::{Damage, tear};

/// The contents of flash, and which double words ECC finds bad.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct FlashCells {
    bytes: Arc<Vec<u8>>,
    torn: BTreeSet<u32>,
}

impl FlashCells {
    pub(crate) fn new(bytes: &[u8], torn: &BTreeSet<u32>) -> Self {
        Self { bytes: Arc::new(bytes.to_vec()), torn: torn.clone() }
    }

    /// The contents, 512 KiB.
    #[must_use]
    pub fn bytes(&self) -> &[u8] {
        &self.bytes
    }

    /// Double words that ECC cannot correct, by index.
    #[must_use]
    pub fn torn(&self) -> &BTreeSet<u32> {
        &self.torn
    }

    /// A digest of each page: its contents, and which of its double words are torn.
    #[must_use]
    pub fn page_digests(&self) -> Vec<u64> {
        let digest = |(page, bytes): (usize, &[u8])| {
            let first = (page * PAGE / 8) as u32;
            let mut hasher = DefaultHasher::new();
            bytes.hash(&mut hasher);
            self.torn.range(first..first + (PAGE / 8) as u32).for_each(|word| word.hash(&mut hasher));
            hasher.finish()
        };
        self.bytes.chunks(PAGE).enumerate().map(digest).collect()
    }

    /// Writes bytes as a debugger does. Returns whether they fit.
    pub fn load(&mut self, offset: usize, bytes: &[u8]) -> bool {
        let Some(place) = Arc::make_mut(&mut self.bytes).get_mut(offset..offset.saturating_add(bytes.len())) else {
            return false;
        };
        place.copy_from_slice(bytes);
        let words = (offset / 8) as u32..(offset + bytes.len()).div_ceil(8) as u32;
        self.torn.retain(|word| !words.contains(word));
        true
    }

    /// Applies an operation, or the part of it that a power cut leaves.
    pub fn operate(&mut self, operation: FlashOperation, damage: Damage) {
        leave(operation, damage, Arc::make_mut(&mut self.bytes).as_mut_slice(), &mut self.torn);
    }
}

impl Default for FlashCells {
    /// Erased cells.
    fn default() -> Self {
        Self { bytes: Arc::new(vec![0xFF; FLASH_SIZE]), torn: BTreeSet::new() }
    }
}

/// The part of an operation that took place.
pub(crate) fn leave(operation: FlashOperation, damage: Damage, cells: &mut [u8], torn: &mut BTreeSet<u32>) {
    let range = operation.range();
    let words = range.start as u32 / 8..range.end as u32 / 8;
    let Some(place) = cells.get_mut(range) else { return };
    match damage {
        Damage::None => {}
        Damage::Complete => {
            match operation {
                FlashOperation::Program { value, .. } => place.copy_from_slice(&value.to_le_bytes()),
                _ => place.fill(0xFF),
            }
            words.for_each(|word| {
                torn.remove(&word);
            });
        }
        Damage::Torn { seed } => tear(operation, place, words, torn, seed),
    }
}
