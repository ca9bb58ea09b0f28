//! First values: each camera's board pose from its own bundle of rays, and Arun's fit between the two corner clouds.

use nalgebra::{Isometry3, Point3, Vector2};
use vergence_vision::{Camera, KannalaBrandt, Left, Point, Right};

use crate::arun::fit_rotation_translation;
use crate::board::BoardView;
use crate::extrinsics::Side;
use crate::extrinsics::gross::OwnPoses;
use crate::extrinsics::stereo::{Lenses, Pair};
use crate::extrinsics::{ExtrinsicsError, SkippedView, StereoView};
use crate::planar_pose::{PoseError, board_pose};

/// A view whose board both cameras place.
pub(crate) struct PlacedView {
    /// Index of the view among those given.
    pub view: usize,
    pub left_from_board: Isometry3<f64>,
    pub right_from_board: Isometry3<f64>,
}

impl PlacedView {
    pub fn own_poses(&self) -> OwnPoses {
        [self.left_from_board, self.right_from_board]
    }
}

/// The board poses of all views that have one in both cameras; the others and why.
pub(crate) fn place(
    left: &KannalaBrandt,
    right: &KannalaBrandt,
    views: &[StereoView],
) -> Result<(Vec<PlacedView>, Vec<SkippedView>), ExtrinsicsError> {
    let (mut placed, mut skipped) = (Vec::new(), Vec::new());
    for (index, view) in views.iter().enumerate() {
        let sides = [(Side::Left, left, &view.left), (Side::Right, right, &view.right)];
        let poses = sides.map(|(side, camera, seen)| pose(camera, seen).map_err(|reason| (side, reason)));
        match poses {
            [Ok(left_from_board), Ok(right_from_board)] => {
                placed.push(PlacedView { view: index, left_from_board, right_from_board });
            }
            [Err((side, reason)), _] | [_, Err((side, reason))] => match reason {
                PoseError::TooFewCorners(_) | PoseError::Degenerate => {
                    skipped.push(SkippedView { view: view.name.clone(), side, reason });
                }
                _ => return Err(ExtrinsicsError::View { view: view.name.clone(), side, reason }),
            },
        }
    }
    Ok((placed, skipped))
}

fn pose(camera: &KannalaBrandt, seen: &BoardView) -> Result<Isometry3<f64>, PoseError> {
    board_pose(camera, seen).map(|pose| *pose.camera_from_board.isometry())
}

/// Arun's fit between the corners as the left and as the right camera place them.
pub(crate) fn arun(views: &[StereoView], placed: &[PlacedView]) -> Result<Isometry3<f64>, ExtrinsicsError> {
    let mut pairs = Vec::new();
    for place in placed {
        let Some(view) = views.get(place.view) else { continue };
        for (_, corner) in view.corners() {
            let board = Point3::from(Vector2::from(corner.board_mm).push(0.0));
            let in_left = Point::<Left>::from_mm((place.left_from_board * board).coords);
            let in_right = Point::<Right>::from_mm((place.right_from_board * board).coords);
            pairs.push((in_left, in_right));
        }
    }
    let left_from_right = fit_rotation_translation(&pairs).map_err(|_| ExtrinsicsError::NotDetermined)?;
    Ok(*left_from_right.isometry())
}

/// `left_from_board` of each view: as the left or as the right camera places it, whichever reprojects better in both.
pub(crate) fn nearer_boards(
    lenses: Lenses,
    left_from_right: &Isometry3<f64>,
    views: &[StereoView],
    placed: &[PlacedView],
) -> Vec<Isometry3<f64>> {
    let pair = Pair { left_from_right: *left_from_right, lenses };
    let choose = |place: &PlacedView| {
        let by_right = left_from_right * place.right_from_board;
        let squares = |pose: &Isometry3<f64>| {
            let errors = views.get(place.view).map(|view| pair.errors_px(view, pose)).unwrap_or_default();
            errors.iter().map(|error| error * error).sum::<f64>()
        };
        if squares(&by_right) < squares(&place.left_from_board) { by_right } else { place.left_from_board }
    };
    placed.iter().map(choose).collect()
}

/// Whether each corner of `view` lies inside the valid cone of its lens.
pub(crate) fn inside(left: &KannalaBrandt, right: &KannalaBrandt, view: &StereoView) -> Vec<bool> {
    view.corners()
        .map(|(side, corner)| {
            let camera = if side == Side::Left { left } else { right };
            camera.unproject::<Camera>(corner.pixel).is_ok()
        })
        .collect()
}
