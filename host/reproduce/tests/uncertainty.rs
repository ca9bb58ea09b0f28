//! Covariances from pixels, lenses and pose: derivatives against differences, and predicted against sampled errors.

#![allow(clippy::unwrap_used, reason = "helpers of tests may panic as tests do")]

mod common;

use common::{Gaussian, around, left_from_middle, left_from_right, lens, see};
use nalgebra::{Matrix3, Matrix3x2, Matrix6, SMatrix, SVector, UnitQuaternion, Vector3};
use vergence_vision::{
    Angle, Asymmetry, Camera, ImageSize, KannalaBrandt, Kernel, LENS_PARAMETERS, Left, OpenCvFisheye, Pixel, PixelPair,
    Point, PointUncertainty, Pupil, Right, SHARED_PARAMETERS, SharedCovariance, StereoPair, Transform, UnitRay,
    covariance,
};

const SIZE: ImageSize = ImageSize { width: 2080, height: 2080 };
/// Index of the first parameter of the pose.
const POSE: usize = 2 * LENS_PARAMETERS;

type Shared = SVector<f64, SHARED_PARAMETERS>;

/// Lens parameters in the order of calibrations, and the error of each in pixels or without unit.
const LENS: [f64; LENS_PARAMETERS] = [
    560.0, 561.0, 1039.5, 1039.5, 0.01, -0.004, 0.001, -0.0002, 2.0, 0.3, 4e-4, -7e-4, 5e-4, -2e-4, 8e-4, 1e-4, -4e-5,
    3e-6, 1e-4, -5e-5,
];
const LENS_SIGMA: [f64; LENS_PARAMETERS] = [
    0.05, 0.05, 0.04, 0.04, 2e-4, 3e-4, 2e-4, 5e-5, 0.02, 0.02, 2e-5, 2e-5, 2e-5, 1e-5, 2e-5, 1e-5, 1e-6, 3e-7, 1e-5,
    1e-5,
];
/// Index of the first of the further radial terms.
const FURTHER: usize = 16;
const POSE_SIGMA: [f64; 6] = [2e-4, 2e-4, 2e-4, 0.05, 0.05, 0.05];

fn lens_of(parameters: &[f64]) -> KannalaBrandt {
    let [fx, fy, cx, cy, k1, k2, k3, k4, e0, e1, p1, p2, s0, s1, s2, s3, k5, k6, p3, p4]: [f64; LENS_PARAMETERS] =
        parameters.try_into().unwrap();
    let camera = OpenCvFisheye { fx, fy, cx, cy, k: [k1, k2, k3, k4] };
    let central = KannalaBrandt::from_opencv_with(camera, [k5, k6], Angle::from_deg(99.0), SIZE).unwrap();
    let moving = central.with_pupil(Pupil::from_mm([e0, e1])).unwrap();
    moving.with_asymmetry(Asymmetry::from_array([p1, p2, s0, s1, s2, s3, p3, p4])).unwrap()
}

/// Lenses and pose with `error` added to all shared parameters.
fn disturbed(separation: f64, error: &Shared) -> (KannalaBrandt, KannalaBrandt, Transform<Left, Right>) {
    let lens = |first: usize| lens_of(&std::array::from_fn::<_, LENS_PARAMETERS, _>(|i| LENS[i] + error[first + i]));
    let exact = left_from_right(separation);
    let turn = UnitQuaternion::from_scaled_axis(error.fixed_rows::<3>(POSE).into_owned());
    let shift = error.fixed_rows::<3>(POSE + 3).into_owned();
    (lens(0), lens(LENS_PARAMETERS), Transform::new(turn * exact.rotation(), exact.origin().mm() + shift))
}

fn triangulated(kernel: &Kernel, pixels: &PixelPair, separation: f64, error: &Shared) -> Vector3<f64> {
    let (left, right, left_from_right) = disturbed(separation, error);
    let pair = StereoPair { left: &left, right: &right, left_from_right };
    kernel.triangulate(pixels, &pair).unwrap().point.mm()
}

/// The pseudo-intersection, and an edge far from the normal of the epipolar plane.
fn kernels() -> [Kernel; 2] {
    [Kernel::PseudoIntersection, Kernel::EdgePlane(UnitRay::new(Vector3::new(0.5, 1.0, 0.4)).unwrap())]
}

#[test]
fn lens_derivatives_agree_with_differences() {
    let lens = lens_of(&LENS);
    for (theta, phi) in [(0.0, 0.0), (1e-3, 2.0), (0.7, -1.0), (1.5, 3.0), (1.7, 0.4)] {
        let ray_at = |theta: f64, phi: f64| {
            let (s, c) = f64::sin_cos(theta);
            UnitRay::<Camera>::new(Vector3::new(s * phi.cos(), s * phi.sin(), c)).unwrap()
        };
        let ray = ray_at(theta, phi);
        let pixel = lens.project(&ray).unwrap();
        let (by_ray, by_pixel) = (lens.pixel_by_ray(&ray), lens.ray_by_pixel(&ray));
        assert!((by_ray * by_pixel - SMatrix::<f64, 2, 2>::identity()).amax() < 1e-12);
        let h = 1e-4;
        let moved =
            |du: f64, dv: f64| lens.unproject::<Camera>(Pixel { u: pixel.u + du, v: pixel.v + dv }).unwrap().vector();
        let by_u = (moved(h, 0.0) - moved(-h, 0.0)) / (2.0 * h);
        let by_v = (moved(0.0, h) - moved(0.0, -h)) / (2.0 * h);
        assert!((by_pixel.column(0) - by_u).amax() < 1e-10, "{theta}");
        assert!((by_pixel.column(1) - by_v).amax() < 1e-10, "{theta}");
        let by_lens = lens.pixel_by_lens(&ray);
        for i in 0..LENS_PARAMETERS {
            // Pixels are linear in the further terms, which hardly move them near the axis.
            let step = if i < FURTHER { 1e-2 * LENS_SIGMA[i] } else { 1e-6 };
            let seen = |sign: f64| {
                let mut parameters = LENS;
                parameters[i] += sign * step;
                lens_of(&parameters).project(&ray).unwrap()
            };
            let (above, below) = (seen(1.0), seen(-1.0));
            let expected = [(above.u - below.u) / (2.0 * step), (above.v - below.v) / (2.0 * step)];
            for (row, expected) in expected.iter().enumerate() {
                assert!((by_lens[(row, i)] - expected).abs() < 1e-5 * expected.abs().max(1.0), "{i} at {theta}");
            }
        }
    }
}

#[test]
fn the_derivative_by_shared_errors_agrees_with_differences() {
    let places = [(0.0, 0.0, 0.0), (0.0, 40.0, 20.0), (120.0, 25.0, -50.0)];
    for (kernel, (separation, azimuth, elevation)) in kernels().into_iter().flat_map(|k| places.map(|place| (k, place)))
    {
        let (left, right, pose) = disturbed(separation, &Shared::zeros());
        let pair = StereoPair { left: &left, right: &right, left_from_right: pose };
        let truth = left_from_middle(separation) * Point::from_mm(around(500.0, azimuth, elevation));
        let pixels = see(&pair, &truth).unwrap();
        let uncertainty = PointUncertainty::by(&kernel, &truth, &pair, 0.1).unwrap();
        for i in 0..SHARED_PARAMETERS {
            let step = 0.1 * if i < POSE { LENS_SIGMA[i % LENS_PARAMETERS] } else { POSE_SIGMA[i - POSE] };
            let found = uncertainty.by_shared.column(i);
            // The further terms hardly move points near the axis, and those at the rim by kilometres for one.
            let is_further = i < POSE && i % LENS_PARAMETERS >= FURTHER;
            let step = if is_further { f64::min(1e-5, 1e-3 / found.norm()) } else { step };
            let error = |sign: f64| Shared::from_fn(|row, _| if row == i { sign * step } else { 0.0 });
            let [above, below] = [1.0, -1.0].map(|sign| triangulated(&kernel, &pixels, separation, &error(sign)));
            let expected = (above - below) / (2.0 * step);
            assert!((found - expected).norm() < 1e-4 * expected.norm().max(1e-3), "{kernel} {i}: {found} {expected}");
        }
    }
}

/// For an equidistant lens on its axis, where a pixel is the same angle in all directions.
#[test]
fn the_closed_form_is_the_special_case_of_isotropic_rays() {
    let lens = lens(0.0);
    let turned = left_from_right(-20.0);
    let pair = StereoPair { left: &lens, right: &lens, left_from_right: turned };
    // The axes cross at 411 mm.
    let truth = Point::from_mm(Vector3::z() * (145.0 / 2.0 / 10f64.to_radians().sin()));
    let closed = covariance(&truth, &turned.origin(), Angle::from_rad(0.3 / 560.0)).unwrap();
    let full = PointUncertainty::of(&truth, &pair, 0.3).unwrap();
    assert!((full.from_pixels - closed).amax() < 1e-9 * closed.amax());
    assert_eq!(full.covariance(&SharedCovariance::exact()), full.from_pixels);
}

#[test]
fn there_is_no_uncertainty_on_the_baseline() {
    let lens = lens(0.0);
    let pair = StereoPair { left: &lens, right: &lens, left_from_right: left_from_right(0.0) };
    for place in [Vector3::new(300.0, 0.0, 0.0), Vector3::zeros(), Vector3::new(f64::NAN, 0.0, 1.0)] {
        assert_eq!(PointUncertainty::of(&Point::from_mm(place), &pair, 0.1), None);
    }
    assert_eq!(PointUncertainty::of(&Point::from_mm(Vector3::z()), &pair, f64::NAN), None);
}

/// A correlated covariance of all shared parameters.
fn shared_covariance() -> SharedCovariance {
    let mut gaussian = Gaussian(99);
    let mixed = SMatrix::<f64, SHARED_PARAMETERS, SHARED_PARAMETERS>::from_fn(|i, j| {
        if i == j { 1.0 } else { 0.15 * gaussian.normal() }
    });
    let sigma = Shared::from_fn(|i, _| if i < POSE { LENS_SIGMA[i % LENS_PARAMETERS] } else { POSE_SIGMA[i - POSE] });
    let factor = SMatrix::from_diagonal(&sigma) * mixed;
    SharedCovariance::joint(factor * factor.transpose())
}

/// Two points of each sample share the sample's lenses and pose: 6 numbers, whose normalised error squared has mean 6
/// and variance 12. Its mean over the samples stays within four sigma, which a missing correlation would not.
#[test]
fn sampled_errors_agree_with_the_full_covariance_of_two_points() {
    const SAMPLES: u32 = 4000;
    const PIXEL_SIGMA: f64 = 0.1;
    for separation in [0.0, 120.0] {
        let shared = shared_covariance();
        let factor = shared.matrix().cholesky().unwrap().l();
        let (left, right, pose) = disturbed(separation, &Shared::zeros());
        let pair = StereoPair { left: &left, right: &right, left_from_right: pose };
        let truths = [(350.0, 0.0, 0.0), (380.0, 20.0, 10.0)]
            .map(|(range, az, el)| left_from_middle(separation) * Point::from_mm(around(range, az, el)));
        let pixels = truths.map(|truth| see(&pair, &truth).unwrap());
        let [first, second] = truths.map(|truth| PointUncertainty::of(&truth, &pair, PIXEL_SIGMA).unwrap());
        let mut covariance = Matrix6::zeros();
        let mut put =
            |i: usize, j: usize, block: Matrix3<f64>| covariance.fixed_view_mut::<3, 3>(3 * i, 3 * j).copy_from(&block);
        put(0, 0, first.covariance(&shared));
        put(1, 1, second.covariance(&shared));
        put(0, 1, first.covariance_with(&second, &shared));
        put(1, 0, second.covariance_with(&first, &shared));
        let information = covariance.try_inverse().unwrap();

        let mut gaussian = Gaussian(5);
        let (mut joint, mut single) = (0.0, 0.0);
        for _ in 0..SAMPLES {
            let error = factor * Shared::from_fn(|_, _| gaussian.normal());
            let errors = Matrix3x2::from_columns(&[0, 1].map(|i| {
                let noisy = PixelPair {
                    left: gaussian.noisy(pixels[i].left, PIXEL_SIGMA),
                    right: gaussian.noisy(pixels[i].right, PIXEL_SIGMA),
                };
                triangulated(&Kernel::PseudoIntersection, &noisy, separation, &error) - truths[i].mm()
            }));
            let both = SVector::<f64, 6>::from_column_slice(errors.as_slice());
            joint += both.dot(&(information * both));
            let one = both.fixed_rows::<3>(0);
            single += one.dot(&(first.covariance(&shared).try_inverse().unwrap() * one));
        }
        let bound = |degrees: f64| 4.0 * (2.0 * degrees / f64::from(SAMPLES)).sqrt();
        let (joint, single) = (joint / f64::from(SAMPLES), single / f64::from(SAMPLES));
        assert!((joint - 6.0).abs() < bound(6.0), "{separation}: {joint}");
        assert!((single - 3.0).abs() < bound(3.0), "{separation}: {single}");
    }
}

/// Sampled errors of points on an edge: their normalised error squared has mean 3 with the covariance of the edge's own
/// plane, and not with that of the pseudo-intersection. The range of a vertical edge 40° aside and 20° up is less
/// certain by what an independent simulation in numpy found, 2.79 against 2.62 mm.
#[test]
fn an_edge_plane_states_its_own_covariance() {
    const SAMPLES: u32 = 8000;
    let lens = lens(0.0);
    let vertical = |separation: f64| left_from_middle(separation).rotation() * Vector3::y();
    let leaning = Vector3::new(0.6, 1.0, 0.3);
    let cases = [(0.0, 40.0, 20.0, vertical(0.0)), (120.0, 25.0, -40.0, vertical(120.0)), (0.0, 0.0, 10.0, leaning)];
    for (separation, azimuth, elevation, edge) in cases {
        let pair = StereoPair { left: &lens, right: &lens, left_from_right: left_from_right(separation) };
        let middle = left_from_middle(separation);
        let truth = middle * Point::from_mm(around(350.0, azimuth, elevation));
        let exact = see(&pair, &truth).unwrap();
        let kernel = Kernel::EdgePlane(UnitRay::new(edge).unwrap());
        let [own, other] = [kernel, Kernel::default()]
            .map(|kernel| PointUncertainty::by(&kernel, &truth, &pair, 1.0).unwrap().from_pixels);
        let information = [own, other].map(|covariance| covariance.try_inverse().unwrap());
        let mut gaussian = Gaussian(11);
        let mut nees = [0.0; 2];
        for _ in 0..SAMPLES {
            let noisy = PixelPair { left: gaussian.noisy(exact.left, 0.1), right: gaussian.noisy(exact.right, 0.1) };
            let error = (kernel.triangulate(&noisy, &pair).unwrap().point.mm() - truth.mm()) / 0.1;
            for (sum, information) in nees.iter_mut().zip(&information) {
                *sum += error.dot(&(information * error)) / f64::from(SAMPLES);
            }
        }
        let bound = 4.0 * (6.0 / f64::from(SAMPLES)).sqrt();
        assert!((nees[0] - 3.0).abs() < bound, "{separation} {azimuth} {elevation}: {nees:?}");
        // A vertical edge makes a difference of a tenth only, a leaning one of more.
        if azimuth < 1.0 {
            assert!((nees[1] - 3.0).abs() > 2.0 * bound, "{separation} {azimuth} {elevation}: {nees:?}");
        }
        if separation < 1.0 && azimuth > 1.0 {
            let towards = (truth.mm() - middle.origin().mm()).normalize();
            let sigma = [own, other].map(|covariance| towards.dot(&(covariance * towards)).sqrt());
            assert!((sigma[0] / sigma[1] - 2.79 / 2.62).abs() < 0.01, "{sigma:?}");
        }
    }
}

/// In the projection along an edge in the epipolar plane both rays are one line.
#[test]
fn an_edge_in_the_epipolar_plane_has_no_covariance() {
    let lens = lens(0.0);
    let pair = StereoPair { left: &lens, right: &lens, left_from_right: left_from_right(0.0) };
    let level = Kernel::EdgePlane(UnitRay::new(Vector3::x()).unwrap());
    assert_eq!(PointUncertainty::by(&level, &Point::from_mm(Vector3::new(50.0, 0.0, 400.0)), &pair, 0.1), None);
}
