//! The corners of a calibration with their residuals and their place in the field.

use std::collections::BTreeSet;

use nalgebra::{Isometry3, Point3, Vector3};
use vergence_vision::{Camera, KannalaBrandt, OpenCvFisheye, Pixel, Point, UnitRay};

use crate::intrinsics::reproject;
use crate::{BoardView, Corner, ExtrinsicsCalibration, IntrinsicsCalibration, Side, StereoView};

/// One corner.
#[derive(Clone, Copy)]
pub(super) struct Sight {
    /// Index of its view in the list given.
    pub view: usize,
    /// Where the image shows it.
    pub seen: Pixel,
    /// From its reprojection to where it is seen, in pixels; `None` where there is no reprojection.
    pub error: Option<[f64; 2]>,
    /// Angle to the optical axis, in radians.
    pub theta: f64,
    /// Azimuth from right to down, in radians.
    pub phi: f64,
    /// Whether the calibration used it.
    pub used: bool,
}

impl Sight {
    fn new(lens: &OpenCvFisheye, view: usize, seen: Pixel, point: Option<Vector3<f64>>, used: bool) -> Self {
        let reprojected = point.and_then(|point| reproject(lens, &Point::<Camera>::from_mm(point)));
        let error = reprojected.map(|r| [seen.u - r.pixel[0], seen.v - r.pixel[1]]);
        let ray = point.and_then(UnitRay::<Camera>::new);
        let theta = ray.map_or(0.0, |ray| ray.angle_to_axis().rad());
        let phi = ((seen.v - lens.cy) / lens.fy).atan2((seen.u - lens.cx) / lens.fx);
        Self { view, seen, error: error.filter(|e| e.iter().all(|x| x.is_finite())), theta, phi, used }
    }

    pub fn length(&self) -> Option<f64> {
        self.error.map(|[u, v]| u.hypot(v))
    }
}

/// Every corner of the views that a calibration of one lens placed.
pub(super) fn of_intrinsics(calibration: &IntrinsicsCalibration, views: &[BoardView]) -> Vec<Sight> {
    let left_out: BTreeSet<_> = calibration.outliers.iter().map(|o| (o.view, o.corner)).collect();
    let height = height_mm(calibration, views);
    let placed = views.iter().zip(&calibration.views).enumerate();
    placed
        .filter_map(|(index, (view, figures))| {
            Some((index, view, *figures.pose.as_ref()?.camera_from_board.isometry()))
        })
        .flat_map(|(index, view, pose)| {
            let (height, left_out) = (&height, &left_out);
            view.corners.iter().enumerate().map(move |(place, corner)| {
                let [x, y] = corner.board_mm;
                let point = (pose * Point3::new(x, y, height([x, y]))).coords;
                let used = !left_out.contains(&(index, place));
                Sight::new(&calibration.opencv, index, corner.pixel, Some(point), used)
            })
        })
        .collect()
}

/// The height of the board over its plane, as in [`crate::BoardWarp`].
fn height_mm(calibration: &IntrinsicsCalibration, views: &[BoardView]) -> impl Fn([f64; 2]) -> f64 + use<> {
    let range = |axis: usize| {
        let places = || views.iter().flat_map(|view| &view.corners).map(|corner| corner.board_mm[axis]);
        (places().fold(f64::INFINITY, f64::min), places().fold(f64::NEG_INFINITY, f64::max))
    };
    let ranges = [range(0), range(1)];
    let warp = calibration.warp.map(|warp| [warp.along_x_mm, warp.along_y_mm]);
    move |place| {
        let bow = |axis: usize| {
            let (low, high) = ranges[axis];
            1.0 - ((2.0 * place[axis] - low - high) / (high - low)).powi(2)
        };
        warp.map_or(0.0, |[along_x, along_y]| along_x * bow(0) + along_y * bow(1))
    }
}

/// Every corner that one camera of a pair saw in the views that took part.
pub(super) fn of_extrinsics(calibration: &ExtrinsicsCalibration, views: &[StereoView], side: Side) -> Vec<Sight> {
    let left_out: BTreeSet<_> = calibration
        .outliers
        .iter()
        .filter(|outlier| outlier.side == side)
        .map(|outlier| key(&outlier.view, outlier.board_mm, outlier.pixel))
        .collect();
    let camera: &KannalaBrandt = if side == Side::Left { &calibration.left } else { &calibration.right };
    let lens = camera.to_opencv();
    let camera_from_left = match side {
        Side::Left => Isometry3::identity(),
        Side::Right => calibration.joint.left_from_right.isometry().inverse(),
    };
    let mut sights = Vec::new();
    for ((index, view), figures) in took_part(calibration, views).zip(&calibration.views) {
        let camera_from_board = camera_from_left * figures.left_from_board.isometry();
        let seen: &[Corner] = if side == Side::Left { &view.left.corners } else { &view.right.corners };
        sights.extend(seen.iter().map(|corner| {
            let [x, y] = corner.board_mm;
            let point = (camera_from_board * Point3::new(x, y, 0.0)).coords;
            let used = !left_out.contains(&key(&view.name, corner.board_mm, corner.pixel));
            Sight::new(&lens, index, corner.pixel, Some(point), used)
        }));
    }
    sights
}

/// The views that took part: those given, in their order, without those skipped.
fn took_part<'a>(
    calibration: &'a ExtrinsicsCalibration,
    views: &'a [StereoView],
) -> impl Iterator<Item = (usize, &'a StereoView)> {
    let mut wanted = calibration.views.iter().peekable();
    views.iter().enumerate().filter(move |(_, view)| wanted.next_if(|figures| figures.view == view.name).is_some())
}

fn key(view: &str, board_mm: [f64; 2], pixel: Pixel) -> (&str, [u64; 4]) {
    (view, [board_mm[0], board_mm[1], pixel.u, pixel.v].map(f64::to_bits))
}
