//! Board corners as CSV: `camera,file,frame,idx,x,y,bx_mm,by_mm`, a row for each corner.

use std::path::Path;

use serde::Deserialize;
use vergence_calibration::{BoardView, Corner};
use vergence_vision::Pixel;

use crate::failure::Failure;

/// One row. More columns may follow; a board height `bz_mm` must be zero.
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

/// A view and the frame it belongs to: views of two cameras with the same frame were taken together.
#[derive(Clone, Debug, PartialEq)]
pub struct FrameView {
    /// Which frame.
    pub frame: i64,
    /// What the camera saw.
    pub view: BoardView,
}

/// The views of `camera` in the file, in the order in which they first occur; without a name, of the only camera there is.
///
/// # Errors
/// Says which row is wrong, or which cameras there are.
pub fn read(path: &Path, camera: Option<&str>) -> Result<Vec<FrameView>, Failure> {
    let fail = |problem: String| Failure::input(path, problem);
    let mut reader = csv::Reader::from_path(path).map_err(|error| fail(error.to_string()))?;
    let mut views: Vec<FrameView> = Vec::new();
    let mut cameras: Vec<String> = Vec::new();
    for row in reader.deserialize() {
        let row: Row = row.map_err(|error| fail(error.to_string()))?;
        if !cameras.contains(&row.camera) {
            cameras.push(row.camera.clone());
        }
        if camera.is_some_and(|wanted| wanted != row.camera) {
            continue;
        }
        if row.bz_mm.abs() > 1e-9 {
            return Err(fail(format!("the board point of frame {} is {} mm off its plane", row.frame, row.bz_mm)));
        }
        let corner = Corner::new([row.bx_mm, row.by_mm], Pixel { u: row.x, v: row.y });
        match views.iter_mut().find(|known| known.frame == row.frame) {
            Some(known) => known.view.corners.push(corner),
            None => {
                let view = BoardView { name: row.file, corners: vec![corner] };
                views.push(FrameView { frame: row.frame, view });
            }
        }
    }
    match camera {
        None if cameras.len() > 1 => {
            Err(fail(format!("it has the cameras {}: choose one with --camera", cameras.join(", "))))
        }
        Some(wanted) if views.is_empty() => {
            Err(fail(format!("it has no camera '{wanted}', only {}", cameras.join(", "))))
        }
        _ if views.is_empty() => Err(fail("it has no corners".into())),
        _ => Ok(views),
    }
}
