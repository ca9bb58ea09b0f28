//! The board's flight recorder as lines of the log.

use vergence_board::{Board, BoardError, event_in_words};
use vergence_protocol::Happening;

use crate::hub::Hub;
use crate::log::Level;

/// Adds what the recorder has kept since event `next`, and moves `next` on. A board without a recorder has nothing to tell.
pub async fn read_recorder(hub: &Hub, board: &Board, next: &mut u32) -> Result<(), BoardError> {
    let recorded = match board.events_from(*next).await {
        Ok(recorded) => recorded,
        Err(BoardError::Refused { .. }) => return Ok(()),
        Err(error) => return Err(error),
    };
    *next = recorded.next;
    for event in &recorded.events {
        let level = match event.what {
            Happening::Fault { .. } => Level::Error,
            Happening::Refused(_) => Level::Warning,
            _ => Level::Note,
        };
        hub.note_at("board", event.at.0 as f64 * 1e-6, level, &event_in_words(board.rig(), &event.what));
    }
    Ok(())
}
