//! Covariances in the frame of a camera's rays: what a turn of the frame against the barrel leaves, and what it takes away.
#![allow(clippy::unwrap_used, reason = "a test may fail")]

use nalgebra::{DMatrix, Matrix3, RowVector3, SMatrix, Vector3};
use vergence_rig::{
    BENCH_TOML, CalibratedNumbers, Rig, RigCalibration, RigNumber, RigPose, common_turn_by_lens, even_directions,
};
use vergence_vision::{
    LENS_PARAMETERS, Left, Point, PointUncertainty, SHARED_PARAMETERS, SharedCovariance, Side, StereoPair,
};

/// Standard deviations of a lens without an axis: centre, decentring, thin prism.
const SIGMAS: [(usize, f64); 8] =
    [(2, 0.8), (3, 0.8), (10, 4e-4), (11, 4e-4), (12, 4e-4), (13, 4e-4), (14, 4e-4), (15, 4e-4)];
const STANDING: [f64; 2] = [145.0, 0.6];

/// The bench whose lenses are uncertain in these parameters.
fn uncertain(parameters: &[(usize, f64)]) -> Rig {
    let rig = Rig::from_toml(BENCH_TOML).unwrap();
    let lens = |side| parameters.iter().map(move |&(parameter, _)| RigNumber::Lens { side, parameter });
    let numbers: Vec<_> = [Side::Left, Side::Right].into_iter().flat_map(lens).collect();
    let covariance = DMatrix::from_fn(numbers.len(), numbers.len(), |row, column| {
        if row == column { parameters[row % parameters.len()].1.powi(2) } else { 0.0 }
    });
    let calibration = RigCalibration::Covariance(CalibratedNumbers::new(numbers, covariance).unwrap());
    Rig { calibration, ..rig }
}

/// The covariance as the numbers have it, in the frames of the barrels.
fn of_barrels(parameters: &[(usize, f64)]) -> SharedCovariance {
    let mut matrix = SMatrix::<f64, SHARED_PARAMETERS, SHARED_PARAMETERS>::zeros();
    for (parameter, sigma) in parameters {
        for first in [0, LENS_PARAMETERS] {
            matrix[(first + parameter, first + parameter)] = sigma * sigma;
        }
    }
    SharedCovariance::joint(matrix)
}

fn pair<'a>(rig: &'a Rig, pose: &RigPose) -> StereoPair<'a> {
    StereoPair { left: &rig.left_camera, right: &rig.right_camera, left_from_right: pose.left_from_right }
}

fn points() -> Vec<Point<Left>> {
    [[40.0, 20.0, 350.0], [-150.0, 80.0, 300.0], [200.0, -120.0, 260.0], [20.0, 300.0, 900.0]]
        .map(|at| Point::from_mm(Vector3::from(at)))
        .to_vec()
}

/// What is left is the turn about the axis, which rows of pixels fix.
#[test]
fn all_rays_together_do_not_turn() {
    let rig = uncertain(&SIGMAS);
    let lens = rig.lens_covariance(Side::Left).unwrap();
    let turn_by_lens = common_turn_by_lens(&rig.left_camera);
    let left = turn_by_lens * lens * turn_by_lens.transpose();
    let before = SMatrix::<f64, LENS_PARAMETERS, LENS_PARAMETERS>::from_fn(|row, column| {
        of_barrels(&SIGMAS).matrix()[(row, column)]
    });
    let turn = (turn_by_lens * before * turn_by_lens.transpose()).diagonal().map(f64::sqrt);
    assert!(turn.x > 3e-4 && turn.y > 3e-4, "the lens turns by {turn:?}");
    assert!(left.trace().sqrt() < 1e-2 * turn.norm(), "{} of {turn:?} are left", left.trace().sqrt());
}

/// Exactly: the point moves with the lens as it did, and turns back by what all rays turn.
#[test]
fn points_are_as_uncertain_as_after_all_rays_are_turned_back() {
    let rig = uncertain(&SIGMAS);
    let pose = rig.pose_at_values(&STANDING);
    let turn_by_lens = common_turn_by_lens(&rig.left_camera);
    for point in points() {
        let mut exact = PointUncertainty::of(&point, &pair(&rig, &pose), 0.0).unwrap();
        let stated = exact.covariance(&pose.shared);
        let mut by_left = exact.by_shared.fixed_columns_mut::<LENS_PARAMETERS>(0);
        by_left -= point.mm().cross_matrix() * turn_by_lens;
        let expected = exact.covariance(&of_barrels(&SIGMAS));
        assert!((stated - expected).norm() < 0.02 * expected.norm(), "{stated} {expected}");
    }
}

/// No turn of a frame changes a distance.
#[test]
fn distances_are_as_sure_in_either_frame() {
    let rig = uncertain(&SIGMAS);
    let pose = rig.pose_at_values(&STANDING);
    let points = points();
    let of = |point: &Point<Left>| PointUncertainty::of(point, &pair(&rig, &pose), 0.0).unwrap();
    for (one, other) in points.iter().zip(&points[1..]) {
        let way: RowVector3<f64> = (one.mm() - other.mm()).normalize().transpose();
        let (at_one, at_other) = (of(one), of(other));
        let variance = |shared: &SharedCovariance| {
            let across = at_one.covariance_with(&at_other, shared);
            let difference: Matrix3<f64> =
                at_one.covariance(shared) + at_other.covariance(shared) - across - across.transpose();
            (way * difference * way.transpose()).x
        };
        let (own, barrel) = (variance(&pose.shared), variance(&of_barrels(&SIGMAS)));
        assert!((own / barrel - 1.0).abs() < 0.02, "{own} {barrel}");
    }
}

/// Its axis is the frame of a symmetric lens, and of one whose decentring is known only in part.
#[test]
fn a_symmetric_lens_keeps_its_axis() {
    for known in [&SIGMAS[..2], &SIGMAS[..4]] {
        let rig = uncertain(known);
        assert_eq!(rig.pose_at_values(&STANDING).shared, of_barrels(known).with_pose(&nalgebra::Matrix6::zeros()));
    }
}

#[test]
fn directions_fill_the_measured_field_evenly() {
    let camera = Rig::from_toml(BENCH_TOML).unwrap().left_camera;
    let directions: Vec<_> = even_directions(&camera).collect();
    assert!(directions.iter().all(|ray| camera.is_measured(ray)));
    let lowest = camera.measured_field().rad().cos();
    let mean = directions.iter().map(|ray| ray.vector()).sum::<Vector3<f64>>() / directions.len() as f64;
    assert!((mean - Vector3::z() * 0.5 * (1.0 + lowest)).norm() < 0.01, "{mean}");
}
