//! Two pinhole cameras calibrated on undistorted pictures, and points by their disparity: ordinary stereo.

use nalgebra::{Isometry3, SVector, UnitQuaternion, Vector2, Vector3};
use vergence_calibration::schur_lm::{Equations, SchurOptions, SchurProblem, solve};
use vergence_targets::{Corner, Target};
use vergence_vision::{Camera, Left, Pixel, Point, Right, Transform, UnitRay, rectified};

/// Numbers of a lens: focal lengths and centre in pixels, and the first two terms of radial distortion (J. Bouguet, "Camera
/// calibration toolbox").
type Lens = SVector<f64, LENS>;
const LENS: usize = 6;
const POSE: usize = 6;
const SHARED: usize = 2 * LENS + POSE;

/// A pair of pinhole cameras.
#[derive(Clone, Debug)]
pub struct PinholePair {
    lenses: [Lens; 2],
    left_from_right: Isometry3<f64>,
}

/// A target that both cameras see: the places of its corners in both undistorted pictures.
#[derive(Clone, Debug)]
pub struct PinholeView {
    /// Start of the pose of the target.
    pub left_from_target: Transform<Camera, Target>,
    /// Corners in the left and in the right picture.
    pub corners: [Vec<Corner>; 2],
}

struct Problem<'a>(&'a [PinholeView]);

impl PinholePair {
    /// Both cameras and their pose by all corners together, each alike, from a start: both focal lengths, and the pose.
    pub fn calibrated(views: &[PinholeView], focal_px: [f64; 2], start: &Transform<Left, Right>) -> Self {
        let lens = |focal: f64| Lens::from([focal, focal, 0.0, 0.0, 0.0, 0.0]);
        let start = Self { lenses: focal_px.map(lens), left_from_right: *start.isometry() };
        let targets = views.iter().map(|view| *view.left_from_target.isometry()).collect();
        solve(&Problem(views), start, targets, &SchurOptions::default()).shared
    }

    /// The point of two places by their disparity in views along the baseline.
    pub fn point(&self, places: [Pixel; 2]) -> Option<Point<Left>> {
        let left = UnitRay::new(undistorted(&self.lenses[0], places[0]))?;
        let right = UnitRay::new(undistorted(&self.lenses[1], places[1]))?;
        Some(rectified(&left, &right, &Transform::from_isometry(self.left_from_right)).ok()?.point)
    }

    /// Where a corner appears in the picture of each camera.
    fn place(&self, camera: usize, left_from_target: &Isometry3<f64>, corner: &Corner) -> Vector2<f64> {
        let [x, y] = corner.target_mm;
        let in_left = left_from_target * nalgebra::Point3::new(x, y, 0.0);
        let seen = if camera == 0 { in_left } else { self.left_from_right.inverse_transform_point(&in_left) };
        distorted(&self.lenses[camera], seen.coords)
    }
}

fn distorted(lens: &Lens, at: Vector3<f64>) -> Vector2<f64> {
    let (x, y) = (at.x / at.z, at.y / at.z);
    let square = x * x + y * y;
    let larger = 1.0 + square * (lens[4] + square * lens[5]);
    Vector2::new(lens[0] * x * larger + lens[2], lens[1] * y * larger + lens[3])
}

/// The direction of a place, by fixed-point iteration.
fn undistorted(lens: &Lens, place: Pixel) -> Vector3<f64> {
    const STEPS: usize = 30;
    let (x, y) = ((place.u - lens[2]) / lens[0], (place.v - lens[3]) / lens[1]);
    let mut larger = 1.0;
    for _ in 0..STEPS {
        let square = (x * x + y * y) / (larger * larger);
        larger = 1.0 + square * (lens[4] + square * lens[5]);
    }
    Vector3::new(x / larger, y / larger, 1.0)
}

fn moved(pose: &Isometry3<f64>, step: &[f64]) -> Isometry3<f64> {
    let turn = UnitQuaternion::from_scaled_axis(Vector3::new(step[0], step[1], step[2]));
    let shift = Vector3::new(step[3], step[4], step[5]);
    Isometry3::from_parts((pose.translation.vector + shift).into(), turn * pose.rotation)
}

impl SchurProblem<POSE> for Problem<'_> {
    type Shared = PinholePair;
    type Block = Isometry3<f64>;

    fn shared_dimension(&self) -> usize {
        SHARED
    }

    fn block_residuals(
        &self,
        pair: &PinholePair,
        index: usize,
        block: &Isometry3<f64>,
        equations: &mut Equations<POSE>,
    ) {
        /// Of all derivatives: far above rounding, far below where places bend.
        const STEP: f64 = 1e-5;
        let change =
            |place: &dyn Fn(f64) -> Vector2<f64>| <[f64; 2]>::from((place(STEP) - place(-STEP)) / (2.0 * STEP));
        let unit = |component: usize, by: f64| {
            std::array::from_fn::<f64, SHARED, _>(|i| if i == component { by } else { 0.0 })
        };
        for (camera, corners) in self.0[index].corners.iter().enumerate() {
            // The steps of a view are few and those of its corners many.
            let pairs: Vec<[PinholePair; 2]> = (0..SHARED)
                .map(|component| [STEP, -STEP].map(|by| self.shared_plus(pair, &unit(component, by))))
                .collect();
            for corner in corners {
                let residual = pair.place(camera, block, corner) - Vector2::new(corner.pixel.u, corner.pixel.v);
                let shared: Vec<[f64; 2]> = pairs
                    .iter()
                    .map(|[more, less]| {
                        let change = more.place(camera, block, corner) - less.place(camera, block, corner);
                        (change / (2.0 * STEP)).into()
                    })
                    .collect();
                let by_block = std::array::from_fn(|component| {
                    change(&|by| pair.place(camera, &moved(block, &unit(component, by)), corner))
                });
                equations.add(&residual.into(), 1.0, &shared, &by_block);
            }
        }
    }

    fn shared_plus(&self, pair: &PinholePair, step: &[f64]) -> PinholePair {
        let lens = |of: usize| pair.lenses[of] + Lens::from_column_slice(&step[of * LENS..(of + 1) * LENS]);
        PinholePair { lenses: [lens(0), lens(1)], left_from_right: moved(&pair.left_from_right, &step[2 * LENS..]) }
    }

    fn block_plus(&self, block: &Isometry3<f64>, step: &SVector<f64, POSE>) -> Isometry3<f64> {
        moved(block, step.as_slice())
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used, reason = "a test may fail")]

    use vergence_sim::Random;

    use super::*;
    use crate::bench::TARGET;

    fn truth() -> PinholePair {
        let turn = UnitQuaternion::from_euler_angles(0.01, -0.08, 0.02);
        PinholePair {
            lenses: [
                Lens::from([601.0, 600.0, 3.0, -2.0, 0.01, -0.004]),
                Lens::from([598.0, 599.0, -1.0, 4.0, -0.012, 0.003]),
            ],
            left_from_right: Isometry3::from_parts(Vector3::new(144.0, 1.0, -3.0).into(), turn),
        }
    }

    #[test]
    fn exact_corners_give_the_pair_and_its_points_back() {
        let (truth, mut random) = (truth(), Random::new(4));
        let views: Vec<PinholeView> = (0..8)
            .map(|_| {
                let turn = UnitQuaternion::from_scaled_axis(random.vector(0.3));
                let at = Vector3::new(random.between(-60.0, 60.0), random.between(-90.0, 30.0), 340.0);
                let pose = Isometry3::from_parts(at.into(), turn);
                let corners = |camera: usize| -> Vec<Corner> {
                    let corner = |index| Corner::new(TARGET.corner_mm(index), Pixel { u: 0.0, v: 0.0 });
                    let corners = (0..TARGET.columns * TARGET.rows).map(corner);
                    corners
                        .map(|corner| {
                            let place = truth.place(camera, &pose, &corner);
                            Corner { pixel: Pixel { u: place.x, v: place.y }, ..corner }
                        })
                        .collect()
                };
                let near = moved(&pose, &[0.02, -0.01, 0.02, 3.0, -2.0, 5.0]);
                PinholeView { left_from_target: Transform::from_isometry(near), corners: [corners(0), corners(1)] }
            })
            .collect();
        let start = Transform::from_isometry(moved(&truth.left_from_right, &[0.01, 0.01, -0.01, 2.0, 1.0, 1.0]));
        let pair = PinholePair::calibrated(&views, [590.0, 610.0], &start);
        assert!((pair.left_from_right.translation.vector - truth.left_from_right.translation.vector).norm() < 1e-3);
        let at = Vector3::new(40.0, -30.0, 350.0);
        let places = [0, 1].map(|camera| {
            let seen = if camera == 0 { at } else { truth.left_from_right.inverse_transform_point(&at.into()).coords };
            let place = distorted(&truth.lenses[camera], seen);
            Pixel { u: place.x, v: place.y }
        });
        assert!((pair.point(places).unwrap().mm() - at).norm() < 1e-3);
    }
}
