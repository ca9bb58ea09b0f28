//! Stage poses that were recorded: a set folder, or a CSV file of corners and readings.

use std::collections::BTreeMap;
use std::path::Path;

use vergence_calibration::{StagePose, StereoView};
use vergence_protocol::AxisKind;
use vergence_rig::{AxisPosition, Rig, RigAxis};

use crate::cmd::board_options::BoardOptions;
use crate::cmd::calibrate::views::{PairImages, pairs_from_corners};
use crate::console::Console;
use crate::failure::Failure;
use crate::provenance::InputHash;

/// The file of a set that has the readings.
pub const POSES: &str = "poses.csv";
/// Its column with the folder of each stage pose.
pub const FOLDER: &str = "folder";
/// Readings that differ by fewer encoder steps are those of one stage pose.
const SAME_STEPS: f64 = 2.0;
/// A reading may lie outside the range by this share of it: stages stop near an end, not on it.
const OVERSHOOT: f64 = 0.01;

/// The column of an axis's readings.
pub fn column(axis: &RigAxis) -> String {
    match axis.kind {
        AxisKind::Linear => format!("{}_mm", axis.name),
        AxisKind::Rotary => format!("{}_deg", axis.name),
    }
}

/// The number in that column.
pub fn number(position: AxisPosition) -> f64 {
    match position {
        AxisPosition::Linear(length) => length.mm(),
        AxisPosition::Rotary(angle) => angle.deg(),
    }
}

/// The stage poses of a set folder.
///
/// # Errors
/// Says which file and what is wrong.
pub fn from_set(
    set: &Path,
    rig: &Rig,
    board: &BoardOptions,
    hash: &mut InputHash,
    console: Console,
) -> Result<Vec<StagePose>, Failure> {
    let path = set.join(POSES);
    hash.add(&path)?;
    let mut poses = Vec::new();
    let mut table = Table::open(&path, rig)?;
    let folder_column = table.column(FOLDER)?;
    while let Some(row) = table.next_row()? {
        let folder = set.join(row.get(folder_column).unwrap_or_default());
        let readings = table.readings(&row)?;
        let images = |side: &str| [folder.join(format!("{side}*")).to_string_lossy().into_owned()];
        let (left, right) = (images("left"), images("right"));
        let cameras = (&rig.left_camera, &rig.right_camera);
        let views = PairImages { left: &left, right: &right, board, cameras }.views(hash, console)?;
        poses.push(StagePose { readings, views });
    }
    Ok(poses)
}

/// The stage poses of a CSV file.
///
/// # Errors
/// Says which row and what is wrong.
pub fn from_corners(
    path: &Path,
    rig: &Rig,
    cameras: &[String],
    hash: &mut InputHash,
) -> Result<Vec<StagePose>, Failure> {
    let mut of_frame: BTreeMap<i64, Vec<AxisPosition>> = BTreeMap::new();
    let mut table = Table::open(path, rig)?;
    let frame_column = table.column("frame")?;
    while let Some(row) = table.next_row()? {
        let Some(frame) = row.get(frame_column).and_then(|text| text.trim().parse().ok()) else { continue };
        let readings = table.readings(&row)?;
        let known = of_frame.entry(frame).or_insert_with(|| readings.clone());
        if *known != readings {
            return Err(Failure::input(
                path,
                format!("frame {frame} has two different readings: number the frames through the whole file"),
            ));
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
    path: &'a Path,
    reader: csv::Reader<std::fs::File>,
    headers: csv::StringRecord,
    axes: Vec<(&'a RigAxis, usize)>,
}

impl<'a> Table<'a> {
    fn open(path: &'a Path, rig: &'a Rig) -> Result<Self, Failure> {
        let mut reader = csv::ReaderBuilder::new()
            .trim(csv::Trim::All)
            .from_path(path)
            .map_err(|error| Failure::input(path, error))?;
        let headers = reader.headers().map_err(|error| Failure::input(path, error))?.clone();
        let mut table = Self { path, reader, headers, axes: Vec::new() };
        table.axes =
            rig.axes.iter().map(|axis| Ok((axis, table.column(&column(axis))?))).collect::<Result<_, Failure>>()?;
        Ok(table)
    }

    fn column(&self, name: &str) -> Result<usize, Failure> {
        self.headers.iter().position(|header| header == name).ok_or_else(|| {
            Failure::input(self.path, format!("it has no column '{name}', only {}", self.headers.as_slice()))
        })
    }

    fn next_row(&mut self) -> Result<Option<csv::StringRecord>, Failure> {
        let mut row = csv::StringRecord::new();
        let more = self.reader.read_record(&mut row).map_err(|error| Failure::input(self.path, error))?;
        Ok(more.then_some(row))
    }

    fn readings(&self, row: &csv::StringRecord) -> Result<Vec<AxisPosition>, Failure> {
        let line = row.position().map_or(0, csv::Position::line);
        let reading = |(axis, index): &(&RigAxis, usize)| {
            let text = row.get(*index).unwrap_or_default();
            let fail = |problem: &str| {
                let name = column(axis);
                Failure::input(self.path, format!("line {line}: '{text}' in column {name} {problem}"))
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
