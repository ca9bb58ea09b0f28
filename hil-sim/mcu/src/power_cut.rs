//! A power cut during a flash operation, and what it leaves in the cells.

use std::collections::BTreeSet;
use std::ops::Range;

use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64Mcg;

use crate::flash::FlashOperation;

/// A power cut at a flash operation.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct PowerCut {
    /// Number of the operation, counted from one since the board was created.
    pub operation: u64,
    /// Damage that the cut leaves.
    pub damage: Damage,
}

/// Damage that a power cut leaves in the operation in progress.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Damage {
    /// Nothing has been changed yet.
    None,
    /// The cells are complete, but the firmware does not learn of it.
    Complete,
    /// A half-written double word that ECC finds bad, or a page of which some is erased, some is not, and some is bad.
    Torn {
        /// Seed that decides the bits.
        seed: u64,
    },
}

/// Applies a part of an operation to its cells. Programming only clears bits, erasing only sets them.
pub(crate) fn tear(
    operation: FlashOperation,
    cells: &mut [u8],
    words: Range<u32>,
    torn: &mut BTreeSet<u32>,
    seed: u64,
) {
    let mut random = Pcg64Mcg::seed_from_u64(seed);
    let (doubles, _) = cells.as_chunks_mut::<8>();
    for (double, word) in doubles.iter_mut().zip(words) {
        let before = u64::from_le_bytes(*double);
        let noise: u64 = random.random();
        let after = match operation {
            FlashOperation::Program { value, .. } => before & (value | noise),
            _ => match random.random_range(0..3) {
                0 => before,
                1 => u64::MAX,
                _ => before | noise,
            },
        };
        *double = after.to_le_bytes();
        match operation {
            // Even where all bits are right, the check bits of a cut word are not.
            FlashOperation::Program { .. } => torn.insert(word),
            _ if after == u64::MAX => torn.remove(&word),
            _ if after == before => false,
            _ => torn.insert(word),
        };
    }
}
