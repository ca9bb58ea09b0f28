//! `vergence calibrate`: cameras, pairs and stages from targets; calibrations compared and kept.

mod diff;
mod extrinsics;
mod intrinsics;
mod options;
mod slots;
mod stage;

use indicatif::ProgressBar;
use vergence_calibration_input::{MissedReason, ViewEvent};

use crate::cmd::options::{BoardOptions, Choice, With};
use crate::console::Console;
use crate::failure::Failure;

/// Calibrates from images of a target or from corners in a CSV file. No initial guess is needed.
#[derive(Debug, clap::Args)]
pub struct Args {
    #[command(subcommand)]
    task: Task,
}

#[derive(Debug, clap::Subcommand)]
enum Task {
    /// Calibrates one camera: lens parameters, their uncertainty and the valid field.
    Intrinsics(intrinsics::Args),
    /// Calibrates a pair: the pose of the right camera and its uncertainty.
    Extrinsics(extrinsics::Args),
    /// Calibrates a moving stage: its screws and encoders, for every pose that it can take.
    ///
    /// It needs views of a target at several stage poses: three suffice, six are recommended, each with a dozen views or
    /// more. --rig names the drawing: axes, modes and screws as designed.
    Stage(Box<With<BoardOptions, stage::Args>>),
    /// Prints how far two calibrations of a camera differ over the field.
    Diff(diff::Args),
    /// Lists the calibrations that are kept.
    List(slots::List),
    /// Makes a kept calibration the active one.
    ///
    /// It is then the rig of every verb without --rig. The swap is atomic.
    Use(slots::Use),
    /// Makes the previously active calibration active again.
    Rollback(slots::Rollback),
}

pub async fn run(args: &Args, console: Console) -> Result<(), Failure> {
    match &args.task {
        Task::Intrinsics(args) => intrinsics::run(args, console),
        Task::Extrinsics(args) => extrinsics::run(args, console),
        Task::Stage(verb) => stage::run(&verb.args, &verb.options.chosen()?, console).await,
        Task::Diff(args) => diff::run(args, console),
        Task::List(args) => slots::list(args, console),
        Task::Use(args) => slots::activate(args, console),
        Task::Rollback(args) => slots::rollback(args, console),
    }
}

/// Shows that images are looked at, and names those that give no view.
fn print_views(console: Console) -> impl FnMut(ViewEvent<'_>) -> Result<(), Failure> {
    let mut progress: Option<ProgressBar> = None;
    move |event| {
        match event {
            ViewEvent::Looking(images) => {
                progress = Some(console.progress(&format!("looking for the target in {images} images")));
            }
            ViewEvent::Looked => _ = progress.take().map(|progress| progress.finish_and_clear()),
            ViewEvent::Missed(missed) => match missed.reason {
                MissedReason::NoTarget(_) | MissedReason::Hidden | MissedReason::Unplaced => console.say(missed)?,
                MissedReason::Damaged(_) => console.warn(missed.to_string()),
            },
            ViewEvent::Unlabelled(left_out) => console.warn(left_out.to_string()),
            ViewEvent::Alone(file) => {
                console.warn(format!(
                    "{}: left out: the other camera has no image of this name, number or time",
                    file.display()
                ));
            }
        }
        Ok(())
    }
}
