//! Another speed of the serial line: the board puts it on trial, the host opens the line at it, and both go back where
//! that fails.

use std::time::Duration;

use tokio::time::{Instant, sleep};
use vergence_protocol::{Refusal, Report, Request, SettingItem, SettingKey, Status};

use crate::board::Board;
use crate::error::BoardError;
use crate::link::{Client, Continuity, LinkError, OpenError, Port, fresh_session, open};

/// Longest time until a board is back at the speed before: its trial takes five seconds, and a host is heard within two.
const RETURN: Duration = Duration::from_secs(12);
/// Time for the board's answer to leave before the line changes.
const LETTING_GO: Duration = Duration::from_millis(50);

/// The board and its line after another speed was asked for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum SpeedChange {
    /// Host and board speak at the new speed.
    Changed,
    /// The new speed does not work: host and board speak at the one before.
    WentBack,
    /// The board refuses the speed, and nothing changed.
    Refused(Refusal),
}

/// Changes the speed of the line to `port` from `from` to `to` bits per second, and saves the settings of the board where
/// `save`. Host and board are heard at the new speed before it counts.
///
/// # Errors
/// [`BoardError::LineLost`] where the board is heard neither at the new speed nor at the one before; a link that ended.
pub async fn change_line_speed(
    board: Board,
    port: &Port,
    [from, to]: [u32; 2],
    save: bool,
) -> Result<SpeedChange, BoardError> {
    let baud = SettingKey { item: SettingItem::Baud, axis: 0 };
    // An answer that got lost may have been given: the new speed is tried all the same.
    match board.set(baud, i64::from(to)).await {
        Ok(Ok(())) | Err(BoardError::Link(LinkError::Silent(_))) => {}
        Ok(Err(refusal)) => return Ok(SpeedChange::Refused(refusal)),
        Err(error) => return Err(error),
    }
    board.close().await;
    sleep(LETTING_GO).await;
    let heard = match connect(port, to).await {
        Ok(client) => {
            let is_set = matches!(
                client.ask(Request::GetSetting(baud)).await,
                Ok(Report::Setting { value, .. }) if value == i64::from(to)
            );
            let is_good = is_set && (!save || saves(&client).await?);
            client.close().await;
            is_good
        }
        Err(_) => false,
    };
    if heard {
        return Ok(SpeedChange::Changed);
    }
    let deadline = Instant::now() + RETURN;
    while Instant::now() < deadline {
        if let Ok(client) = connect(port, from).await {
            client.close().await;
            return Ok(SpeedChange::WentBack);
        }
    }
    Err(BoardError::LineLost { from, to })
}

async fn connect(port: &Port, baud: u32) -> Result<Client, OpenError> {
    let wire = open(port, baud, false).await?;
    let continuity = Continuity::begin(wire.baud);
    Client::at(port, wire, fresh_session()?, continuity).await
}

/// Whether the board has saved its settings; false where nothing is heard of it.
async fn saves(client: &Client) -> Result<bool, BoardError> {
    match client.ask(Request::SaveSettings).await {
        Ok(Report::Ack { status: Status::Accepted, .. }) => Ok(true),
        Ok(Report::Ack { status: Status::Refused(refusal), .. }) => {
            Err(BoardError::Refused { refusal, more: String::new() })
        }
        Ok(_) => Err(BoardError::OtherAnswer("a command")),
        Err(_) => Ok(false),
    }
}
