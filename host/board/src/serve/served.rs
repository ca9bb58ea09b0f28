//! A simulated board that runs at the pace of the clock, and the handle by which several tasks share it.

use std::ops::{Deref, DerefMut};
use std::sync::{Arc, Mutex, MutexGuard};

use super::pace::Pace;

/// A simulated board. Time is an argument: an implementation needs no clock.
pub trait Served {
    /// Why the board cannot go on.
    type Error: std::error::Error + Send + Sync + 'static;

    /// Runs until `elapsed_us` microseconds after the simulation began. Calls never go back in time.
    fn run_until(&mut self, elapsed_us: u64);
    /// Takes note of the speed at which the host speaks and listens, in bits per second. A board on whose wire bytes take no
    /// time does nothing.
    fn hear_at(&mut self, baud: u32) {
        let _ = baud;
    }
    /// Takes bytes from the host, at the time to which the board was last run.
    fn receive(&mut self, bytes: &[u8]);
    /// Bytes that the board sent since the last call.
    fn take_output(&mut self) -> Vec<u8>;
    /// Called after each step: writes away what must outlive the simulator.
    ///
    /// # Errors
    /// Why the board cannot go on.
    fn settle(&mut self) -> Result<(), Self::Error>;
}

/// A simulated board and its clock, shared between the task that serves it and those who look at it. Clones share one board.
#[derive(Debug)]
pub struct Shared<B>(Arc<Mutex<Paced<B>>>);

#[derive(Debug)]
struct Paced<B> {
    board: B,
    pace: Pace,
}

impl<B> Clone for Shared<B> {
    fn clone(&self) -> Self {
        Self(Arc::clone(&self.0))
    }
}

impl<B> Shared<B> {
    /// Shares a board; its simulated time begins now.
    #[must_use]
    pub fn new(board: B) -> Self {
        Self(Arc::new(Mutex::new(Paced { board, pace: Pace::begin() })))
    }

    /// Locks the board. The guard must not be held across an await point.
    pub fn lock(&self) -> BoardGuard<'_, B> {
        // A poisoned lock only means that another thread panicked; the board is whole.
        BoardGuard(self.0.lock().unwrap_or_else(std::sync::PoisonError::into_inner))
    }
}

/// Exclusive access to a shared board.
#[derive(Debug)]
pub struct BoardGuard<'a, B>(MutexGuard<'a, Paced<B>>);

impl<B: Served> BoardGuard<'_, B> {
    /// Runs the board until now on tokio's clock. Simulated time follows the clock but never leaps: it falls behind when
    /// this was not called for longer than 20 ms.
    pub fn run_to_now(&mut self) {
        let elapsed_us = self.0.pace.elapsed_us();
        self.0.board.run_until(elapsed_us);
    }
}

impl<B> Deref for BoardGuard<'_, B> {
    type Target = B;

    fn deref(&self) -> &B {
        &self.0.board
    }
}

impl<B> DerefMut for BoardGuard<'_, B> {
    fn deref_mut(&mut self) -> &mut B {
        &mut self.0.board
    }
}
