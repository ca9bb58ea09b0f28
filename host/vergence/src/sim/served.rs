//! What a simulated board does for those who drive and watch it.

use std::sync::{Arc, Mutex, MutexGuard};

use crate::failure::Failure;

/// A board that runs at the pace of the clock, at the end of a wire.
pub trait Served {
    /// Runs until now. What the board sends meanwhile is kept until [`Self::take_output`].
    fn run_to_now(&mut self);
    /// Gives bytes of the host to the board, now.
    fn receive(&mut self, bytes: &[u8]);
    /// What the board sent since this was last asked.
    fn take_output(&mut self) -> Vec<u8>;
    /// Keeps what must outlive the simulator.
    ///
    /// # Errors
    /// Why the board cannot go on.
    fn settle(&mut self) -> Result<(), Failure>;
}

/// A board that several look at.
#[derive(Debug)]
pub struct Shared<B>(Arc<Mutex<B>>);

impl<B> Clone for Shared<B> {
    fn clone(&self) -> Self {
        Self(Arc::clone(&self.0))
    }
}

impl<B> Shared<B> {
    /// Shares a board.
    #[must_use]
    pub fn new(board: B) -> Self {
        Self(Arc::new(Mutex::new(board)))
    }

    /// The board, for a moment. Nothing waits while it is held.
    pub fn lock(&self) -> MutexGuard<'_, B> {
        // A poisoned lock only means that another thread panicked; the board is whole.
        self.0.lock().unwrap_or_else(std::sync::PoisonError::into_inner)
    }
}
