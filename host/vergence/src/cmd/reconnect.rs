//! What verbs that run for long do when the link ends: they try again, and never go on with a motion.

use std::time::Duration;

use indicatif::ProgressBar;
use tokio::time::timeout;
use vergence_board::{Board, Source, describe_pose, reach_again};

use super::connect::{connect_quietly, connect_with, port};
use crate::cli::CommonOptions;
use crate::console::Console;
use crate::failure::{Failure, FailureKind};
use crate::interrupt::interrupted;
use crate::rig_file;

/// Behaviour when the link ends.
#[derive(Clone, Copy, Debug, clap::Args)]
pub struct Persistence {
    /// Ends when the link ends, instead of trying to reach the board again.
    #[arg(long)]
    no_reconnect: bool,
}

impl Persistence {
    /// Whether to try again when the link ends.
    pub const fn persists(self) -> bool {
        !self.no_reconnect
    }

    /// Whether to try again after `failure`.
    pub fn survives(self, failure: &Failure) -> bool {
        self.persists() && failure.kind() == FailureKind::Link
    }
}

/// How long a verb listens to the board, and what it does when the link ends.
#[derive(Clone, Copy, Debug, clap::Args)]
pub struct Listening {
    /// Stops after this time.
    #[arg(long = "for", value_name = "TIME", value_parser = humantime::parse_duration)]
    duration: Option<Duration>,
    #[command(flatten)]
    persistence: Persistence,
}

impl Listening {
    /// Has `listen` read the board's reports until it has read enough, the time is over or Ctrl-C is pressed. Where another
    /// vergence drives the board, the reports come from that one; a driver that wants the port gets it. When the link ends,
    /// `listen` goes on with the board that came back.
    ///
    /// # Errors
    /// Those of `listen`, of connecting, and of [`reconnect`].
    pub async fn to(
        self,
        common: &CommonOptions,
        console: Console,
        listen: impl AsyncFnMut(Source<'_>) -> Result<(), Failure>,
    ) -> Result<(), Failure> {
        let forever = Duration::from_secs(u64::from(u32::MAX));
        let listening = self.persistently(common, console, listen);
        tokio::select! {
            outcome = timeout(self.duration.unwrap_or(forever), listening) => outcome.unwrap_or(Ok(())),
            () = interrupted() => Ok(()),
        }
    }

    async fn persistently(
        self,
        common: &CommonOptions,
        console: Console,
        listen: impl AsyncFnMut(Source<'_>) -> Result<(), Failure>,
    ) -> Result<(), Failure> {
        let rig = rig_file::load(common.rig.as_deref())?;
        let listening = vergence_board::Listening {
            port: &port(common)?,
            rig: &rig,
            persists: self.persistence.persists(),
            is_end_of_link: |failure: &Failure| failure.kind() == FailureKind::Link,
        };
        let connect = async |lost| match lost {
            Some(lost) => reconnect(common, console, lost).await,
            None => connect_quietly(common, console).await,
        };
        listening.listen(connect, listen).await
    }
}

/// Tries until the board is back, and says so.
///
/// # Errors
/// A board that came back with another protocol or rig.
pub async fn reconnect(common: &CommonOptions, console: Console, lost: Failure) -> Result<Board, Failure> {
    reconnect_by(async || connect_with(common, ProgressBar::hidden()).await, console, lost).await
}

/// As [`reconnect`], where `connect` connects.
///
/// # Errors
/// As there.
pub async fn reconnect_by(
    connect: impl AsyncFnMut() -> Result<Board, Failure>,
    console: Console,
    lost: Failure,
) -> Result<Board, Failure> {
    console.warn(format!("{lost}\ntrying to reach it again; Ctrl-C ends this"));
    let may_pass = |failure: &Failure| matches!(failure.kind(), FailureKind::Device | FailureKind::Link);
    let board = reach_again(lost, connect, may_pass, |failure| console.warn(failure)).await?;
    console.warn(format!("connected again: {}", describe_pose(board.rig(), board.pose())));
    Ok(board)
}
