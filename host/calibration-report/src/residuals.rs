//! Observed corners of a calibration, with residuals and field angles.

use std::collections::BTreeSet;

use nalgebra::{Isometry3, Point3, Vector3};
use vergence_calibration::{
    ExtrinsicsCalibration, IntrinsicsCalibration, LensParameters, Side, StereoView, TargetShape, TargetWarp, reproject,
};
use vergence_targets::{Corner, TargetView};
use vergence_vision::{Camera, KannalaBrandt, OpenCvFisheye, Pixel, Point, UnitRay};

/// One observed corner.
#[derive(Clone, Copy)]
pub(crate) struct Observation {
    /// Index of its view.
    pub view: usize,
    /// Observed position in the image.
    pub observed: Pixel,
    /// From its reprojection to the observed position, in pixels; `None` without a reprojection.
    pub error: Option<[f64; 2]>,
    /// Angle to the optical axis, in radians.
    pub theta: f64,
    /// Azimuth from right to down, in radians.
    pub phi: f64,
    /// Whether the calibration used it.
    pub used: bool,
}

impl Observation {
    fn new(lens: LensParameters, view: usize, observed: Pixel, point: Option<Vector3<f64>>, used: bool) -> Self {
        let reprojected = point.and_then(|point| reproject(lens, &Point::<Camera>::from_mm(point)));
        let error = reprojected.map(|r| [observed.u - r.pixel[0], observed.v - r.pixel[1]]);
        let ray = point.and_then(UnitRay::<Camera>::new);
        let theta = ray.map_or(0.0, |ray| ray.angle_to_axis().rad());
        let OpenCvFisheye { fx, fy, cx, cy, .. } = lens.central;
        let phi = ((observed.v - cy) / fy).atan2((observed.u - cx) / fx);
        Self { view, observed, error: error.filter(|e| e.iter().all(|x| x.is_finite())), theta, phi, used }
    }

    pub fn length(&self) -> Option<f64> {
        self.error.map(|[u, v]| u.hypot(v))
    }
}

/// Every corner of the views that an intrinsics calibration used.
pub(crate) fn of_intrinsics(calibration: &IntrinsicsCalibration, views: &[TargetView]) -> Vec<Observation> {
    let left_out: BTreeSet<_> = calibration.outliers.iter().map(|o| (o.view, o.corner)).collect();
    let shape = shape(calibration.warp);
    let placed = views.iter().zip(&calibration.views).enumerate();
    placed
        .filter_map(|(index, (view, figures))| {
            Some((index, view, *figures.pose.as_ref()?.camera_from_target.isometry()))
        })
        .flat_map(|(index, view, pose)| {
            let left_out = &left_out;
            view.corners.iter().enumerate().map(move |(place, corner)| {
                let point = (pose * Point3::from(shape.point_mm(corner.target_mm))).coords;
                let used = !left_out.contains(&(index, place));
                Observation::new(calibration.lens(), index, corner.pixel, Some(point), used)
            })
        })
        .collect()
}

fn shape(warp: Option<TargetWarp>) -> TargetShape {
    warp.map_or(TargetShape::FLAT, |warp| warp.shape)
}

/// Every corner of one camera in the views that an extrinsics calibration used.
pub(crate) fn of_extrinsics(calibration: &ExtrinsicsCalibration, views: &[StereoView], side: Side) -> Vec<Observation> {
    let left_out: BTreeSet<_> = calibration
        .outliers
        .iter()
        .filter(|outlier| outlier.side == side)
        .map(|outlier| key(&outlier.view, outlier.target_mm, outlier.pixel))
        .collect();
    let camera: &KannalaBrandt = if side == Side::Left { &calibration.left } else { &calibration.right };
    let lens = LensParameters::of(camera);
    let camera_from_left = match side {
        Side::Left => Isometry3::identity(),
        Side::Right => calibration.joint.left_from_right.isometry().inverse(),
    };
    let shape = shape(calibration.warp);
    let mut observations = Vec::new();
    for ((index, view), figures) in took_part(calibration, views).zip(&calibration.views) {
        let camera_from_target = camera_from_left * figures.left_from_target.isometry();
        let observed: &[Corner] = if side == Side::Left { &view.left.corners } else { &view.right.corners };
        observations.extend(observed.iter().map(|corner| {
            let point = (camera_from_target * Point3::from(shape.point_mm(corner.target_mm))).coords;
            let used = !left_out.contains(&key(&view.name, corner.target_mm, corner.pixel));
            Observation::new(lens, index, corner.pixel, Some(point), used)
        }));
    }
    observations
}

/// The views that took part: those given, in their order, without those skipped.
fn took_part<'a>(
    calibration: &'a ExtrinsicsCalibration,
    views: &'a [StereoView],
) -> impl Iterator<Item = (usize, &'a StereoView)> {
    let mut wanted = calibration.views.iter().peekable();
    views.iter().enumerate().filter(move |(_, view)| wanted.next_if(|figures| figures.view == view.name).is_some())
}

fn key(view: &str, target_mm: [f64; 2], pixel: Pixel) -> (&str, [u64; 4]) {
    (view, [target_mm[0], target_mm[1], pixel.u, pixel.v].map(f64::to_bits))
}
