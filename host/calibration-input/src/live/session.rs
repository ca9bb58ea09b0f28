//! The views of one stage pose of a set.

use rayon::prelude::*;
use vergence_board::{Board, BoardError};
use vergence_calibration::Coverage;
use vergence_camera::{Camera, CameraError, CameraImage};
use vergence_files::{make_folder, write_png};
use vergence_rig::AxisPosition;
use vergence_vision::{BodyMask, Camera as CameraFrame, Pixel, Right, UnitRay};

use super::cameras::RigCameras;
use super::{LiveEvent, LiveSet};
use crate::InputError;
use crate::capture::Looked;
use crate::target_watch::{NAMES, TargetWatch, look};

/// Largest motion of an axis while views are taken, in encoder steps.
const STILL_STEPS: f64 = 4.0;
/// Distance of the target for which the shared field is judged, in millimetres.
const TARGET_MM: f64 = 300.0;

impl LiveSet<'_> {
    /// Takes the views of one stage pose; returns its row of poses.csv.
    pub(super) async fn stage_pose<E>(
        &self,
        index: usize,
        heading: &str,
        rig_board: &mut Board,
        rig_cameras: &mut RigCameras,
        tell: &mut impl FnMut(LiveEvent<'_>) -> Result<(), E>,
    ) -> Result<String, E>
    where
        E: From<InputError> + From<BoardError>,
    {
        let name = format!("pose{:02}", index + 1);
        let folder = self.folder.join(&name);
        make_folder(&folder).map_err(InputError::from)?;
        rig_board.next_pose().await?;
        let readings = rig_board.positions();
        let mut watch = TargetWatch::new(vec![self.coverage(&readings)]).masked(self.masks.clone());
        let mut cameras = rig_cameras.here(index);
        tell(LiveEvent::Begins(heading))?;
        let wanted = self.views;
        let mut images_seen = 0;
        while watch.taken() < wanted {
            let (images, views);
            (cameras, images, views) = look(cameras, grab, self.target).await?;
            images_seen += 1;
            if images_seen > self.images {
                let (heading, taken) = (heading.to_owned(), watch.taken());
                return Err(InputError::TooFewViews { heading, taken, wanted, images: images_seen }.into());
            }
            let is_still = watch.observe(views);
            let is_taken = is_still && (watch.is_news() || watch.is_elsewhere());
            if is_taken {
                for (image, side) in images.iter().zip(NAMES) {
                    let path = folder.join(format!("{side}{:03}.png", watch.taken()));
                    write_png(&path, &image.image).map_err(InputError::from)?;
                }
                watch.take();
            }
            tell(LiveEvent::Looked(Looked { images: &images, watch: &watch, is_still, is_taken }, wanted))?;
            let advice = watch.advice().unwrap_or_else(|| "show the target elsewhere, or tilted".into());
            tell(LiveEvent::Advice(format!("{heading}: view {} of {wanted}; {advice}", watch.taken())))?;
        }
        rig_cameras.give_back(cameras);
        rig_board.next_pose().await?;
        self.check_still(&readings, &rig_board.positions())?;
        let more = match watch.advice() {
            None => "the shared field is covered".to_owned(),
            Some(advice) => format!("better still: {advice}"),
        };
        tell(LiveEvent::Complete(format!("{heading}: {wanted} views in {images_seen} images; {more}")))?;
        let numbers = readings.iter().map(|&reading| format!("{:.6}", reading.mm_or_deg()));
        Ok([name].into_iter().chain(numbers).collect::<Vec<_>>().join(","))
    }

    fn check_still(&self, before: &[AxisPosition], after: &[AxisPosition]) -> Result<(), InputError> {
        for ((axis, &before), &after) in self.nominal.axes.iter().zip(before).zip(after) {
            let moved = after.minus(before);
            if moved.value().abs() > STILL_STEPS * axis.value_per_count() {
                return Err(InputError::Moved { axis: axis.name.clone(), moved });
            }
        }
        Ok(())
    }

    /// Coverage of the left camera within the field that the right camera shares, by the nominal rig.
    fn coverage(&self, readings: &[AxisPosition]) -> Coverage {
        let (left, right) = (&self.nominal.left_camera, &self.nominal.right_camera);
        let values: Vec<f64> = readings.iter().map(|reading| reading.value()).collect();
        let right_from_left = self.nominal.pose_at_values(&values).right_from_left();
        let [left_mask, right_mask] = self.masks.each_ref().map(Option::as_ref);
        let hides = |mask: Option<&BodyMask>, pixel| mask.is_some_and(|mask| mask.hides(pixel));
        Coverage::within(left.size(), |pixel: Pixel| {
            if hides(left_mask, pixel) {
                return false;
            }
            let Ok(ray) = left.unproject::<CameraFrame>(pixel) else { return false };
            let point = right_from_left * ray.renamed().at(TARGET_MM);
            UnitRay::<Right>::new(point.mm())
                .and_then(|ray| right.project(&ray).ok())
                .is_some_and(|p| right.on_sensor(p) && !hides(right_mask, p))
        })
    }
}

/// An image of each camera.
fn grab(cameras: &mut Vec<Box<dyn Camera>>) -> Result<Vec<CameraImage>, CameraError> {
    cameras.par_iter_mut().map(|camera| camera.grab()?.ok_or(CameraError::Ended)).collect()
}
