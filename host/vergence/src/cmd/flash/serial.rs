//! `vergence flash --serial`: an update over the link.

use std::cell::Cell;

use indicatif::ProgressBar;
use serde_json::json;
use vergence_board::{FirmwareImage, ManagementLink, UpdateEvent, Updated, identity_json, identity_words, update};

use crate::console::Console;
use crate::failure::Failure;
use crate::firmware::header_json;
use crate::interrupt::interrupted;

/// Sends an image, starts it, and with `confirm` makes the board keep it.
///
/// # Errors
/// The board refuses, the link does not come back, the image does not start, or an interruption.
pub async fn run(
    image: &FirmwareImage,
    confirm: bool,
    link: &mut ManagementLink,
    console: Console,
) -> Result<(), Failure> {
    let length = image.header().length;
    let bar = console.byte_bar("sending", length.into());
    let stage = Cell::new(Stage::Before);
    let mut unsaid = Ok(());
    let updating = update(image, confirm, link, |event| {
        let said = show(&event, &stage, &bar, console);
        unsaid = std::mem::replace(&mut unsaid, Ok(())).and(said);
    });
    let updated = tokio::select! {
        updated = updating => updated?,
        () = interrupted() => return Err(Failure::interrupted(left_over(stage.get(), length))),
    };
    unsaid?;
    let Updated { before, after, sent_from, link_losses, seconds } = updated;
    console.say(identity_words(&after))?;
    if !confirm {
        console.say("keep it with 'vergence flash --confirm'; the next start goes back otherwise")?;
    }
    console.result(&json!({
        "image": header_json(image.header()),
        "before": identity_json(&before),
        "after": identity_json(&after),
        "sent_from": sent_from,
        "link_losses": link_losses,
        "seconds": seconds,
    }))
}

/// How far an update has come.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Stage {
    Before,
    /// The board has so many bytes.
    Sending(u32),
    Starting,
}

fn show(event: &UpdateEvent, stage: &Cell<Stage>, bar: &ProgressBar, console: Console) -> Result<(), Failure> {
    match event {
        UpdateEvent::Begins(before) => console.say(identity_words(before)),
        UpdateEvent::Progress { sent, .. } => {
            stage.set(Stage::Sending(*sent));
            bar.set_position((*sent).into());
            Ok(())
        }
        UpdateEvent::LinkLost(lost) => {
            console.warn(format!("{lost}; waiting for the board, the update goes on where it stopped"));
            Ok(())
        }
        UpdateEvent::Sent { bytes, seconds } => {
            stage.set(Stage::Starting);
            bar.finish_and_clear();
            console.say(format!("sent {bytes} bytes in {seconds:.1} s; the board starts the new image"))
        }
        _ => Ok(()),
    }
}

/// What an interruption leaves, and how to go on.
fn left_over(stage: Stage, length: u32) -> String {
    match stage {
        Stage::Before => "interrupted: nothing was sent, the board runs what it ran".into(),
        Stage::Sending(sent) => format!(
            "interrupted: the board has {sent} of {length} bytes and still runs its old image, but moves nothing while it \
             takes firmware: give the same command again, the update goes on where it stopped; or give up with 'vergence \
             flash --restart'"
        ),
        Stage::Starting => "interrupted: the board has the whole image and starts it on trial: keep it with 'vergence flash \
                            --confirm', or go back with 'vergence flash --rollback'; 'vergence status' shows what it runs"
            .into(),
    }
}
