//! Everything together: driving, measuring and showing until something ends.

use std::future::pending;

use vergence_board::Board;
use vergence_live::{Ended, Limits, LiveLoop, LiveResult, Totals};
use vergence_protocol::{Request, Trigger};

use crate::driver::Driver;
use crate::error::PanelError;
use crate::panel::Panel;

/// What a panel shows: a board, a live loop, both, or neither.
pub struct Session {
    /// What carries the orders of the pages out.
    pub driver: Driver,
    /// The board; `None` of a rig without axes.
    pub board: Option<Board>,
    /// What its camera trigger shall do once the axes have their reference; `None` where cameras run freely, or there are none.
    pub trigger: Option<Trigger>,
    /// What measures; `None` without cameras.
    pub live: Option<LiveLoop>,
}

impl Session {
    /// Drives and measures until the link ends, the cameras are dead, or `interruption` completes; then the stages brake, the board is
    /// disarmed, and its trigger is off.
    ///
    /// # Errors
    /// Those of the link and of the live loop.
    pub async fn run(self, panel: &Panel, interruption: impl Future<Output = ()>) -> Result<Ended, PanelError> {
        let Self { driver, mut board, trigger, live } = self;
        let driving = async {
            match &mut board {
                Some(board) => Err(driver.drive(board, trigger).await.into()),
                None => pending().await,
            }
        };
        let ended = tokio::select! {
            ended = measure(panel, live) => ended,
            error = driving => error,
            () = interruption => Ok(Ended::Done),
        };
        let settled = match &mut board {
            Some(board) => settle(board, trigger.is_some()).await,
            None => Ok(()),
        };
        // The first error names the cause.
        let ended = ended?;
        settled?;
        Ok(ended)
    }
}

async fn settle(board: &mut Board, fires: bool) -> Result<(), PanelError> {
    // A latched fault stays for whoever clears it; nothing moves, and the board cannot be disarmed.
    if board.pose().fault.is_none() {
        board.release().await?;
    }
    if fires {
        board.ask(Request::SetTrigger(Trigger::Off)).await?;
    }
    Ok(())
}

async fn measure(panel: &Panel, live: Option<LiveLoop>) -> Result<Ended, PanelError> {
    let Some(mut live) = live else { return pending().await };
    let show = |result: LiveResult<'_>| {
        panel.show(&result);
        Ok(())
    };
    let warn = |warning: String| panel.warn(&warning);
    match live.run(Limits::default(), &mut Totals::default(), show, warn).await {
        Ok(Ended::Done) => {
            panel.warn("the cameras have no more images: the last ones stay");
            pending().await
        }
        ended => ended,
    }
}
