//! Recorded stage poses: a set folder, or a CSV file of corners and encoder readings.

use std::collections::BTreeMap;
use std::path::Path;

use vergence_calibration::{StagePose, StereoView};
use vergence_protocol::AxisKind;
use vergence_rig::{AxisPosition, Rig, RigAxis};

use crate::cmd::calibrate::views::{PairPatterns, pairs_from_corners};
use crate::cmd::target_options::TargetOptions;
use crate::console::Console;
use crate::csv_file::CsvFile;
use crate::failure::Failure;
use crate::provenance::InputHash;

/// File of a set with the encoder readings.
pub const POSES: &str = "poses.csv";
/// Column of [`POSES`] with the folder of each stage pose.
pub const FOLDER: &str = "folder";
/// Largest difference between readings of one stage pose, in encoder steps.
const SAME_STEPS: f64 = 2.0;
/// Part of the range by which a reading may lie outside it: stages stop near an end, not on it.
const OVERSHOOT: f64 = 0.01;

/// Name of the column with the readings of an axis.
pub fn column(axis: &RigAxis) -> String {
    match axis.kind {
        AxisKind::Linear => format!("{}_mm", axis.name),
        AxisKind::Rotary => format!("{}_deg", axis.name),
    }
}

/// Value of a reading in its column, in millimetres or degrees.
pub fn number(position: AxisPosition) -> f64 {
    match position {
        AxisPosition::Linear(length) => length.mm(),
        AxisPosition::Rotary(angle) => angle.deg(),
    }
}

/// Reads the stage poses of a set folder.
///
/// # Errors
/// A file that cannot be used, by name, and by line in poses.csv.
pub fn from_set(
    set: &Path,
    rig: &Rig,
    target: &TargetOptions,
    hash: &mut InputHash,
    console: Console,
) -> Result<Vec<StagePose>, Failure> {
    let path = set.join(POSES);
    hash.add(&path)?;
    let mut poses = Vec::new();
    let file = CsvFile::read(&path)?;
    let table = Table::new(&file, rig)?;
    let folder_column = table.column(FOLDER)?;
    for row in table.rows()? {
        let folder = set.join(row.get(folder_column).unwrap_or_default());
        let readings = table.readings(&row)?;
        let images = |side: &str| [folder.join(format!("{side}*")).to_string_lossy().into_owned()];
        let (left, right) = (images("left"), images("right"));
        let cameras = (&rig.left_camera, &rig.right_camera);
        let views = PairPatterns { left: &left, right: &right, target, cameras }.views(hash, console)?.0;
        poses.push(StagePose { readings, views });
    }
    Ok(poses)
}

/// Reads the stage poses of a CSV file.
///
/// # Errors
/// A row that cannot be used, by line.
pub fn from_corners(
    path: &Path,
    rig: &Rig,
    cameras: &[String],
    hash: &mut InputHash,
) -> Result<Vec<StagePose>, Failure> {
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
    for (frame, view) in pairs_from_corners(path, cameras, hash)? {
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
    fn new(file: &'a CsvFile, rig: &'a Rig) -> Result<Self, Failure> {
        let headers = file.reader().headers().map_err(|error| file.wrong(error))?.clone();
        let mut table = Self { file, headers, axes: Vec::new() };
        table.axes =
            rig.axes.iter().map(|axis| Ok((axis, table.column(&column(axis))?))).collect::<Result<_, Failure>>()?;
        Ok(table)
    }

    fn column(&self, name: &str) -> Result<usize, Failure> {
        self.headers.iter().position(|header| header == name).ok_or_else(|| {
            let present = self.headers.iter().collect::<Vec<_>>().join(", ");
            self.file.wrong(format!("it has no column '{name}', only {present}"))
        })
    }

    fn rows(&self) -> Result<Vec<csv::StringRecord>, Failure> {
        let read = |row: Result<_, csv::Error>| row.map_err(|error| self.file.unreadable(&error, &self.headers));
        self.file.reader().into_records().map(read).collect()
    }

    fn readings(&self, row: &csv::StringRecord) -> Result<Vec<AxisPosition>, Failure> {
        let reading = |(axis, index): &(&RigAxis, usize)| {
            let text = row.get(*index).unwrap_or_default();
            let fail = |problem: &str| {
                self.file.wrong_row(row.position(), format!("'{text}' in column {} {problem}", column(axis)))
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
