//! Firmware updates over the link: sending an image, starting it on trial, confirming it, and going back.

mod error;
mod image;
mod restart;

use std::time::Duration;

use tokio::time::Instant;
use vergence_protocol::management::{BootState, Identity, ImageHeader, Management, Outcome};
use vergence_protocol::update::{Upload, UploadState};

pub use self::error::UpdateError;
pub use self::image::{FirmwareImage, ImageFileError, hardware_name, identity_json, identity_words, version_text};
pub use self::restart::{restart, roll_back};

use self::restart::restart_into;
use crate::link::{LinkError, ManagementLink};

/// Longest wait for a lost link to come back.
const LINK_PATIENCE: Duration = Duration::from_secs(20);
/// A link that is lost more often in one update is of no use.
const MOST_LOSSES: u32 = 20;

/// What happens in the course of an update.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub enum UpdateEvent {
    /// The board accepts the image; it runs this before the update.
    Begins(Identity),
    /// The board has this many of the image's bytes.
    Progress {
        /// Bytes that the board has.
        sent: u32,
        /// Bytes of the image.
        length: u32,
    },
    /// The link was lost; the update waits for it.
    LinkLost(LinkError),
    /// The board has the whole image; this many bytes were sent in so many seconds.
    Sent {
        /// Bytes that the board lacked.
        bytes: u32,
        /// Seconds.
        seconds: f64,
    },
}

/// The course of a finished update.
#[derive(Clone, Debug, PartialEq)]
pub struct Updated {
    /// What the board ran before.
    pub before: Identity,
    /// What it runs now.
    pub after: Identity,
    /// The first byte of the image that the board lacked.
    pub sent_from: u32,
    /// Number of times that the link was lost.
    pub link_losses: u32,
    /// Duration of sending, in seconds.
    pub seconds: f64,
}

/// Sends an image, starts it on trial, and with `confirm` makes the board keep it. `report` is called with each event.
///
/// # Errors
/// [`UpdateError`]: the board refuses, the link does not come back, or the image does not start.
pub async fn update(
    image: &FirmwareImage,
    confirm: bool,
    link: &mut ManagementLink,
    mut report: impl FnMut(UpdateEvent),
) -> Result<Updated, UpdateError> {
    let before = link.identify().await?;
    check_fits(image.header(), &before)?;
    report(UpdateEvent::Begins(before));
    let start = Instant::now();
    let (sent_from, link_losses) = send(image, link, &mut report).await?;
    let seconds = start.elapsed().as_secs_f64();
    report(UpdateEvent::Sent { bytes: image.header().length - sent_from, seconds });
    let mut after = restart_into(link, &before, |now| is_on_trial(image.header(), now)).await?;
    if confirm {
        after = self::confirm(link).await?;
    }
    Ok(Updated { before, after, sent_from, link_losses, seconds })
}

/// Makes the board keep the image that is on trial.
///
/// # Errors
/// [`UpdateError`]: the board refuses, or the link ended.
pub async fn confirm(link: &mut ManagementLink) -> Result<Identity, UpdateError> {
    carried_out(link.ask(&Management::Confirm).await?)?;
    Ok(link.identify().await?)
}

/// Refuses what the board would refuse, before anything is sent.
fn check_fits(header: &ImageHeader, board: &Identity) -> Result<(), UpdateError> {
    if header.hardware != board.hardware {
        return Err(UpdateError::WrongHardware { image: header.hardware, board: board.hardware });
    }
    if header.version < board.oldest {
        return Err(UpdateError::TooOld { image: header.version, oldest: board.oldest });
    }
    if header.length > board.capacity {
        return Err(UpdateError::TooLong { length: header.length, capacity: board.capacity });
    }
    if board.boot == BootState::Trial {
        return Err(UpdateError::OnTrial);
    }
    Ok(())
}

fn is_on_trial(header: &ImageHeader, board: &Identity) -> bool {
    board.boot == BootState::Trial && board.build == header.build
}

/// Sends what the board lacks of the image. Returns the first byte that it lacked, and the number of lost links.
async fn send(
    image: &FirmwareImage,
    link: &mut ManagementLink,
    report: &mut impl FnMut(UpdateEvent),
) -> Result<(u32, u32), UpdateError> {
    let mut upload = Upload::new(&image.bytes, *image.header(), image.seal.signature).ok_or(UpdateError::Length)?;
    let (mut from, mut link_losses) = (None, 0);
    let later = |error: &dyn std::fmt::Display| UpdateError::GoOnLater(error.to_string());
    loop {
        let show = |upload: &Upload<'_>| {
            let (sent, _) = upload.progress();
            if matches!(upload.state(), UploadState::Sending | UploadState::Checking) {
                from.get_or_insert(sent);
            }
            report(UpdateEvent::Progress { sent, length: image.header().length });
        };
        let Err(lost) = link.upload(&mut upload, show).await else { break };
        link_losses += 1;
        if link_losses > MOST_LOSSES {
            return Err(later(&lost));
        }
        report(UpdateEvent::LinkLost(lost));
        link.reopen(LINK_PATIENCE).await.map_err(|error| later(&error))?;
        link.identify_within(LINK_PATIENCE).await.map_err(|error| later(&error))?;
        upload.resume();
    }
    if let UploadState::Failed(outcome) = upload.state() {
        carried_out(outcome)?;
    }
    Ok((from.unwrap_or(0), link_losses))
}

/// A refusal as an error.
fn carried_out(outcome: Outcome) -> Result<(), UpdateError> {
    match outcome {
        Outcome::Done => Ok(()),
        refused => Err(UpdateError::Refused(refused)),
    }
}
