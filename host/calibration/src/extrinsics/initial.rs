//! Starting values: target poses by each camera alone, and the relative pose that fits both sets of corners to each
//! other.

use nalgebra::{Isometry3, Point3, Vector2};
use vergence_targets::TargetView;
use vergence_vision::{Camera, KannalaBrandt, Left, Point, Right};

use crate::TargetShape;
use crate::arun::fit_rotation_translation;
use crate::extrinsics::Side;
use crate::extrinsics::outliers::OwnPoses;
use crate::extrinsics::stereo::{Lenses, Pair};
use crate::extrinsics::{ExtrinsicsError, SkippedView, StereoView};
use crate::planar_pose::{PoseError, target_pose};

/// A view whose target both cameras place.
pub(crate) struct PlacedView {
    /// Index of the view among those given.
    pub view: usize,
    pub left_from_target: Isometry3<f64>,
    pub right_from_target: Isometry3<f64>,
}

impl PlacedView {
    pub fn own_poses(&self) -> OwnPoses {
        [self.left_from_target, self.right_from_target]
    }
}

/// The target poses of all views that have one in both cameras; the others and why.
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
            [Ok(left_from_target), Ok(right_from_target)] => {
                placed.push(PlacedView { view: index, left_from_target, right_from_target });
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

fn pose(camera: &KannalaBrandt, seen: &TargetView) -> Result<Isometry3<f64>, PoseError> {
    target_pose(camera, seen).map(|pose| *pose.camera_from_target.isometry())
}

/// `left_from_right` that fits the corners as placed by the right camera to those placed by the left (K. Arun et al.,
/// 1987).
pub(crate) fn arun(views: &[StereoView], placed: &[PlacedView]) -> Result<Isometry3<f64>, ExtrinsicsError> {
    let mut pairs = Vec::new();
    for place in placed {
        let Some(view) = views.get(place.view) else { continue };
        for (_, corner) in view.corners() {
            let target = Point3::from(Vector2::from(corner.target_mm).push(0.0));
            let in_left = Point::<Left>::from_mm((place.left_from_target * target).coords);
            let in_right = Point::<Right>::from_mm((place.right_from_target * target).coords);
            pairs.push((in_left, in_right));
        }
    }
    let left_from_right = fit_rotation_translation(&pairs).map_err(|_| ExtrinsicsError::NotDetermined)?;
    Ok(*left_from_right.isometry())
}

/// `left_from_target` of each view: as the left or as the right camera places it, whichever reprojects better in both.
pub(crate) fn nearer_targets(
    lenses: Lenses,
    left_from_right: &Isometry3<f64>,
    views: &[StereoView],
    placed: &[PlacedView],
) -> Vec<Isometry3<f64>> {
    let pair = Pair { left_from_right: *left_from_right, lenses, shape: TargetShape::FLAT };
    let choose = |place: &PlacedView| {
        let by_right = left_from_right * place.right_from_target;
        let squares = |pose: &Isometry3<f64>| {
            let errors = views.get(place.view).map(|view| pair.errors_px(view, pose)).unwrap_or_default();
            errors.iter().map(|error| error * error).sum::<f64>()
        };
        if squares(&by_right) < squares(&place.left_from_target) { by_right } else { place.left_from_target }
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
