//! Starting the board again, and waiting for what comes up.

use std::time::Duration;

use tokio::time::{Instant, sleep, timeout};
use vergence_protocol::management::{BootState, Identity, Outcome};

use super::{REBOOT, carried_out};
use crate::failure::Failure;
use crate::firmware::version_text;
use crate::link::{LinkError, ManagementLink};

/// A swap of both images takes some 5 s, the application's start less than one.
const START_PATIENCE: Duration = Duration::from_secs(30);
/// A board that still runs the old image so long after it was told to start again has not heard it.
const UNHEARD: Duration = Duration::from_secs(4);
/// Between two looks.
const PAUSE: Duration = Duration::from_millis(200);
/// What has started must live so long, through its self test and past its watchdog, before it is believed.
const PROBATION: Duration = Duration::from_secs(1);
/// A board that said yes starts again in this time.
const LETTING_GO: Duration = Duration::from_millis(500);

/// Starts the board again and waits until it answers.
pub async fn restart(link: &mut ManagementLink) -> Result<Identity, Failure> {
    reboot(link).await?;
    sleep(LETTING_GO).await;
    let deadline = Instant::now() + START_PATIENCE;
    loop {
        if let Some(identity) = look(link).await? {
            return Ok(identity);
        }
        if Instant::now() >= deadline {
            return Err(silent());
        }
    }
}

/// Starts the board again and waits until it `is_it`. It ran as `before`.
pub async fn restart_into(
    link: &mut ManagementLink,
    before: &Identity,
    is_it: impl Fn(&Identity) -> bool,
) -> Result<Identity, Failure> {
    reboot(link).await?;
    let deadline = Instant::now() + START_PATIENCE;
    let mut told = Instant::now();
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
            Some(identity) if alive_since.is_some() => return Err(died(&identity)),
            // A new image must not be started twice: it would go back. This is the old one, so the request got lost.
            Some(identity) if identity == *before && told.elapsed() >= UNHEARD => {
                reboot(link).await?;
                told = Instant::now();
                last = Some(identity);
            }
            Some(identity) => last = Some(identity),
            None => {}
        }
        sleep(PAUSE).await;
    }
    Err(match last {
        Some(identity) if identity.boot == BootState::Recovery => Failure::device(
            "the board is in its boot loader, no application starts: send it an image with 'vergence flash --serial'",
        ),
        Some(identity) => Failure::device(format!(
            "the board did not start the other image: it runs build {:016x}, {}",
            identity.build, identity.boot
        )),
        None => silent(),
    })
}

/// Whether the board that was `before` has gone back.
pub fn went_back(before: &Identity, now: &Identity) -> bool {
    now.boot == BootState::Reverted && (before.boot != BootState::Reverted || now.build != before.build)
}

/// Once, for a board that starts twice goes back.
async fn reboot(link: &mut ManagementLink) -> Result<(), Failure> {
    match link.ask_once(&REBOOT).await {
        Ok(Some(outcome)) if outcome != Outcome::Done => carried_out(outcome),
        // No answer, or a link that went away with the board: what comes up will tell.
        Ok(_) => Ok(()),
        Err(_) => link.reopen(START_PATIENCE).await,
    }
}

/// Who is there, if anybody. The link may come and go with the board.
async fn look(link: &mut ManagementLink) -> Result<Option<Identity>, Failure> {
    match timeout(UNHEARD, link.identify()).await {
        Ok(Ok(identity)) => Ok(Some(identity)),
        Err(_) | Ok(Err(LinkError::Silent(_))) => Ok(None),
        Ok(Err(_)) => link.reopen(START_PATIENCE).await.map(|()| None),
    }
}

fn died(now: &Identity) -> Failure {
    Failure::device(format!(
        "what was started did not live for {PROBATION:?}: the board runs {} (build {:016x}) again, {}",
        version_text(now.version),
        now.build,
        now.boot
    ))
}

fn silent() -> Failure {
    Failure::device(format!(
        "the board does not answer since it was started again, for {START_PATIENCE:?}: switch it off and on; what was not \
         confirmed goes back"
    ))
}
