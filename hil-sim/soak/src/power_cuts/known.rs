//! Starts whose outcome is known from an equal one.
//!
//! What a board does after power-on depends on its flash alone, and only on the pages that it reads, executes or
//! programs before it erases them. A start whose flash has the same contents in these pages as an earlier one need not
//! be made.

use std::sync::RwLock;

use super::sweep::Ending;

/// Outcomes of starts, with the digests of the pages that affected them.
#[derive(Default)]
pub struct KnownStarts(RwLock<Vec<Known>>);

struct Known {
    pages: Vec<(usize, u64)>,
    ending: Ending,
}

impl KnownStarts {
    /// The outcome of a start with these page digests, if an equal one was made.
    pub fn find(&self, digests: &[u64]) -> Option<Ending> {
        let starts = self.0.read().ok()?;
        let is_equal = |known: &&Known| known.pages.iter().all(|&(page, digest)| digests.get(page) == Some(&digest));
        starts.iter().find(is_equal).map(|known| known.ending.clone())
    }

    /// Records the outcome of a start, and the pages that affected it.
    pub fn remember(&self, pages: &[usize], digests: &[u64], ending: &Ending) {
        let pages = pages.iter().filter_map(|&page| Some((page, *digests.get(page)?))).collect();
        if let Ok(mut starts) = self.0.write() {
            starts.push(Known { pages, ending: ending.clone() });
        }
    }
}
