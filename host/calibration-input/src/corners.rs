//! Target corners in a CSV file with the columns `camera,file,frame,idx,x,y,bx_mm,by_mm`, one row for each corner.

use std::path::Path;

use serde::Deserialize;
use vergence_targets::{Corner, TargetView};
use vergence_vision::Pixel;

use crate::InputError;
use crate::csv_file::CsvFile;

/// One row. Other columns are ignored; a height `bz_mm` above the target must be zero.
#[derive(Deserialize)]
struct Row {
    camera: String,
    file: String,
    frame: i64,
    x: f64,
    y: f64,
    bx_mm: f64,
    by_mm: f64,
    #[serde(default)]
    bz_mm: f64,
}

/// A view and its frame number: views of two cameras with the same number were taken together.
#[derive(Clone, Debug, PartialEq)]
pub struct FrameView {
    /// Frame number.
    pub frame: i64,
    /// Corners that the camera saw.
    pub view: TargetView,
}

/// Reads the views of `camera`, in the order in which they first occur; without a name, of the only camera in the file.
///
/// # Errors
/// A row that cannot be read, by line; a camera that is not in the file.
pub fn read_corners(path: &Path, camera: Option<&str>) -> Result<Vec<FrameView>, InputError> {
    let file = CsvFile::read(path)?;
    let fail = |problem: String| file.wrong(problem);
    let mut reader = file.reader();
    let headers = reader.headers().map_err(|error| fail(error.to_string()))?.clone();
    let mut views: Vec<FrameView> = Vec::new();
    let mut cameras: Vec<String> = Vec::new();
    for record in reader.records() {
        let record = record.map_err(|error| file.unreadable(&error, &headers))?;
        let row: Row = record.deserialize(Some(&headers)).map_err(|error| file.unreadable(&error, &headers))?;
        if !cameras.contains(&row.camera) {
            cameras.push(row.camera.clone());
        }
        if camera.is_some_and(|wanted| wanted != row.camera) {
            continue;
        }
        if row.bz_mm.abs() > 1e-9 {
            let problem = format!("the target point is {} mm off the target's plane (bz_mm)", row.bz_mm);
            return Err(file.wrong_row(record.position(), problem));
        }
        let corner = Corner::new([row.bx_mm, row.by_mm], Pixel { u: row.x, v: row.y });
        match views.iter_mut().find(|known| known.frame == row.frame) {
            Some(known) => known.view.corners.push(corner),
            None => {
                let view = TargetView { name: row.file, corners: vec![corner] };
                views.push(FrameView { frame: row.frame, view });
            }
        }
    }
    match camera {
        _ if cameras.is_empty() => Err(fail("it has no corners".into())),
        None if cameras.len() > 1 => {
            Err(fail(format!("it has the cameras {}: choose one with --camera", cameras.join(", "))))
        }
        Some(wanted) if views.is_empty() => {
            Err(fail(format!("it has no camera '{wanted}', only {}", cameras.join(", "))))
        }
        _ => Ok(views),
    }
}
