//! The rig drives itself through the stage poses while a person holds the target.

mod cameras;
mod session;

use std::cell::Cell;
use std::path::Path;

use vergence_calibration::{TargetSpec, stage_plan};
use vergence_files::make_folder;
use vergence_protocol::Mode;
use vergence_rig::Rig;

use self::cameras::{RigCameras, open};
use self::session::Session;
use super::recorded::POSES;
use super::tell::in_words;
use crate::cli::Globals;
use crate::cmd::camera_options::CameraOptions;
use crate::console::Console;
use crate::failure::Failure;
use crate::interrupt::interrupted;
use crate::rig_file;

/// Options of a rig that drives itself.
#[derive(Debug, clap::Args)]
pub struct Options {
    /// Drives the rig itself through the stage poses and takes the views.
    ///
    /// It homes the rig, moves it to poses far apart, and says at each where to show the target. A view counts where
    /// both cameras see the target held still, somewhere new. The views stay in the set, whatever ends the program.
    #[arg(long, requires = "set")]
    pub live: bool,
    /// With --live: number of stage poses.
    #[arg(long, default_value_t = 6, value_parser = clap::value_parser!(u16).range(3..=81))]
    poses: u16,
    /// With --live: number of views at each stage pose.
    #[arg(long, default_value_t = 12, value_parser = clap::value_parser!(u16).range(3..))]
    views: u16,
    /// With --live: give up after this many images at one stage pose.
    #[arg(long, default_value_t = 100_000)]
    frames: u64,
    /// With a simulated rig: seed of how it was really built, of the places of the target, and of the noise.
    #[arg(long, default_value_t = 1)]
    pub seed: u64,
    #[command(flatten)]
    camera: CameraOptions,
}

/// Number of stage poses that a calibration needs.
const FEWEST_POSES: usize = 3;

/// Takes the views of the set folder `set`. Every image is written at once, and poses.csv after every stage pose: they stay,
/// whatever ends the program. Returns the rig as it was really built where it is simulated.
///
/// # Errors
/// Those of the board and the cameras; a stage that does not stand still.
pub async fn fill(
    set: &Path,
    options: &Options,
    cameras: &[String],
    target: TargetSpec,
    globals: &Globals,
    console: Console,
) -> Result<Option<Rig>, Failure> {
    if set.join(POSES).exists() {
        return Err(Failure::output(set, "it holds a set already: choose another folder"));
    }
    let nominal = rig_file::load(globals.rig.as_deref())?;
    let (mut rig_board, mut rig_cameras) = open(options, cameras, &nominal, &target, globals, console).await?;
    make_folder(set)?;
    let plan = stage_plan(&nominal.axes, options.poses.into());
    let session = Session { set, options, target, nominal: &nominal, console };
    let (mut rows, was_interrupted) = (Vec::new(), Cell::new(false));
    let interruption = async {
        interrupted().await;
        was_interrupted.set(true);
    };
    let outcome = rig_board
        .armed(interruption, async |rig_board| -> Result<(), Failure> {
            rig_board.home().await?;
            for (index, targets) in plan.iter().enumerate() {
                rig_board.move_to(Mode(0), targets).await?;
                let heading = format!("pose {} of {} at {}", index + 1, plan.len(), in_words(targets));
                rows.push(session.stage_pose(index, &heading, rig_board, &mut rig_cameras).await?);
                session.write_poses(&rows)?;
            }
            Ok(())
        })
        .await;
    if was_interrupted.get() {
        return Err(Failure::interrupted(how_to_go_on(set, rows.len(), plan.len())));
    }
    outcome?;
    Ok(match rig_cameras {
        RigCameras::Simulated(simulator) => Some(simulator.built),
        RigCameras::Attached(_) => None,
    })
}

/// What an interrupted set is good for.
fn how_to_go_on(set: &Path, kept: usize, wanted: usize) -> String {
    let folder = set.display();
    match kept {
        0 => "interrupted: no stage pose is complete; run the same command again".to_owned(),
        FEWEST_POSES.. => format!(
            "interrupted: {kept} of {wanted} stage poses are kept in {folder}; without --live and --cameras, the same \
             command calibrates from them"
        ),
        _ => format!(
            "interrupted: {kept} of {wanted} stage poses are kept in {folder}, too few for a calibration; begin again \
             with another --set"
        ),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_interrupted_set_is_told_what_it_is_good_for() {
        let told = |kept| how_to_go_on("set".as_ref(), kept, 6);
        assert!(told(0).contains("same command again") && told(2).contains("another --set"));
        assert!(told(3).contains("3 of 6 stage poses are kept in set") && told(3).contains("without --live"));
    }
}
