//! What verbs that run for long do when the link ends: they try again, and never go on with a motion.

use std::time::Duration;

use indicatif::ProgressBar;
use tokio::time::{sleep, timeout};

use super::connect::connect_with;
use crate::board::{Board, describe_pose};
use crate::cli::Globals;
use crate::console::Console;
use crate::failure::{Failure, FailureKind};
use crate::interrupt::interrupted;

const FIRST_WAIT: Duration = Duration::from_millis(250);
const LONGEST_WAIT: Duration = Duration::from_secs(5);

/// What to do when the link ends.
#[derive(Clone, Copy, Debug, clap::Args)]
pub struct Persistence {
    /// End when the link ends, instead of trying to reach the board again.
    #[arg(long)]
    no_reconnect: bool,
}

impl Persistence {
    /// Whether to try again after `failure`.
    pub fn survives(self, failure: &Failure) -> bool {
        !self.no_reconnect && failure.kind() == FailureKind::Link
    }
}

/// How long a verb listens to the board, and what it does when the link ends.
#[derive(Clone, Copy, Debug, clap::Args)]
pub struct Listening {
    /// Stop after this time.
    #[arg(long = "for", value_name = "TIME", value_parser = humantime::parse_duration)]
    duration: Option<Duration>,
    #[command(flatten)]
    persistence: Persistence,
}

impl Listening {
    /// Has `listen` listen to `board`, and again to the one that came back, until it has heard enough, the time is over or
    /// Ctrl-C is pressed.
    ///
    /// # Errors
    /// Those of `listen`, and of [`reconnect`].
    pub async fn to(
        self,
        board: Board,
        globals: &Globals,
        console: Console,
        listen: impl AsyncFnMut(&mut Board) -> Result<(), Failure>,
    ) -> Result<(), Failure> {
        let forever = Duration::from_secs(u64::from(u32::MAX));
        let listening = self.persistently(board, globals, console, listen);
        tokio::select! {
            outcome = timeout(self.duration.unwrap_or(forever), listening) => outcome.unwrap_or(Ok(())),
            () = interrupted() => Ok(()),
        }
    }

    async fn persistently(
        self,
        mut board: Board,
        globals: &Globals,
        console: Console,
        mut listen: impl AsyncFnMut(&mut Board) -> Result<(), Failure>,
    ) -> Result<(), Failure> {
        loop {
            match listen(&mut board).await {
                Err(lost) if self.persistence.survives(&lost) => {
                    // The port is free for the next attempt only once this session has let go of it.
                    drop(board);
                    board = reconnect(globals, console, lost).await?;
                }
                outcome => return outcome,
            }
        }
    }
}

/// Tries until the board is back, with twice the wait after each attempt, and says so.
///
/// # Errors
/// A board that came back with another protocol or rig.
pub async fn reconnect(globals: &Globals, console: Console, lost: Failure) -> Result<Board, Failure> {
    let mut wait = FIRST_WAIT;
    let mut told = lost;
    console.warn(format!("{told}\ntrying to reach it again; Ctrl-C ends this"));
    loop {
        sleep(wait).await;
        wait = LONGEST_WAIT.min(2 * wait);
        match connect_with(globals, ProgressBar::hidden()).await {
            Ok(board) => {
                console.warn(format!("connected again: {}", describe_pose(board.rig(), board.pose())));
                return Ok(board);
            }
            Err(failure) if matches!(failure.kind(), FailureKind::Device | FailureKind::Link) => {
                if failure != told {
                    console.warn(&failure);
                    told = failure;
                }
            }
            Err(failure) => return Err(failure),
        }
    }
}
