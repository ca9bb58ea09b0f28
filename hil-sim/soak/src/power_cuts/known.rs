//! Starts that are known from equal ones.
//!
//! What a board does after power-on is decided by its flash alone: the same simulation with the same flash goes the same
//! way. And of the flash only those pages decide that it read, executed or programmed before it erased them. So a start
//! whose flash has the same contents in these pages as an earlier one need not be made.

use std::sync::RwLock;

use super::sweep::Ending;

/// Starts, and the digests of the pages that decided.
#[derive(Default)]
pub struct KnownStarts(RwLock<Vec<Known>>);

struct Known {
    pages: Vec<(usize, u64)>,
    ending: Ending,
}

impl KnownStarts {
    /// How a start with these page digests ends, if an equal one was made.
    pub fn find(&self, digests: &[u64]) -> Option<Ending> {
        let starts = self.0.read().ok()?;
        let is_equal = |known: &&Known| known.pages.iter().all(|&(page, digest)| digests.get(page) == Some(&digest));
        starts.iter().find(is_equal).map(|known| known.ending.clone())
    }

    /// Remembers how a start ended, and the pages that decided.
    pub fn remember(&self, pages: &[usize], digests: &[u64], ending: &Ending) {
        let pages = pages.iter().filter_map(|&page| Some((page, *digests.get(page)?))).collect();
        if let Ok(mut starts) = self.0.write() {
            starts.push(Known { pages, ending: ending.clone() });
        }
    }
}
