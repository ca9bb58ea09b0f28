//! Restarting the board, and waiting for the image that comes up.

use std::time::Duration;

use tokio::time::{Instant, sleep, timeout};
use vergence_protocol::management::{BootState, Identity, Management, Outcome, RebootTo};

use super::{UpdateError, carried_out};
use crate::link::{LinkError, ManagementLink};

/// Longest restart. A swap of the longest images takes some 9 s, the application's start less than one.
const START_PATIENCE: Duration = Duration::from_secs(30);
/// A board that still runs the old image after this time did not receive the request to restart.
const UNHEARD: Duration = Duration::from_secs(4);
/// Time between two questions.
const PAUSE: Duration = Duration::from_millis(200);
/// How long a new image must run before it is believed: through its self test and past its watchdog.
const PROBATION: Duration = Duration::from_secs(1);
/// Longest time from a board's answer to its restart.
const LETTING_GO: Duration = Duration::from_millis(500);
/// Restart into the application.
const REBOOT: Management = Management::Reboot(RebootTo::Application);

/// Restarts the board and waits until it answers.
///
/// # Errors
/// [`UpdateError`]: a refusal, or a board that stays silent.
pub async fn restart(link: &mut ManagementLink) -> Result<Identity, UpdateError> {
    reboot(link).await?;
    sleep(LETTING_GO).await;
    let deadline = Instant::now() + START_PATIENCE;
    loop {
        if let Some(identity) = look(link).await? {
            return Ok(identity);
        }
        if Instant::now() >= deadline {
            return Err(UpdateError::Silent(START_PATIENCE));
        }
    }
}

/// Makes the board, which ran as `before`, go back to its earlier image.
///
/// # Errors
/// [`UpdateError`]: a refusal, such as where there is no earlier image, or an image that does not start.
pub async fn roll_back(link: &mut ManagementLink, before: &Identity) -> Result<Identity, UpdateError> {
    carried_out(link.ask(&Management::Rollback).await?)?;
    restart_into(link, before, |now| went_back(before, now)).await
}

/// Restarts the board, which ran as `before`, and waits until it `is_it`.
pub(super) async fn restart_into(
    link: &mut ManagementLink,
    before: &Identity,
    is_it: impl Fn(&Identity) -> bool,
) -> Result<Identity, UpdateError> {
    reboot(link).await?;
    let deadline = Instant::now() + START_PATIENCE;
    let mut asked = Instant::now();
    let mut last = None;
    let mut alive_since: Option<Instant> = None;
    while Instant::now() < deadline {
        match look(link).await? {
            Some(identity) if is_it(&identity) => match alive_since {
                Some(since) if since.elapsed() >= PROBATION => return Ok(identity),
                _ => {
                    alive_since.get_or_insert_with(Instant::now);
                }
            },
            Some(now) if alive_since.is_some() => return Err(UpdateError::Died { lived: PROBATION, now }),
            // A new image must not be started twice, or the board goes back. This is the old one: the request got lost.
            Some(identity) if identity == *before && asked.elapsed() >= UNHEARD => {
                reboot(link).await?;
                asked = Instant::now();
                last = Some(identity);
            }
            Some(identity) => last = Some(identity),
            None => {}
        }
        sleep(PAUSE).await;
    }
    Err(match last {
        Some(identity) if identity.boot == BootState::Recovery => UpdateError::NoApplication,
        Some(identity) => UpdateError::NotStarted(identity),
        None => UpdateError::Silent(START_PATIENCE),
    })
}

/// Whether the board that ran as `before` has gone back to its earlier image.
fn went_back(before: &Identity, now: &Identity) -> bool {
    now.boot == BootState::Reverted && (before.boot != BootState::Reverted || now.build != before.build)
}

/// Requests the restart once, because a board that restarts twice goes back.
async fn reboot(link: &mut ManagementLink) -> Result<(), UpdateError> {
    match link.ask_once(&REBOOT).await {
        Ok(Some(outcome)) if outcome != Outcome::Done => carried_out(outcome),
        // No answer, or a link that ended with the restart: the image that comes up shows whether it was carried out.
        Ok(_) => Ok(()),
        Err(_) => Ok(link.reopen(START_PATIENCE).await?),
    }
}

/// The identity of the board, if it answers. The link may come and go with the board.
async fn look(link: &mut ManagementLink) -> Result<Option<Identity>, UpdateError> {
    match timeout(UNHEARD, link.identify()).await {
        Ok(Ok(identity)) => Ok(Some(identity)),
        Err(_) | Ok(Err(LinkError::Silent(_) | LinkError::Taken(_))) => Ok(None),
        Ok(Err(_)) => {
            link.reopen(START_PATIENCE).await?;
            Ok(None)
        }
    }
}
