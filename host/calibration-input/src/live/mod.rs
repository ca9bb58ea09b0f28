//! Takes the views of a set while the rig drives itself through the stage poses and a person holds the target.

mod cameras;
mod session;

use std::cell::Cell;
use std::path::Path;

use vergence_board::{Board, BoardError};
use vergence_files::{FileError, make_folder, write_whole};
use vergence_protocol::Mode;
use vergence_rig::{AxisPosition, Rig, RigAxis, positions_in_words};
use vergence_targets::TargetKind;
use vergence_vision::BodyMask;

pub use self::cameras::{RigCameras, SimulatedTarget, printed};

use crate::InputError;
use crate::capture::Looked;
use crate::recorded::{FOLDER, POSES};

/// Number of stage poses that a calibration needs.
const FEWEST_POSES: usize = 3;

/// A set of views that is taken while the rig drives itself.
pub struct LiveSet<'a> {
    /// Folder of the set.
    pub folder: &'a Path,
    /// The target that is shown.
    pub target: TargetKind,
    /// The nominal rig.
    pub nominal: &'a Rig,
    /// Number of views at each stage pose.
    pub views: usize,
    /// Largest number of images of each camera at one stage pose.
    pub images: u64,
    /// What is left out of the images of the left and of the right camera.
    pub masks: [Option<BodyMask>; 2],
}

/// What happens while a set is taken; the texts are for people.
pub enum LiveEvent<'a> {
    /// The rig stands at a stage pose; the heading says which.
    Begins(&'a str),
    /// What was seen of the target, and how many views the stage pose will have.
    Looked(Looked<'a>, usize),
    /// Says how far this stage pose has come, and what to show next.
    Advice(String),
    /// The stage pose has its views; the sentence says how many images that took.
    Complete(String),
}

impl LiveSet<'_> {
    /// Whether the folder is free for a new set.
    ///
    /// # Errors
    /// [`FileError::Write`] where it holds a set already.
    pub fn check_free(folder: &Path) -> Result<(), FileError> {
        if folder.join(POSES).exists() {
            return Err(FileError::write(folder, "it holds a set already: choose another folder"));
        }
        Ok(())
    }

    /// Homes the rig, moves it to the stage poses of `plan`, and takes the views of each. Every image is written at once, and
    /// poses.csv after every stage pose: they stay, whatever ends the program. `interruption` ends the set early; `tell` is
    /// called with each event.
    ///
    /// # Errors
    /// Those of the board and the cameras; a stage that does not stand still; an interruption; those of `tell`.
    pub async fn fill<E>(
        &self,
        plan: &[Vec<AxisPosition>],
        rig_board: &mut Board,
        rig_cameras: &mut RigCameras,
        interruption: impl Future<Output = ()>,
        mut tell: impl FnMut(LiveEvent<'_>) -> Result<(), E>,
    ) -> Result<(), E>
    where
        E: From<InputError> + From<BoardError>,
    {
        make_folder(self.folder).map_err(InputError::from)?;
        let (mut rows, was_interrupted) = (Vec::new(), Cell::new(false));
        let interruption = async {
            interruption.await;
            was_interrupted.set(true);
        };
        let outcome = rig_board
            .armed(interruption, async |rig_board| -> Result<(), E> {
                rig_board.home().await?;
                for (index, targets) in plan.iter().enumerate() {
                    rig_board.move_to(Mode(0), targets).await?;
                    let heading = format!("pose {} of {} at {}", index + 1, plan.len(), positions_in_words(targets));
                    rows.push(self.stage_pose(index, &heading, rig_board, rig_cameras, &mut tell).await?);
                    self.write_poses(&rows).map_err(InputError::from)?;
                }
                Ok(())
            })
            .await;
        if was_interrupted.get() {
            return Err(InputError::Interrupted(how_to_go_on(self.folder, rows.len(), plan.len())).into());
        }
        outcome
    }

    /// Writes poses.csv with these rows.
    fn write_poses(&self, rows: &[String]) -> Result<(), FileError> {
        let columns = self.nominal.axes.iter().map(RigAxis::column);
        let header = [FOLDER.to_owned()].into_iter().chain(columns).collect::<Vec<_>>().join(",");
        let text = [header].iter().chain(rows).map(|line| format!("{line}\n")).collect::<String>();
        write_whole(&self.folder.join(POSES), text.as_bytes())
    }
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
        let advice = |kept| how_to_go_on("set".as_ref(), kept, 6);
        assert!(advice(0).contains("same command again") && advice(2).contains("another --set"));
        assert!(advice(3).contains("3 of 6 stage poses are kept in set") && advice(3).contains("without --live"));
    }
}
