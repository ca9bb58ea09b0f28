//! Where the loops of a pair run, and the memory that they use from pair to pair.

use std::sync::{Mutex, MutexGuard, PoisonError};

/// Does `work` on a thread of rayon's pool. A thread outside of it waits for each of the many loops of `work` and is woken after it, which costs as much as the shorter
/// ones of them.
pub(crate) fn in_pool<T: Send>(work: impl FnOnce() -> T + Send) -> T {
    rayon::scope(|_| work())
}

/// Most vectors of one kind that are kept.
const MOST_KEPT: usize = 24;

/// What large vectors hold.
pub(crate) trait Kept: Copy + Default + 'static {
    /// The vectors that are not in use.
    fn shelf() -> &'static Mutex<Vec<Vec<Self>>>;
}

macro_rules! kept {
    ($($kind:ty)*) => {$(
        impl Kept for $kind {
            fn shelf() -> &'static Mutex<Vec<Vec<Self>>> {
                static SHELF: Mutex<Vec<Vec<$kind>>> = Mutex::new(Vec::new());
                &SHELF
            }
        }
    )*};
}
kept!(f32 i32 u64 u8);

fn unused<T: Kept>() -> MutexGuard<'static, Vec<Vec<T>>> {
    // A poisoned lock only means that another thread panicked between whole vectors.
    T::shelf().lock().unwrap_or_else(PoisonError::into_inner)
}

/// A vector of `count` values, whatever they are: that of an earlier pair, where one has the size.
///
/// The system clears new memory page by page, which takes longer than many a loop over it; and what threads give back, each keeps for itself: a pair
/// would need its memory once for each thread.
pub(crate) fn memory<T: Kept>(count: usize) -> Vec<T> {
    let mut shelf = unused::<T>();
    let places = shelf.iter().enumerate().map(|(place, vector)| (vector.capacity(), place));
    let fitting = places.clone().filter(|(capacity, _)| (count..=2 * count).contains(capacity)).min();
    if let Some((_, place)) = fitting {
        let mut vector = shelf.remove(place);
        drop(shelf);
        vector.resize(count, T::default());
        return vector;
    }
    // Views have grown: that of their size before is not asked for any more.
    let outgrown = places.filter(|(capacity, _)| (count / 2..count).contains(capacity)).max();
    if let Some((_, place)) = outgrown {
        shelf.remove(place);
    }
    drop(shelf);
    vec![T::default(); count]
}

/// Keeps a vector for the next one who needs [`memory`].
pub(crate) fn give_back<T: Kept>(vector: Vec<T>) {
    let mut shelf = unused::<T>();
    shelf.push(vector);
    if shelf.len() > MOST_KEPT {
        // Views of other sizes came meanwhile: the first one has not been asked for for longest.
        shelf.remove(0);
    }
}
