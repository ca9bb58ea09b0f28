//! Listening to a board for long: from the board itself, or from the process that drives it; and what to do when the link ends.

use std::future::pending;
use std::path::Path;
use std::time::Duration;

use tokio::time::{sleep, timeout};
use vergence_rig::Rig;

use crate::board::Board;
use crate::link::{Follower, Port, ReaderMark, is_held, is_wanted};

/// Wait before the first attempt to reach a board again.
const FIRST_WAIT: Duration = Duration::from_millis(250);
/// Longest wait between two attempts.
const LONGEST_WAIT: Duration = Duration::from_secs(5);
/// Time between two looks at whether a driver wants the port.
const LOOK: Duration = Duration::from_millis(50);
/// Longest wait for a driver to take the port that was left to it.
const HANDOVER: Duration = Duration::from_secs(2);

/// Where a program that only reads gets the board's reports from.
pub enum Source<'a> {
    /// The board itself.
    Board(&'a mut Board),
    /// The process that drives the board, and the rig.
    Driver(&'a mut Follower, &'a Rig),
}

/// A board that is listened to.
pub struct Listening<'a, E> {
    /// Where the board can be reached.
    pub port: &'a Port,
    /// The rig.
    pub rig: &'a Rig,
    /// Tries to reach the board again when the link ends, instead of ending with it.
    pub persists: bool,
    /// Whether an error says that the link ended.
    pub is_end_of_link: fn(&E) -> bool,
}

impl<E> Listening<'_, E> {
    /// Has `listen` read the board's reports until it has read enough. Where another program drives the board, the reports come
    /// from that one; a driver that wants the port gets it. When the link ends, `listen` goes on with the board that came back.
    /// `connect` connects to the board; it is given the error with which the link ended before, if it did.
    ///
    /// # Errors
    /// Those of `listen` and of `connect`.
    pub async fn listen(
        &self,
        mut connect: impl AsyncFnMut(Option<E>) -> Result<Board, E>,
        mut listen: impl AsyncFnMut(Source<'_>) -> Result<(), E>,
    ) -> Result<(), E> {
        let (mut lost, mut was_connected) = (None, false);
        loop {
            if let Some(mut driver) = Follower::attach(self.port).await {
                was_connected = true;
                match listen(Source::Driver(&mut driver, self.rig)).await {
                    // The driver has ended: the port is free, or another one takes it.
                    Err(ended) if (self.is_end_of_link)(&ended) => sleep(LOOK).await,
                    outcome => return outcome,
                }
                continue;
            }
            let device = match self.port {
                Port::Serial(path) => Some(path.as_path()),
                _ => None,
            };
            // While this is held, drivers know that the port may be had.
            let _mark = device.and_then(ReaderMark::set);
            let mut board = match connect(lost.take()).await {
                Ok(board) => board,
                // A driver was quicker, or holds the port without passing anything on, as an update does.
                Err(_) if was_connected && device.is_some_and(is_held) => continue,
                Err(error) => return Err(error),
            };
            was_connected = true;
            tokio::select! {
                outcome = listen(Source::Board(&mut board)) => match outcome {
                    Err(ended) if self.persists && (self.is_end_of_link)(&ended) => lost = Some(ended),
                    outcome => return outcome,
                },
                () = wanted(device) => {
                    board.close().await;
                    leave_to_driver(self.port).await;
                }
            }
        }
    }
}

/// Completes when a driver wants the serial device `port`; never for other ports.
async fn wanted(port: Option<&Path>) {
    let Some(port) = port else { return pending().await };
    while !is_wanted(port) {
        sleep(LOOK).await;
    }
}

/// Waits until the driver that wants the port has it.
async fn leave_to_driver(port: &Port) {
    let waited = async {
        while Follower::attach(port).await.is_none() {
            sleep(LOOK).await;
        }
    };
    // A driver that gave up leaves the port to this reader again.
    let _ = timeout(HANDOVER, waited).await;
}

/// Tries to connect until the board is back, with twice the wait after each attempt. `report` is called with an error that
/// `may_pass` when it differs from the one before, of which `lost` is the first.
///
/// # Errors
/// An error of `connect` that does not pass by itself.
pub async fn reach_again<E: PartialEq>(
    lost: E,
    mut connect: impl AsyncFnMut() -> Result<Board, E>,
    may_pass: impl Fn(&E) -> bool,
    mut report: impl FnMut(&E),
) -> Result<Board, E> {
    let (mut wait, mut known) = (FIRST_WAIT, lost);
    loop {
        sleep(wait).await;
        wait = LONGEST_WAIT.min(2 * wait);
        match connect().await {
            Err(error) if may_pass(&error) => {
                if error != known {
                    report(&error);
                    known = error;
                }
            }
            outcome => return outcome,
        }
    }
}
