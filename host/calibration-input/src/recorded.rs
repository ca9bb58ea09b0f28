//! Recorded stage poses: a set folder, or a CSV file of corners and encoder readings.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use vergence_calibration::{StagePose, StereoView};
use vergence_calibration_report::LeftOut;
use vergence_protocol::AxisKind;
use vergence_rig::{AxisPosition, Rig, RigAxis};
use vergence_targets::TargetKind;

use crate::InputError;
use crate::csv_file::CsvFile;
use crate::input_hash::InputHash;
use crate::views::{PairImages, PairLenses, PairMasks, ViewEvent, pairs_in_corners};

/// File of a set with the encoder readings.
pub const POSES: &str = "poses.csv";
/// Column of [`POSES`] with the folder of each stage pose.
pub const FOLDER: &str = "folder";
/// Largest difference between readings of one stage pose, in encoder steps.
const SAME_STEPS: f64 = 2.0;
/// Part of the range by which a reading may lie outside it: stages stop near an end, not on it.
const OVERSHOOT: f64 = 0.01;

/// The views of stage poses, and those left out.
pub type StageViews = (Vec<StagePose>, Vec<LeftOut>);

/// The stage poses of a set folder: the encoder readings of each, and the folder of its images.
pub struct RecordedSet(Vec<(Vec<AxisPosition>, PathBuf)>);

impl RecordedSet {
    /// Reads poses.csv of the folder `set`, and adds it to `hash`.
    ///
    /// # Errors
    /// [`InputError`] where the file cannot be used, by line.
    pub fn read(set: &Path, rig: &Rig, hash: &mut InputHash) -> Result<Self, InputError> {
        let path = set.join(POSES);
        hash.add(&path)?;
        let file = CsvFile::read(&path)?;
        let table = Table::new(&file, rig)?;
        let folder = table.column(FOLDER)?;
        let pose = |row: csv::StringRecord| Ok((table.readings(&row)?, set.join(row.get(folder).unwrap_or_default())));
        table.rows()?.into_iter().map(pose).collect::<Result<_, InputError>>().map(Self)
    }

    /// Looks for the target in the images of each stage pose, and adds them to `hash`; also returns the views left out. `tell` is
    /// called with each event.
    ///
    /// # Errors
    /// [`InputError`] where images cannot be used; those of `tell`.
    pub fn stage_poses<E: From<InputError>>(
        self,
        target: &TargetKind,
        seen: (PairLenses<'_>, PairMasks<'_>),
        hash: &mut InputHash,
        tell: &mut impl FnMut(ViewEvent<'_>) -> Result<(), E>,
    ) -> Result<StageViews, E> {
        let (mut poses, mut left_out) = (Vec::new(), Vec::new());
        for (readings, folder) in self.0 {
            let images = |side: &str| [folder.join(format!("{side}*")).to_string_lossy().into_owned()];
            let (left, right) = (images("left"), images("right"));
            let found = PairImages::named([&left, &right], tell)?.views(target, seen, hash, tell)?;
            poses.push(StagePose { readings, views: found.views });
            let name = folder.file_name().unwrap_or_default().to_string_lossy().into_owned();
            let of_folder = |one: LeftOut| LeftOut { view: format!("{name}/{}", one.view), ..one };
            left_out.extend(found.left_out.into_iter().map(of_folder));
        }
        Ok((poses, left_out))
    }
}

/// Reads the stage poses of a CSV file.
///
/// # Errors
/// A row that cannot be used, by line.
pub fn stage_poses_in_corners(
    path: &Path,
    rig: &Rig,
    cameras: &[String],
    hash: &mut InputHash,
) -> Result<Vec<StagePose>, InputError> {
    let mut of_frame: BTreeMap<i64, Vec<AxisPosition>> = BTreeMap::new();
    let file = CsvFile::read(path)?;
    let table = Table::new(&file, rig)?;
    let frame_column = table.column("frame")?;
    for row in table.rows()? {
        let Some(frame) = row.get(frame_column).and_then(|text| text.trim().parse().ok()) else { continue };
        let readings = table.readings(&row)?;
        let known = of_frame.entry(frame).or_insert_with(|| readings.clone());
        if *known != readings {
            let problem = format!("frame {frame} has two different readings: number the frames through the whole file");
            return Err(file.wrong_row(row.position(), problem));
        }
    }
    let mut poses: Vec<StagePose> = Vec::new();
    for (frame, view) in pairs_in_corners(path, cameras, hash)? {
        let Some(readings) = of_frame.get(&frame) else { continue };
        add(&mut poses, rig, readings, view);
    }
    Ok(poses)
}

fn add(poses: &mut Vec<StagePose>, rig: &Rig, readings: &[AxisPosition], view: StereoView) {
    let same = |pose: &&mut StagePose| {
        let off = |((axis, a), b): ((&RigAxis, &AxisPosition), &AxisPosition)| {
            (a.value() - b.value()).abs() < SAME_STEPS * axis.value_per_count()
        };
        rig.axes.iter().zip(&pose.readings).zip(readings).all(off)
    };
    match poses.iter_mut().find(same) {
        Some(pose) => pose.views.push(view),
        None => poses.push(StagePose { readings: readings.to_vec(), views: vec![view] }),
    }
}

/// A CSV file with a column for the readings of every axis.
struct Table<'a> {
    file: &'a CsvFile,
    headers: csv::StringRecord,
    axes: Vec<(&'a RigAxis, usize)>,
}

impl<'a> Table<'a> {
    fn new(file: &'a CsvFile, rig: &'a Rig) -> Result<Self, InputError> {
        let headers = file.reader().headers().map_err(|error| file.wrong(error))?.clone();
        let mut table = Self { file, headers, axes: Vec::new() };
        table.axes =
            rig.axes.iter().map(|axis| Ok((axis, table.column(&axis.column())?))).collect::<Result<_, InputError>>()?;
        Ok(table)
    }

    fn column(&self, name: &str) -> Result<usize, InputError> {
        self.headers.iter().position(|header| header == name).ok_or_else(|| {
            let present = self.headers.iter().collect::<Vec<_>>().join(", ");
            self.file.wrong(format!("it has no column '{name}', only {present}"))
        })
    }

    fn rows(&self) -> Result<Vec<csv::StringRecord>, InputError> {
        let read = |row: Result<_, csv::Error>| row.map_err(|error| self.file.unreadable(&error, &self.headers));
        self.file.reader().into_records().map(read).collect()
    }

    fn readings(&self, row: &csv::StringRecord) -> Result<Vec<AxisPosition>, InputError> {
        let reading = |(axis, index): &(&RigAxis, usize)| {
            let text = row.get(*index).unwrap_or_default();
            let fail = |problem: &str| {
                self.file.wrong_row(row.position(), format!("'{text}' in column {} {problem}", axis.column()))
            };
            let value: f64 =
                text.parse().ok().filter(|v: &f64| v.is_finite()).ok_or_else(|| fail("is not a number"))?;
            let position = match axis.kind {
                AxisKind::Linear => AxisPosition::Linear(vergence_vision::Length::from_mm(value)),
                AxisKind::Rotary => AxisPosition::Rotary(vergence_vision::Angle::from_deg(value)),
            };
            let [low, high] = axis.range.map(AxisPosition::value);
            let margin = OVERSHOOT * (high - low);
            if (low - margin..=high + margin).contains(&position.value()) {
                Ok(position)
            } else {
                let [low, high] = axis.range;
                Err(fail(&format!("is outside the range of the axis, {low} to {high}")))
            }
        };
        self.axes.iter().map(reading).collect()
    }
}
