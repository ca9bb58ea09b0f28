//! The operator's side of an order: see `desk`.

use std::time::Duration;

use crate::authorisation::Secret;
use crate::desk::{Answer, Ask};
use crate::error::PeersError;
use crate::keys::mode_key;
use crate::transport::Session;

/// How often the rig is asked how far it is.
const PACE: Duration = Duration::from_millis(250);
/// How long an answer is waited for.
const WAIT: Duration = Duration::from_secs(1);
/// How often a question is asked that nobody answers: ways may only just be open.
const PATIENCE: usize = 20;

/// Sends `rig` to `mode`, and waits until it is there. Call on a thread that nothing else waits for.
///
/// # Errors
/// [`PeersError::Silent`], [`PeersError::Refused`], [`PeersError::NotReached`], [`PeersError::Foreign`]
pub fn send_to_mode(session: &Session, rig: &str, mode: &str, secret: &Secret) -> Result<(), PeersError> {
    let silent = || PeersError::Silent(rig.to_owned());
    let number = match patiently(session, rig, &Ask::Number)?.ok_or_else(silent)? {
        Answer::Number { number } => number,
        answer => return Err(unwanted(rig, mode, answer)),
    };
    let tag = secret.tag(rig, &number, mode);
    let order = Ask::Mode { mode: mode.to_owned(), number: number.clone(), tag };
    // An order is given once. Where its answer is lost, the next one tells.
    let mut answer = ask(session, rig, &order)?.unwrap_or(Answer::Moving);
    loop {
        match answer {
            Answer::Reached => return Ok(()),
            Answer::Moving => {}
            other => return Err(unwanted(rig, mode, other)),
        }
        std::thread::park_timeout(PACE);
        let cut =
            || Answer::Ended { why: "the way to it is cut; where it hears nothing, it stops by itself".to_owned() };
        answer = patiently(session, rig, &Ask::Progress { number: number.clone() })?.unwrap_or_else(cut);
    }
}

fn unwanted(rig: &str, mode: &str, answer: Answer) -> PeersError {
    let (rig, mode) = (rig.to_owned(), mode.to_owned());
    match answer {
        Answer::Refused { why } => PeersError::Refused { rig, why },
        Answer::Ended { why } => PeersError::NotReached { rig, mode, why },
        _ => PeersError::Foreign(rig),
    }
}

/// Asks until there is an answer.
fn patiently(session: &Session, rig: &str, question: &Ask) -> Result<Option<Answer>, PeersError> {
    for _ in 0..PATIENCE {
        if let Some(answer) = ask(session, rig, question)? {
            return Ok(Some(answer));
        }
        std::thread::park_timeout(PACE);
    }
    Ok(None)
}

fn ask(session: &Session, rig: &str, question: &Ask) -> Result<Option<Answer>, PeersError> {
    let foreign = |_| PeersError::Foreign(rig.to_owned());
    let question = serde_json::to_vec(question).map_err(foreign)?;
    let answer = session.ask(&mode_key(rig), &question, WAIT)?;
    answer.map(|answer| serde_json::from_slice(&answer).map_err(foreign)).transpose()
}
