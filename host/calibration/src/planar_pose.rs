//! Pose of a planar target from the rays of one image.
//!
//! Each corner's bearing f and target position X satisfy a·HX = b·HX = 0 for two tangents a, b of f and the matrix H ~
//! `[r1 r2 t]` (the direct linear transform of R. Hartley and A. Zisserman, *Multiple View Geometry*, 2004, §4.1, on
//! bearings). H's sign follows from f·HX > 0, not from depths, and nothing is divided by z: a target beyond 90° is like
//! any other. A plane seen from afar has a second, mirrored pose that fits nearly as well (D. Oberkampf, D. DeMenthon
//! and L. Davis, "Iterative pose estimation using coplanar feature points", CVIU 63(3), 1996), so both are refined on
//! the reprojection and compared.

use std::cmp::Ordering;

use nalgebra::{
    Isometry3, Matrix3, Point3, Rotation3, SMatrix, SVector, Translation3, UnitQuaternion, Vector2, Vector3,
};
use vergence_targets::{Corner, Target, TargetView};
use vergence_vision::{Camera, KannalaBrandt, Transform};

use crate::arun::nearest_rotation;
use crate::reprojection::{Lens, POSE, moved, point_by_move};
use crate::schur_lm::{self, Equations, SchurOptions, SchurProblem};
use crate::{Loss, TargetShape};

/// Four points in general position determine the pose.
const FEWEST_CORNERS: usize = 4;
/// Least separation of the DLT's two smallest singular values, as a share of the largest.
const SEPARATION: f64 = 1e-7;

/// Pose of a target, from one image.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TargetPose {
    /// Pose of the target in the camera frame.
    pub camera_from_target: Transform<Camera, Target>,
    /// Distance between corners and reprojections, root mean square per corner in pixels.
    pub rms_px: f64,
    /// The same for the mirrored tilt if that is another local optimum: if it is close to `rms_px`, the image alone
    /// does not determine which way the target is tilted.
    pub other_tilt_rms_px: Option<f64>,
    /// Number of corners used.
    pub corners: usize,
    /// Number of corners outside the valid cone of the lens, which are left out.
    pub outside: usize,
}

/// Why an image does not determine the pose of a target.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum PoseError {
    /// Fewer corners than four inside the lens's valid cone.
    #[error("{0} usable corners; the pose of a target needs at least 4")]
    TooFewCorners(usize),
    /// A corner or pixel is infinite or not a number, or a relative sigma not a positive one.
    #[error("a corner is not a finite number, or its sigma is not positive")]
    NotFinite,
    /// One target corner is listed twice.
    #[error("the corner at ({x}, {y}) mm of the target is listed twice", x = .0[0], y = .0[1])]
    Duplicate([f64; 2]),
    /// All corners but at most one lie on a line of the target or of the image.
    #[error("the corners leave the pose open: they lie on one line")]
    Degenerate,
}

/// A corner's position on the target (mm) and its unit bearing in the camera frame.
struct Observation {
    target: Vector2<f64>,
    bearing: Vector3<f64>,
}

/// Pose of a flat target from the corners of one image, refined by reprojection.
///
/// # Errors [`PoseError`] if corners are too few, listed twice, not finite or on a line.
pub fn target_pose(camera: &KannalaBrandt, view: &TargetView) -> Result<TargetPose, PoseError> {
    target_pose_of(camera, view, &TargetShape::FLAT)
}

/// As [`target_pose`], of a target of this shape.
///
/// # Errors As [`target_pose`].
pub fn target_pose_of(camera: &KannalaBrandt, view: &TargetView, shape: &TargetShape) -> Result<TargetPose, PoseError> {
    check(&view.corners)?;
    let (inside, observations): (Vec<Corner>, Vec<Observation>) =
        view.corners.iter().filter_map(|corner| Some((*corner, Observation::through(camera, corner)?))).unzip();
    if observations.len() < FEWEST_CORNERS {
        return Err(PoseError::TooFewCorners(observations.len()));
    }
    let start = linear_pose(&observations).ok_or(PoseError::Degenerate)?;
    let lens = Lens::of(camera);
    let first = refined(&lens, (&inside, shape), start, Loss::Squares).ok_or(PoseError::Degenerate)?;
    let second = refined(&lens, (&inside, shape), other_tilt(&first.0, &observations), Loss::Squares);
    let ((pose, _), other) = match second {
        Some(second) if second.1 < first.1 => (second, Some(first)),
        second => (first, second),
    };
    let rms = |pose: &Isometry3<f64>| {
        let squares = errors_px(&lens, (&inside, shape), pose).iter().map(|error| error * error).sum::<f64>();
        (squares / inside.len() as f64).sqrt()
    };
    // If both starts end at the same optimum there is no other tilt.
    let distinct = other.filter(|(other, _)| pose.rotation.angle_to(&other.rotation) > 1e-4);
    Ok(TargetPose {
        camera_from_target: Transform::from_isometry(pose),
        rms_px: rms(&pose),
        other_tilt_rms_px: distinct.map(|(other, _)| rms(&other)),
        corners: inside.len(),
        outside: view.corners.len() - inside.len(),
    })
}

/// Refuses corners that are not finite or listed twice.
pub(crate) fn check(corners: &[Corner]) -> Result<(), PoseError> {
    if !corners.iter().all(Corner::is_usable) {
        return Err(PoseError::NotFinite);
    }
    let order = |a: &[f64; 2], b: &[f64; 2]| a.partial_cmp(b).unwrap_or(Ordering::Equal);
    let mut places: Vec<[f64; 2]> = corners.iter().map(|c| c.target_mm).collect();
    places.sort_by(order);
    match places.windows(2).find(|pair| order(&pair[0], &pair[1]).is_eq()) {
        Some(pair) => Err(PoseError::Duplicate(pair[0])),
        None => Ok(()),
    }
}

impl Observation {
    fn through(camera: &KannalaBrandt, corner: &Corner) -> Option<Self> {
        let bearing = camera.unproject::<Camera>(corner.pixel).ok()?.vector();
        Some(Self { target: Vector2::from(corner.target_mm), bearing })
    }
}

/// Pose by the direct linear transform. `None` if the corners do not determine it.
fn linear_pose(observations: &[Observation]) -> Option<Isometry3<f64>> {
    let (centre, scale) = normalisation(observations)?;
    let normalised = |observation: &Observation| ((observation.target - centre) / scale).push(1.0);
    let mut normal = SMatrix::<f64, 9, 9>::zeros();
    for observation in observations {
        let target = normalised(observation);
        for tangent in tangents(&observation.bearing) {
            let row = SVector::<f64, 9>::from_fn(|i, _| tangent[i % 3] * target[i / 3]);
            normal += row * row.transpose();
        }
    }
    let eigen = normal.symmetric_eigen();
    let mut order: Vec<usize> = (0..9).collect();
    order.sort_by(|&a, &b| eigen.eigenvalues[a].total_cmp(&eigen.eigenvalues[b]));
    // Eigenvalues of the normal matrix are squares of singular values.
    if eigen.eigenvalues[order[1]] <= SEPARATION * SEPARATION * eigen.eigenvalues[order[8]] {
        return None;
    }
    let solution = eigen.eigenvectors.column(order[0]);
    let homography = Matrix3::from_iterator(solution.iter().copied());

    let facing: f64 =
        observations.iter().map(|observation| observation.bearing.dot(&(homography * normalised(observation)))).sum();
    let [h1, h2, h3] = [0, 1, 2].map(|column| homography.column(column) * facing.signum());
    let length = 0.5 * (h1.norm() + h2.norm());
    let rotation =
        nearest_rotation(&Matrix3::from_columns(&[h1 / length, h2 / length, h1.cross(&h2) / (length * length)]))?;
    // h3 is the image of the target's centre, in units of `scale / length`.
    let origin = h3 * (scale / length) - rotation * centre.push(0.0);
    origin.iter().all(|x| x.is_finite()).then(|| Isometry3::from_parts(Translation3::from(origin), rotation))
}

/// Centre and root-mean-square radius of the target points.
fn normalisation(observations: &[Observation]) -> Option<(Vector2<f64>, f64)> {
    let count = observations.len() as f64;
    let centre = observations.iter().map(|s| s.target).sum::<Vector2<f64>>() / count;
    let square = observations.iter().map(|s| (s.target - centre).norm_squared()).sum::<f64>() / count;
    (square > 0.0).then(|| (centre, square.sqrt()))
}

/// Two unit vectors orthogonal to `bearing` and to each other.
fn tangents(bearing: &Vector3<f64>) -> [Vector3<f64>; 2] {
    let first = bearing.cross(&Vector3::ith(bearing.iamin(), 1.0)).normalize();
    [first, bearing.cross(&first)]
}

/// The mirrored pose: the target reflected in the plane through its centre orthogonal to the line of sight, and its
/// normal reversed to make a rotation of the reflection.
fn other_tilt(pose: &Isometry3<f64>, observations: &[Observation]) -> Isometry3<f64> {
    let Some((centre, _)) = normalisation(observations) else { return *pose };
    let middle = (pose * Point3::from(centre.push(0.0))).coords;
    let Some(sight) = middle.try_normalize(0.0) else { return *pose };
    let reflection = Matrix3::identity() - 2.0 * sight * sight.transpose();
    let turned = reflection
        * pose.rotation.to_rotation_matrix().into_inner()
        * Matrix3::from_diagonal(&Vector3::new(1.0, 1.0, -1.0));
    let rotation = UnitQuaternion::from_rotation_matrix(&Rotation3::from_matrix_unchecked(turned));
    Isometry3::from_parts(Translation3::from(middle - rotation * centre.push(0.0)), rotation)
}

/// Local optimum of the reprojection near `start`, and its cost. `None` if a corner cannot be projected at the start.
pub(crate) fn refined(
    lens: &Lens,
    (corners, shape): (&[Corner], &TargetShape),
    start: Isometry3<f64>,
    loss: Loss,
) -> Option<(Isometry3<f64>, f64)> {
    let options = SchurOptions { loss, ..SchurOptions::default() };
    let solution = schur_lm::solve(&OneTarget { lens, corners, shape }, (), vec![start], &options);
    let pose = solution.blocks.into_iter().next()?;
    solution.cost.is_finite().then_some((pose, 2.0 * solution.cost))
}

/// Distance in pixels of each corner from its reprojection with the target at `camera_from_target`; infinite if it
/// cannot be projected.
pub(crate) fn errors_px(
    lens: &Lens,
    (corners, shape): (&[Corner], &TargetShape),
    camera_from_target: &Isometry3<f64>,
) -> Vec<f64> {
    let error = |corner: &Corner| {
        let point = camera_from_target * Point3::from(shape.point_mm(corner.target_mm));
        let projection = lens.project(&point.coords)?;
        Some((projection.pixel - Vector2::new(corner.pixel.u, corner.pixel.v)).norm())
    };
    corners.iter().map(|corner| error(corner).unwrap_or(f64::INFINITY)).collect()
}

/// Least-squares problem of one target's pose before a known lens.
struct OneTarget<'a> {
    lens: &'a Lens,
    corners: &'a [Corner],
    shape: &'a TargetShape,
}

impl SchurProblem<POSE> for OneTarget<'_> {
    type Shared = ();
    type Block = Isometry3<f64>;

    fn shared_dimension(&self) -> usize {
        0
    }

    fn block_residuals(&self, (): &(), _: usize, pose: &Isometry3<f64>, equations: &mut Equations<POSE>) {
        for corner in self.corners {
            let turned = pose.rotation * self.shape.point_mm(corner.target_mm);
            let Some(projection) = self.lens.project(&(turned + pose.translation.vector)) else {
                // An infinite cost makes the solver refuse this step.
                equations.add(&[f64::INFINITY; 2], 1.0, &[], &[[0.0; 2]; POSE]);
                continue;
            };
            let error = projection.pixel - Vector2::new(corner.pixel.u, corner.pixel.v);
            let by_pose = projection.by_point * point_by_move(&turned);
            equations.add(&error.into(), corner.relative_sigma, &[], &by_pose.into());
        }
    }

    fn shared_plus(&self, (): &(), _: &[f64]) {}

    fn block_plus(&self, pose: &Isometry3<f64>, step: &SVector<f64, POSE>) -> Isometry3<f64> {
        moved(pose, step)
    }
}
