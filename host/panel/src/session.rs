//! Everything together: driving, measuring and showing until something ends.

use std::future::pending;

use vergence_board::{Board, BoardError};
use vergence_live::{Ended, Limits, LiveLoop, LiveResult, Notice, Totals};
use vergence_protocol::{Request, Trigger};
use vergence_recording::{Recorded, Recording};

use crate::driver::Driver;
use crate::error::PanelError;
use crate::panel::Panel;
use crate::without_link::without_link;

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
    /// What records the cameras, by [`Panel::tap`], and here pulses and clouds.
    pub recording: Option<Recording>,
}

/// What became of a session.
#[derive(Clone, Debug)]
pub struct Shown {
    /// Why it ended.
    pub ended: Ended,
    /// Results and what was skipped.
    pub totals: Totals,
    /// What was recorded.
    pub recorded: Option<Recorded>,
}

impl Session {
    /// Drives and measures until the cameras are dead, or `interruption` completes; then the stages brake, the board is disarmed, its trigger
    /// is off, and the recording is whole. When the link ends, `reach` tries to reach the board again and sets its trigger as before; nothing
    /// that was ordered before moves it then. Without `reach` the session ends with the link.
    ///
    /// # Errors
    /// Those of the board, of `reach`, of the live loop and of the recording.
    pub async fn run<E: From<PanelError>>(
        self,
        panel: &Panel,
        interruption: impl Future<Output = ()>,
        mut reach: Option<impl AsyncFnMut(BoardError) -> Result<Board, E>>,
    ) -> Result<Shown, E> {
        let Self { mut driver, mut board, trigger, live, recording } = self;
        let mut totals = Totals::default();
        let driving = async {
            let mut first = trigger;
            loop {
                let Some(driven) = &mut board else { return pending().await };
                let ended = driver.drive(driven, first.take()).await;
                let Some(reach) = reach.as_mut().filter(|_| matches!(ended, BoardError::Link(_))) else {
                    return Err(PanelError::from(ended).into());
                };
                // Its port is free only without it.
                board = None;
                board = Some(panel.watching(without_link(panel, &mut driver, reach(ended)).await?));
            }
        };
        let ended = tokio::select! {
            ended = measure(panel, live, recording.as_ref(), &mut totals) => ended.map_err(E::from),
            error = driving => error,
            () = interruption => Ok(Ended::Done),
        };
        let settled = match &mut board {
            Some(board) => settle(board, trigger.is_some()).await,
            None => Ok(()),
        };
        let recorded = match recording {
            Some(recording) => recording.finish().await.map(Some),
            None => Ok(None),
        };
        // The first error names the cause.
        let ended = ended?;
        settled?;
        Ok(Shown { ended, totals, recorded: recorded.map_err(PanelError::from)? })
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

async fn measure(
    panel: &Panel,
    live: Option<LiveLoop>,
    recording: Option<&Recording>,
    totals: &mut Totals,
) -> Result<Ended, PanelError> {
    let Some(live) = live else { return pending().await };
    let (mut live, mut recorded) = match recording {
        Some(recording) => (recording.marks_of(live), Some((&recording.recorder, recording.results()))),
        None => (live, None),
    };
    let show = |result: LiveResult<'_>| {
        panel.show(&result);
        if let Some((recorder, record)) = &mut recorded {
            record(&result);
            recorder.take_trouble().into_iter().for_each(|trouble| panel.warn(&trouble));
        }
        Ok(())
    };
    let warn = |notice: Notice| panel.notice(&notice);
    match live.run(Limits::default(), totals, show, warn).await {
        Ok(Ended::Done) => {
            panel.warn("the cameras have no more images: the last ones stay");
            pending().await
        }
        ended => ended,
    }
}
