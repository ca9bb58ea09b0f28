//! A folder as those of the data sets EuRoC and TUM-VI: `mav0/cam0` and `mav0/cam1` with images that are named by their times, and beside them
//! `mav0/stage0` with the pose of the moving cameras at each exposure.

use std::fmt::Write as _;
use std::path::{Path, PathBuf};

use nalgebra::Isometry3;
use vergence_exchange::{Cameras, Sensor, WriteFormat, WrittenFile};
use vergence_files::{FileError, make_folder, write_whole};
use vergence_recording::Png;
use vergence_rig::{AxisPosition, Rig, RigPose};
use vergence_vision::Face;

use crate::recorded::{Sink, Taken};
use crate::stage::Stage;
use crate::views::{CameraView, describe, remarks, views};
use crate::{ExportError, ExportFormat, Options};

/// The first line of a camera's `data.csv`.
const IMAGES: &str = "#timestamp [ns],filename\n";
/// Counts by which a reading may flicker while the axis stands.
const FLICKER: f64 = 2.0;

/// A folder that is being written.
pub struct Sequence {
    rig: Rig,
    folder: PathBuf,
    /// The front views of an EuRoC folder; none of a TUM-VI folder, which has the images as they are.
    views: Vec<CameraView>,
    images: [String; 2],
    times: Vec<u64>,
    stage: Stage,
    first: Option<RigPose>,
    moved: bool,
}

impl Sequence {
    /// Begins a folder of the cameras of `rig`, whose file is `text`.
    pub fn create(rig: &Rig, text: &str, options: &Options) -> Result<Self, ExportError> {
        let views = match options.to {
            ExportFormat::Euroc => views(rig, &[Face::Front], options)?,
            ExportFormat::TumVi | ExportFormat::Pinhole => Vec::new(),
        };
        let folder = options.out.clone();
        for inner in ["mav0/cam0/data", "mav0/cam1/data", "mav0/stage0"] {
            make_folder(&folder.join(inner))?;
        }
        write_whole(&folder.join("rig.toml"), text.as_bytes())?;
        Ok(Self {
            rig: rig.clone(),
            folder,
            views,
            images: [IMAGES.to_owned(), IMAGES.to_owned()],
            times: Vec::new(),
            stage: Stage::new(&rig.axes),
            first: None,
            moved: false,
        })
    }

    fn camera(&self, index: usize) -> PathBuf {
        self.folder.join(format!("mav0/cam{index}"))
    }

    fn note_pose(&mut self, pose: &RigPose) {
        let first = self.first.get_or_insert_with(|| pose.clone());
        let counts = |axes: &[AxisPosition]| -> Vec<f64> {
            self.rig.axes.iter().zip(axes).map(|(axis, at)| axis.counts_at(at.value())).collect()
        };
        let steps = counts(&first.axes).into_iter().zip(counts(&pose.axes));
        self.moved |= steps.into_iter().any(|(before, now)| (now - before).abs() > FLICKER);
    }

    /// Both files `sensor.yaml`, and sentences on what they do not say.
    fn sensors(&self) -> Result<([String; 2], Vec<String>), ExportError> {
        let left_from_right = self.first.as_ref().map(|pose| pose.left_from_right);
        if let [left, right] = &self.views[..] {
            let right_pose = left_from_right.map(|pose| *pose.isometry());
            let text = |view: &CameraView, pose: Option<Isometry3<f64>>| {
                let comment =
                    format!("pinhole view of {:.1} degrees to the front of the {} camera", view.field_deg(), view.side);
                Sensor::pinhole(&view.view).with_comment(comment).at(pose).text()
            };
            let left_pose = right_pose.map(|_| Isometry3::identity());
            return Ok(([text(left, left_pose), text(right, right_pose)], remarks(&self.rig)));
        }
        let (left, right) = (self.rig.left_camera, self.rig.right_camera);
        let written = |cameras: &Cameras| vergence_exchange::write(WriteFormat::TumVi, cameras);
        let text =
            |files: &[WrittenFile], index: usize| files.get(index).map(|file| file.text.clone()).unwrap_or_default();
        Ok(match left_from_right {
            Some(pose) => {
                let both = written(&Cameras { left, right: Some((right, pose)) })?;
                ([0, 1].map(|index| text(&both.files, index)), both.remarks)
            }
            None => {
                let [left, right] =
                    [written(&Cameras { left, right: None })?, written(&Cameras { left: right, right: None })?];
                ([text(&left.files, 0), text(&right.files, 0)], [left.remarks, right.remarks].concat())
            }
        })
    }

    /// Images in a second, from the first to the last exposure.
    fn rate(&self) -> Option<f64> {
        let [first, .., last] = self.times[..] else { return None };
        let seconds = last.checked_sub(first).filter(|time| *time > 0)? as f64 * 1e-9;
        Some((self.times.len() - 1) as f64 / seconds)
    }
}

impl Sink for Sequence {
    fn take(&mut self, taken: &Taken) -> Result<(), ExportError> {
        // Readers take images of one name for a pair: both have the time of the left one.
        let Some(ns) = taken.images.iter().flatten().map(|image| image.ns).next() else { return Ok(()) };
        for (index, stamped) in taken.images.iter().enumerate() {
            let Some(stamped) = stamped else { continue };
            let path = self.camera(index).join(format!("data/{ns}.png"));
            let view = self.views.get(index).map(|view| view.of(&stamped.image));
            write_image(&path, view.as_ref().unwrap_or(&stamped.image))?;
            // Writing to a text does not fail.
            _ = writeln!(self.images[index], "{ns},{ns}.png");
        }
        self.times.push(ns);
        if let ([Some(left), Some(right)], Some(pose)) = (&taken.images, &taken.pose) {
            self.note_pose(pose);
            self.stage.note([ns, left.ns, right.ns], &self.rig, pose);
        }
        Ok(())
    }

    fn finish(self: Box<Self>) -> Result<Vec<String>, ExportError> {
        let (sensors, mut warnings) = self.sensors()?;
        let rate = self.rate().map(|rate| format!("rate_hz: {rate:.4}\n")).unwrap_or_default();
        for (index, sensor) in sensors.iter().enumerate() {
            let folder = self.camera(index);
            write_whole(&folder.join("data.csv"), self.images[index].as_bytes())?;
            write_whole(&folder.join("sensor.yaml"), (sensor.clone() + &rate).as_bytes())?;
        }
        let stage = self.folder.join("mav0/stage0");
        write_whole(&stage.join("data.csv"), self.stage.csv().as_bytes())?;
        write_whole(&stage.join("sensor.yaml"), Stage::ABOUT.as_bytes())?;
        if !self.views.is_empty() {
            describe(&self.views, &self.folder)?;
        }
        if self.moved {
            warnings.push(
                "the cameras moved: T_BS of cam1 is that of the first exposure, mav0/stage0/data.csv has that of each"
                    .to_owned(),
            );
        }
        Ok(warnings)
    }
}

fn write_image(path: &Path, image: &image::RgbImage) -> Result<(), FileError> {
    let png = Png::of(image).map_err(|error| FileError::write(path, error))?;
    write_whole(path, &png.bytes)
}
