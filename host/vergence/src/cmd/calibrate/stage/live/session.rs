//! Views of a set, taken at one stage pose after the other.

use std::path::Path;

use rayon::prelude::*;
use tokio::task::spawn_blocking;
use vergence_board::Board;
use vergence_calibration::{Coverage, TargetSpec};
use vergence_camera::{Camera, CameraError, CameraImage};
use vergence_files::{make_folder, write_png, write_whole};
use vergence_rig::{AxisPosition, Rig};
use vergence_vision::{Camera as CameraFrame, Pixel, Right, UnitRay};

use super::Options;
use super::cameras::RigCameras;
use crate::cmd::calibrate::stage::recorded::{FOLDER, POSES, column, number};
use crate::console::Console;
use crate::failure::Failure;
use crate::target_watch::{NAMES, TargetViews, TargetWatch, observe};

/// Largest motion of an axis while views are taken, in encoder steps.
const STILL_STEPS: f64 = 4.0;
/// Distance of the target for which the shared field is judged, in millimetres.
const TARGET_MM: f64 = 300.0;

/// The parts that all stage poses of a set share.
pub struct Session<'a> {
    /// Folder of the set.
    pub set: &'a Path,
    /// Options of the command line.
    pub options: &'a Options,
    /// The target that is shown.
    pub target: TargetSpec,
    /// The nominal rig.
    pub nominal: &'a Rig,
    /// Messages.
    pub console: Console,
}

impl Session<'_> {
    /// Takes the views of one stage pose; returns its row of poses.csv.
    ///
    /// # Errors
    /// Those of the board and the cameras; a stage that moves meanwhile.
    pub async fn stage_pose(
        &self,
        index: usize,
        heading: &str,
        rig_board: &mut Board,
        rig_cameras: &mut RigCameras,
    ) -> Result<String, Failure> {
        let name = format!("pose{:02}", index + 1);
        let folder = self.set.join(&name);
        make_folder(&folder)?;
        rig_board.next_pose().await?;
        let readings = rig_board.positions();
        let mut watch = TargetWatch::new(vec![self.coverage(&readings)]);
        let mut cameras = rig_cameras.here(index);
        let progress = self.console.progress(heading);
        let wanted = usize::from(self.options.views);
        let mut images_seen = 0;
        while watch.taken() < wanted {
            let (images, views);
            (cameras, images, views) = look(cameras, self.target).await?;
            images_seen += 1;
            if images_seen > self.options.frames {
                return Err(Failure::device(format!(
                    "{heading}: {} of {wanted} views in {images_seen} images",
                    watch.taken()
                )));
            }
            if watch.observe(views) && (watch.is_news() || watch.is_elsewhere()) {
                for (image, side) in images.iter().zip(NAMES) {
                    write_png(&folder.join(format!("{side}{:03}.png", watch.taken())), &image.image)?;
                }
                watch.take();
            }
            let advice = watch.advice().unwrap_or_else(|| "show the target elsewhere, or tilted".into());
            progress.set_message(format!("{heading}: view {} of {wanted}; {advice}", watch.taken()));
            progress.tick();
        }
        progress.finish_and_clear();
        rig_cameras.give_back(cameras);
        rig_board.next_pose().await?;
        self.check_still(&readings, &rig_board.positions())?;
        let more = match watch.advice() {
            None => "the shared field is covered".to_owned(),
            Some(advice) => format!("better still: {advice}"),
        };
        self.console.say(format!("{heading}: {wanted} views in {images_seen} images; {more}"))?;
        let numbers = readings.iter().map(|&reading| format!("{:.6}", number(reading)));
        Ok([name].into_iter().chain(numbers).collect::<Vec<_>>().join(","))
    }

    fn check_still(&self, before: &[AxisPosition], after: &[AxisPosition]) -> Result<(), Failure> {
        for ((axis, &before), &after) in self.nominal.axes.iter().zip(before).zip(after) {
            let moved = after.minus(before);
            if moved.value().abs() > STILL_STEPS * axis.value_per_count() {
                return Err(Failure::device(format!(
                    "axis '{}' moved by {moved} while views were taken: it must stand still",
                    axis.name
                )));
            }
        }
        Ok(())
    }

    /// Coverage of the left camera within the field that the right camera shares, by the nominal rig.
    fn coverage(&self, readings: &[AxisPosition]) -> Coverage {
        let (left, right) = (&self.nominal.left_camera, &self.nominal.right_camera);
        let values: Vec<f64> = readings.iter().map(|reading| reading.value()).collect();
        let right_from_left = self.nominal.pose_at_values(&values).right_from_left();
        Coverage::within(left.size(), |pixel: Pixel| {
            let Ok(ray) = left.unproject::<CameraFrame>(pixel) else { return false };
            let point = right_from_left * ray.renamed().at(TARGET_MM);
            UnitRay::<Right>::new(point.mm())
                .and_then(|ray| right.project(&ray).ok())
                .is_some_and(|p| right.on_sensor(p))
        })
    }

    /// Writes poses.csv with these rows.
    ///
    /// # Errors
    /// Where the file cannot be written.
    pub fn write_poses(&self, rows: &[String]) -> Result<(), Failure> {
        let columns = self.nominal.axes.iter().map(column);
        let header = [FOLDER.to_owned()].into_iter().chain(columns).collect::<Vec<_>>().join(",");
        let text = [header].iter().chain(rows).map(|line| format!("{line}\n")).collect::<String>();
        Ok(write_whole(&self.set.join(POSES), text.as_bytes())?)
    }
}

/// Takes one image with each camera and looks for the target in them, on a thread of its own: the link must not wait.
async fn look(
    mut cameras: Vec<Box<dyn Camera>>,
    target: TargetSpec,
) -> Result<(Vec<Box<dyn Camera>>, Vec<CameraImage>, TargetViews), Failure> {
    let looked = spawn_blocking(move || {
        let grab = |camera: &mut Box<dyn Camera>| camera.grab()?.ok_or(CameraError::Ended);
        let images: Vec<CameraImage> = cameras.par_iter_mut().map(grab).collect::<Result<_, CameraError>>()?;
        let views = observe(&images, &target);
        Ok((cameras, images, views))
    });
    looked.await.map_err(|error| Failure::device(format!("looking through the cameras failed: {error}")))?
}
