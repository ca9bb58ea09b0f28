//! A lens whose pupil moves: the vectors and laws of its projection, its points and their covariance.

#![allow(clippy::unwrap_used, reason = "helpers of tests may panic as tests do")]

use nalgebra::{SVector, UnitQuaternion, Vector3};
use proptest::prelude::*;
use vergence_vision::{
    Angle, Asymmetry, BatchLens, BatchPair, BatchPoints, Camera, Gates, ImageSize, Instructions, KannalaBrandt, Kernel,
    LENS_PARAMETERS, Left, Length, OpenCvFisheye, Pixel, PixelPair, Point, PointUncertainty, Pupil,
    ResidualUncertainty, Right, SHARED_PARAMETERS, SharedCovariance, StereoPair, Transform, UnitRay, cloud_point,
    pupil_shift, pupil_shift_slope, ray_to_plane,
};

const SIZE: ImageSize = ImageSize { width: 2048, height: 2048 };

fn lens(e0: f64) -> KannalaBrandt {
    let opencv = OpenCvFisheye { fx: 599.1, fy: 599.1, cx: 1024.0, cy: 1024.0, k: [-0.052, 0.0041, -0.0019, 0.0002] };
    let central = KannalaBrandt::from_opencv(opencv, Angle::from_deg(105.0), SIZE).unwrap();
    central.with_pupil(Length::from_mm(e0)).unwrap()
}

/// A lens with all other parameters that a lens can have.
fn displaced(lens: KannalaBrandt) -> KannalaBrandt {
    let growing = lens.with_pupil(Pupil { e1: Length::from_mm(0.2), ..lens.pupil() }).unwrap();
    let longer = growing.with_further_terms([-4e-5, 3e-6]).unwrap();
    longer
        .with_asymmetry(Asymmetry::from_array([0.0012, -0.0007, 0.0009, -0.0002, -0.0011, 0.0003, 2e-4, -1e-4]))
        .unwrap()
}

fn direction(theta: f64, phi: f64) -> Vector3<f64> {
    Vector3::new(theta.sin() * phi.cos(), theta.sin() * phi.sin(), theta.cos())
}

/// Points in millimetres, and the angle and the pixel at which they are seen.
const VECTORS: [([f64; 3], f64, f64, f64); 5] = [
    ([200.0, 0.0, 100.0], 1.10980208495986, 1648.38015792453, 1024.0),
    ([0.0, -350.0, -40.0], 1.69007031940261, 1024.0, 159.351187967216),
    ([150.0, 100.0, 300.0], 0.541305694969105, 1289.80195873623, 1201.20130582415),
    ([30.0, 0.0, -5.0], 1.81268923519062, 1924.61764256056, 1024.0),
    ([1.0, 2.0, 500.0], 0.00447210622370053, 1025.19819078812, 1026.39638157624),
];

/// The same with e1 = 0.056 mm.
const WITH_GROWTH: [([f64; 3], f64, f64, f64); 5] = [
    ([200.0, 0.0, 100.0], 1.10986863096052, 1648.41277928926, 1024.0),
    ([0.0, -350.0, -40.0], 1.69038997789981, 1024.0, 159.24941505633),
    ([150.0, 100.0, 300.0], 0.541306917650729, 1289.8025412376, 1201.2016941584),
    ([30.0, 0.0, -5.0], 1.81854003291822, 1926.17621659321, 1024.0),
    ([1.0, 2.0, 500.0], 0.00447210622370057, 1025.19819078812, 1026.39638157624),
];

/// The formulas of D. Gennery (2006) evaluated with 50 digits (mpmath), for e0 = 2.77 mm.
#[test]
fn points_are_seen_where_the_formulas_say() {
    let growing = lens(2.77).with_pupil(Pupil::from_mm([2.77, 0.056])).unwrap();
    let vectors =
        VECTORS.map(|vector| (lens(2.77), vector)).into_iter().chain(WITH_GROWTH.map(|vector| (growing, vector)));
    for (lens, ([x, y, z], theta, u, v)) in vectors {
        let point = Point::<Camera>::from_mm(Vector3::new(x, y, z));
        let ray = lens.ray_to(&point).unwrap();
        let pixel = lens.project_point(&point).unwrap();
        assert!((ray.angle_to_axis().rad() - theta).abs() < 1e-12, "{point:?}: {}", ray.angle_to_axis().rad());
        assert!((pixel.u - u).abs() < 1e-9 && (pixel.v - v).abs() < 1e-9, "{point:?}: {pixel:?}");
    }
}

#[test]
fn a_point_too_near_to_its_pupil_has_no_ray() {
    let lens = lens(2.77);
    assert!(lens.project_point(&Point::<Camera>::from_mm(Vector3::new(1.0, 0.0, 0.3))).is_err());
    assert!(lens.project_point(&Point::<Camera>::from_mm(Vector3::zeros())).is_err());
    assert!(KannalaBrandt::with_pupil(lens, Length::from_mm(f64::NAN)).is_err());
}

#[test]
fn the_series_near_the_axis_meets_the_formula() {
    for step in [-1.0, 1.0] {
        let theta = 1e-3 * (1.0 + step * 1e-9);
        let (shift, slope) = (pupil_shift(theta), pupil_shift_slope(theta));
        let squared = theta * theta;
        assert!((shift - squared / 6.0 * (1.0 + squared * 7.0 / 60.0)).abs() < 1e-15, "{shift}");
        assert!((slope - theta / 3.0 * (1.0 + squared * 7.0 / 30.0)).abs() < 1e-9, "{slope}");
    }
}

struct Pair {
    lenses: [KannalaBrandt; 2],
    pose: Transform<Left, Right>,
}

impl Pair {
    fn new(separation: f64, pupils: [f64; 2]) -> Self {
        let half = separation.to_radians() / 2.0;
        let turn = UnitQuaternion::from_euler_angles(0.01, 2.0 * half, -0.02);
        Self {
            lenses: pupils.map(lens),
            pose: Transform::new(turn, Vector3::new(145.0 * half.cos(), 3.0, -145.0 * half.sin())),
        }
    }

    fn stereo(&self) -> StereoPair<'_> {
        StereoPair { left: &self.lenses[0], right: &self.lenses[1], left_from_right: self.pose }
    }

    fn see(&self, point: &Point<Left>) -> Option<PixelPair> {
        let left = self.lenses[0].project_point(point).ok()?;
        Some(PixelPair { left, right: self.lenses[1].project_point(&(self.pose.inverse() * *point)).ok()? })
    }

    fn place(&self, pixels: &PixelPair) -> Option<Vector3<f64>> {
        Some(Kernel::default().triangulate(pixels, &self.stereo()).ok()?.point.mm())
    }

    /// The angle of the right ray to the left ray's epipolar plane.
    fn residual(&self, pixels: &PixelPair) -> Option<f64> {
        let pair = self.stereo();
        let (left, right) = (pair.left.unproject(pixels.left).ok()?, pair.right.unproject(pixels.right).ok()?);
        let pose = pair.at_origins(&left, &right).0.left_from_right;
        Some(ray_to_plane(&left, &(pose * right), &pose.origin())?.rad())
    }

    /// With the shared parameters changed by `by`.
    fn changed(&self, by: &SVector<f64, SHARED_PARAMETERS>) -> Self {
        let lens = |lens: &KannalaBrandt, by: &[f64]| {
            let OpenCvFisheye { fx, fy, cx, cy, k } = lens.to_opencv();
            let opencv = OpenCvFisheye {
                fx: fx + by[0],
                fy: fy + by[1],
                cx: cx + by[2],
                cy: cy + by[3],
                k: std::array::from_fn(|i| k[i] + by[4 + i]),
            };
            let [k5, k6] = lens.further_terms();
            let further = [k5 + by[16], k6 + by[17]];
            let central = KannalaBrandt::from_opencv_with(opencv, further, lens.theta_max(), SIZE).unwrap();
            let [e0, e1] = lens.pupil().mm();
            let moving = central.with_pupil(Pupil::from_mm([e0 + by[8], e1 + by[9]])).unwrap();
            let (asymmetry, at) = (lens.asymmetry().to_array(), [10, 11, 12, 13, 14, 15, 18, 19]);
            moving.with_asymmetry(Asymmetry::from_array(std::array::from_fn(|i| asymmetry[i] + by[at[i]]))).unwrap()
        };
        let (left, rest) = by.as_slice().split_at(LENS_PARAMETERS);
        let (right, pose) = rest.split_at(LENS_PARAMETERS);
        let turn = UnitQuaternion::from_scaled_axis(Vector3::new(pose[0], pose[1], pose[2]));
        let centre = self.pose.origin().mm() + Vector3::new(pose[3], pose[4], pose[5]);
        Self {
            lenses: [lens(&self.lenses[0], left), lens(&self.lenses[1], right)],
            pose: Transform::new(turn * self.pose.rotation(), centre),
        }
    }
}

fn shifted(pixels: &PixelPair, [a, b, c, d]: [f64; 4]) -> PixelPair {
    let moved = |at: Pixel, u: f64, v: f64| Pixel { u: at.u + u, v: at.v + v };
    PixelPair { left: moved(pixels.left, a, b), right: moved(pixels.right, c, d) }
}

proptest! {
    #[test]
    fn pixel_and_ray_return_to_each_other(
        theta in 0.0..1.71f64, phi in -3.2..3.2f64, log in 1.7..6.0f64, e0 in -1.0..3.5f64, is_symmetric: bool,
    ) {
        let lens = if is_symmetric { lens(e0) } else { displaced(lens(e0)) };
        let ray = UnitRay::<Camera>::new(direction(theta, phi)).unwrap();
        let pixel = lens.project(&ray).unwrap();
        let point = Point::<Camera>::from_mm(lens.origin_of(&ray).mm() + ray.vector() * 10f64.powf(log));
        let back = lens.project_point(&point).unwrap();
        let again = lens.unproject::<Camera>(pixel).unwrap();
        prop_assert!((again.vector() - ray.vector()).norm() < 1e-12, "{again:?}");
        prop_assert!((pixel.u - back.u).hypot(pixel.v - back.v) < 1e-9, "{pixel:?} became {back:?}");
    }

    #[test]
    fn every_kernel_finds_the_point_that_both_see(
        separation in 0.0..120.0f64, theta in 0.2..1.2f64, phi in -3.1..3.1f64, range in 200.0..3000.0f64, e in 0.0..3.0f64,
    ) {
        let pair = Pair::new(separation, [2.77, e]);
        // Directions around the middle between both axes.
        let middle = UnitQuaternion::from_euler_angles(0.0, separation.to_radians() / 2.0, 0.0);
        let point = Point::<Left>::from_mm(middle * direction(theta * (1.0 - separation / 180.0), phi) * range);
        let Some(pixels) = pair.see(&point) else { return Ok(()) };
        for kernel in Kernel::ALL {
            let Ok(made) = kernel.triangulate(&pixels, &pair.stereo()) else { continue };
            prop_assert!((made.point.mm() - point.mm()).norm() < 1e-6 * range, "{kernel}: {:?}", made.point);
            prop_assert!((made.left_range.mm() - range).abs() < 1e-6 * range);
        }
        prop_assert!(pair.place(&pixels).is_some());
        let kept = cloud_point(&pixels, 0.1, &pair.stereo(), &Gates { max_relative_sigma: 1.0, ..Gates::default() }).unwrap();
        prop_assert!(kept.residual.rad().abs() < 1e-9, "{:?}", kept.residual);
    }

    /// First derivatives by central differences, of pixels, lenses with their pupils, and pose.
    #[test]
    fn covariance_follows_the_derivatives(separation in 0.0..120.0f64, theta in 0.3..1.2f64, phi in -3.1..3.1f64, range in 150.0..800.0f64, is_symmetric: bool) {
        let mut pair = Pair::new(separation, [2.77, 2.1]);
        if !is_symmetric {
            pair.lenses = pair.lenses.map(displaced);
        }
        let middle = UnitQuaternion::from_euler_angles(0.0, separation.to_radians() / 2.0, 0.0);
        let point = Point::<Left>::from_mm(middle * direction(theta * (1.0 - separation / 180.0), phi) * range);
        let Some(pixels) = pair.see(&point) else { return Ok(()) };
        let stated = PointUncertainty::of(&point, &pair.stereo(), 1.0).unwrap();
        let scale = stated.from_pixels.trace().sqrt();
        let left = pair.lenses[0].unproject::<Left>(pixels.left).unwrap();
        let in_right = pair.lenses[1].unproject::<Right>(pixels.right).unwrap();
        let off_plane = ResidualUncertainty::of(&left, &in_right, &pair.stereo(), 1.0).unwrap();

        let (mut from_pixels, mut variance) = (nalgebra::Matrix3::zeros(), 0.0);
        for i in 0..4 {
            let step = 1e-3;
            let [less, more] = [-step, step].map(|by| shifted(&pixels, std::array::from_fn(|k| if k == i { by } else { 0.0 })));
            let by = (pair.place(&more).unwrap() - pair.place(&less).unwrap()) / (2.0 * step);
            from_pixels += by * by.transpose();
            variance += ((pair.residual(&more).unwrap() - pair.residual(&less).unwrap()) / (2.0 * step)).powi(2);
        }
        prop_assert!((from_pixels - stated.from_pixels).norm() < 1e-3 * scale * scale, "{from_pixels} {}", stated.from_pixels);
        prop_assert!((variance - off_plane.from_pixels).abs() < 1e-4 * variance, "{variance} {}", off_plane.from_pixels);
        for i in 0..SHARED_PARAMETERS {
            let has_no_unit = i < 2 * LENS_PARAMETERS && (4..8).chain(10..LENS_PARAMETERS).any(|at| at == i % LENS_PARAMETERS);
            let step = if has_no_unit { 1e-6 } else { 1e-4 };
            let step = if (2 * LENS_PARAMETERS..2 * LENS_PARAMETERS + 3).contains(&i) { 1e-6 } else { step };
            // The further terms move points at the rim by kilometres for one.
            let step = if has_no_unit { f64::min(step, 1e-2 / stated.by_shared.column(i).norm()) } else { step };
            let [less, more] = [-step, step].map(|by| pair.changed(&SVector::from_fn(|k, _| if k == i { by } else { 0.0 })));
            let by = (more.place(&pixels).unwrap() - less.place(&pixels).unwrap()) / (2.0 * step);
            let of = stated.by_shared.column(i);
            prop_assert!((by - of).norm() < 2e-3 * of.norm().max(1e-2), "parameter {i}: {by} instead of {of}");
            let turn = (more.residual(&pixels).unwrap() - less.residual(&pixels).unwrap()) / (2.0 * step);
            let stated = off_plane.by_shared[i];
            prop_assert!((turn - stated).abs() < 1e-3 * stated.abs().max(1e-5), "residual by {i}: {turn} instead of {stated}");
        }
    }
}

/// For programs that know of no pupil: alike at the distance asked for, off elsewhere by f e sin θ (1/D - 1/D0).
#[test]
fn a_central_lens_stands_in_at_one_distance() {
    let lens = lens(2.77);
    let stand_in = lens.central_at(Length::from_mm(500.0)).unwrap();
    assert!(stand_in.is_central());
    let off = |mm: f64| lens.largest_difference(&stand_in, Length::from_mm(mm));
    let theta: f64 = 105f64.to_radians();
    let expected = lens.pixels_per_radian(Angle::from_rad(theta))
        * 2.77
        * pupil_shift(theta)
        * theta.sin()
        * (1.0 / 200.0 - 1.0 / 500.0);
    assert!(off(500.0) < 0.05, "{}", off(500.0));
    assert!((off(200.0) / expected - 1.0).abs() < 0.1, "{} {expected}", off(200.0));
    let central = lens.with_pupil(Length::from_mm(0.0)).unwrap();
    assert_eq!(central.central_at(Length::from_mm(500.0)).unwrap(), central);
}

/// Batches of lenses that are not central and symmetric give what single points give.
#[test]
fn batches_take_the_pupil() {
    let mut pair = Pair::new(60.0, [2.77, 2.1]);
    pair.lenses[1] = displaced(pair.lenses[1]);
    let shared = SharedCovariance::joint(nalgebra::SMatrix::from_diagonal_element(1e-6));
    let point = Point::<Left>::from_mm(Vector3::new(200.0, 30.0, 300.0));
    let pixels = pair.see(&point).unwrap();
    let left = pair.lenses[0].unproject::<Left>(pixels.left).unwrap().vector().into();
    let right = pair.lenses[1].unproject::<Right>(pixels.right).unwrap().vector().into();
    let BatchPoints { points, covariances } =
        BatchPair::new(&pair.stereo(), 0.1, &shared).triangulate(&[left, [0.0, 0.0, 1.0]], &[right, [f64::NAN; 3]]);
    assert!((Vector3::from(points[0]) - point.mm()).norm() < 1e-6 && points[1][0].is_nan());
    let single = PointUncertainty::of(&point, &pair.stereo(), 0.1).unwrap().covariance(&shared);
    assert!((covariances[0][5] / single.m33 - 1.0).abs() < 1e-6 && covariances[1][5].is_nan());
}

/// Whole arrays of points at finite distances, and of pixels with the places where their rays begin, by every instructions.
#[test]
fn arrays_of_points_and_pixels_take_the_pupil() {
    for lens in [lens(2.77), lens(-1.0), displaced(lens(2.77)), displaced(lens(0.5)), lens(0.0)] {
        for instructions in [Instructions::Best, Instructions::Baseline] {
            let batch = BatchLens::new(&lens).with_instructions(instructions);
            let (mut points, mut pixels) = (Vec::new(), Vec::new());
            for i in 0..4000u32 {
                // From a centimetre to a kilometre, some points so near that no ray reaches them, some beyond the field.
                let (theta, log) = (1.9 * f64::from(i) / 4000.0, f64::from(i % 101) * 0.05 + 1.0);
                points.push((direction(theta, 2.4 * f64::from(i)) * 10f64.powf(log)).into());
                let (u, v) = (f64::from(i % 63) * 33.0 - 10.0, f64::from(i / 63) * 33.0 - 10.0);
                pixels.push([u, v]);
            }
            points.extend([[0.0, 0.0, 500.0], [0.0; 3], [f64::NAN, 1.0, 1.0], [1e120, 0.0, 1e120], [0.0, 0.0, -500.0]]);
            let mut seen = 0;
            for (point, [u, v]) in points.iter().zip(batch.project_points(&points)) {
                match lens.project_point(&Point::<Camera>::from_mm((*point).into())) {
                    Ok(one) => {
                        seen += 1;
                        assert!((one.u - u).hypot(one.v - v) < 6e-7, "{point:?}: {one:?} and {u}, {v}");
                    }
                    Err(_) => assert!(u.is_nan(), "{point:?}: {u}, {v}"),
                }
            }
            assert!(seen > 3500, "{seen}");
            for (&[u, v], [x, y, z, e]) in pixels.iter().zip(batch.unproject_with_shifts(&pixels)) {
                match lens.unproject::<Camera>(Pixel { u, v }) {
                    Ok(one) => {
                        let off = (one.vector() - Vector3::new(x, y, z)).norm();
                        assert!(off < 2e-14 && (lens.origin_of(&one).mm().z - e).abs() < 1e-9, "{u}, {v}: {off} {e}");
                    }
                    Err(_) => assert!(x.is_nan() && e.is_nan(), "{u}, {v}: {x} {e}"),
                }
            }
        }
    }
}
