//! `vergence flash --serial`: an update over the link.

use std::cell::Cell;
use std::time::Duration;

use indicatif::ProgressBar;
use serde_json::{Value, json};
use vergence_protocol::management::{BootState, Identity, ImageHeader, Management};
use vergence_protocol::update::{Upload, UploadState};

use super::start::restart_into;
use super::{carried_out, identity_json, link_failure, tell};
use crate::console::Console;
use crate::failure::Failure;
use crate::firmware::{OwnedImage, hardware_name, header_json, version_text};
use crate::link::ManagementLink;
use crate::stopwatch::Stopwatch;

/// How long a link that went away is waited for.
const LINK_PATIENCE: Duration = Duration::from_secs(20);

/// A link that is lost more often is of no use.
const MOST_LOSSES: u32 = 20;

/// How an image got there.
struct Sent {
    /// The first byte that the board lacked when this began.
    from: u32,
    /// How often the link was lost.
    link_losses: u32,
    seconds: f64,
}

/// Sends an image, starts it, and where asked for confirms it; returns what there is to tell.
///
/// # Errors
/// What the board refuses, a link that does not come back, an image that does not start.
pub async fn update(
    image: &OwnedImage,
    confirm: bool,
    link: &mut ManagementLink,
    console: Console,
) -> Result<Value, Failure> {
    let before = link.identify().await.map_err(|error| link_failure(&error))?;
    accept(image.header(), &before)?;
    tell(&before, console)?;
    let sent = send(image, link, console).await?;
    console.say(format!("sent {} bytes in {:.1} s", image.header().length - sent.from, sent.seconds))?;
    let progress = console.progress("the board starts the new image");
    let mut after = restart_into(link, &before, |now| is_on_trial(image.header(), now)).await?;
    progress.finish_and_clear();
    if confirm {
        carried_out(link.ask(&Management::Confirm).await.map_err(|error| link_failure(&error))?)?;
        after = link.identify().await.map_err(|error| link_failure(&error))?;
    }
    tell(&after, console)?;
    if !confirm {
        console.say("keep it with 'vergence flash --confirm'; the next start goes back otherwise")?;
    }
    Ok(json!({
        "image": header_json(image.header()),
        "before": identity_json(&before),
        "after": identity_json(&after),
        "sent_from": sent.from,
        "link_losses": sent.link_losses,
        "seconds": sent.seconds,
    }))
}

/// Refuses what the board would refuse, before anything is sent.
fn accept(header: &ImageHeader, board: &Identity) -> Result<(), Failure> {
    if header.hardware != board.hardware {
        return Err(Failure::usage(format!(
            "the image is for {}, the board is {}",
            hardware_name(header.hardware),
            hardware_name(board.hardware)
        )));
    }
    if header.version < board.oldest {
        return Err(Failure::usage(format!(
            "the image is version {}, the board accepts {} and newer",
            version_text(header.version),
            version_text(board.oldest)
        )));
    }
    if header.length > board.capacity {
        return Err(Failure::usage(format!(
            "the image has {} bytes, the board has room for {}",
            header.length, board.capacity
        )));
    }
    if board.boot == BootState::Trial {
        return Err(Failure::device(
            "the board has an image on trial: keep it with 'vergence flash --confirm', or go back with --rollback",
        ));
    }
    Ok(())
}

fn is_on_trial(header: &ImageHeader, board: &Identity) -> bool {
    board.boot == BootState::Trial && board.build == header.build
}

async fn send(image: &OwnedImage, link: &mut ManagementLink, console: Console) -> Result<Sent, Failure> {
    let stopwatch = Stopwatch::start();
    let mut upload = Upload::new(&image.bytes, *image.header(), image.seal.signature)
        .ok_or_else(|| Failure::usage("the image is not as long as its header says"))?;
    let bar = console.byte_bar("sending", image.bytes.len() as u64);
    let from = Cell::new(None);
    let mut link_losses = 0;
    while let Err(lost) = link.upload(&mut upload, |upload| show(&bar, &from, upload)).await {
        link_losses += 1;
        if link_losses > MOST_LOSSES {
            return Err(go_on_later(&link_failure(&lost)));
        }
        console.warn(format!("{lost}; waiting for the board, the update goes on where it stopped"));
        link.reopen(LINK_PATIENCE).await.map_err(|failure| go_on_later(&failure))?;
        link.identify_within(LINK_PATIENCE).await.map_err(|error| go_on_later(&link_failure(&error)))?;
        upload.resume();
    }
    bar.finish_and_clear();
    if let UploadState::Failed(outcome) = upload.state() {
        carried_out(outcome)?;
    }
    Ok(Sent { from: from.get().unwrap_or(0), link_losses, seconds: stopwatch.seconds() })
}

fn show(bar: &ProgressBar, from: &Cell<Option<u32>>, upload: &Upload<'_>) {
    let (next, _) = upload.progress();
    bar.set_position(next.into());
    if matches!(upload.state(), UploadState::Sending | UploadState::Checking) && from.get().is_none() {
        from.set(Some(next));
    }
}

fn go_on_later(failure: &Failure) -> Failure {
    Failure::link(format!("{failure}; give the same command again later: the update goes on where it stopped"))
}
