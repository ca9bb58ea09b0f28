//! Where the loops of a pair run.

/// Does `work` on a thread of rayon's pool. A thread outside of it waits for each of the many loops of `work` and is woken after it, which costs as much as the shorter
/// ones of them.
pub(crate) fn in_pool<T: Send>(work: impl FnOnce() -> T + Send) -> T {
    rayon::scope(|_| work())
}
