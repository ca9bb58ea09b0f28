//! Batch functions agree with the single-point functions, for every lens and either set of instructions.

#![allow(clippy::unwrap_used, reason = "helpers of tests may panic as tests do")]

use nalgebra::Vector3;
use proptest::prelude::*;
use vergence_vision::{
    Angle, BatchLens, Camera, ImageSize, Instructions, KannalaBrandt, Left, Pixel, Point, UnitRay, covariance,
    pseudo_intersection, triangulate_batch,
};

const BOTH: [Instructions; 2] = [Instructions::Best, Instructions::Baseline];
/// Largest additional error of the batch functions, in radians.
const LARGEST_ERROR: f64 = 1e-14;

/// Lenses from nearly equidistant to strongly bent. At the rim of the last two dr/dθ is a tenth of f, and no polynomial
/// fits.
fn lenses() -> Vec<(KannalaBrandt, bool)> {
    let shapes: [([f64; 4], f64, f64, bool); 6] = [
        ([0.0; 4], 1.0, 120.0, true),
        ([0.01, -0.004, 0.001, -0.0002], 0.9975, 99.5, true),
        ([0.0034, 0.0007, -0.0020, 0.0002], 1.0, 99.5, true),
        ([-0.05, 0.0, 0.0, 0.0], 1.0, 99.5, true),
        ([-0.006, 0.042, -0.038, 0.0066], 1.0, 99.5, false),
        ([-0.1, 0.0, 0.0, 0.0], 1.02, 99.5, false),
    ];
    shapes
        .into_iter()
        .map(|([a, b, c, d], aspect, degrees, fitted)| {
            let k = [1.0, a, b, c, d].map(|k| 599.0 * k);
            let size = ImageSize { width: 1920, height: 1536 };
            let centre = Pixel { u: 957.3, v: 771.9 };
            (KannalaBrandt::new(k, aspect, centre, Angle::from_deg(degrees), size).unwrap(), fitted)
        })
        .collect()
}

fn ray(theta: f64, phi: f64) -> UnitRay<Camera> {
    UnitRay::new(Vector3::new(theta.sin() * phi.cos(), theta.sin() * phi.sin(), theta.cos())).unwrap()
}

/// Rays over the whole field of a lens, in a spiral.
fn rays_over_field(lens: &KannalaBrandt, count: u32) -> Vec<UnitRay<Camera>> {
    let theta = |i: u32| lens.theta_max().rad() * 0.999_999 * f64::from(i) / f64::from(count);
    (0..count).map(|i| ray(theta(i), 2.4 * f64::from(i))).collect()
}

#[test]
fn ordinary_lenses_have_a_fast_unprojection() {
    for (lens, fitted) in lenses() {
        assert_eq!(BatchLens::new(&lens).is_fitted(), fitted, "{lens:?}");
    }
}

#[test]
fn pixels_agree_with_the_single_point_functions() {
    for (lens, _) in lenses() {
        let rays = rays_over_field(&lens, 10_001);
        let points: Vec<[f64; 3]> =
            rays.iter().zip(1..).map(|(ray, i)| ray.at(0.3 * f64::from(i)).mm().into()).collect();
        for instructions in BOTH {
            let pixels = BatchLens::new(&lens).with_instructions(instructions).project(&points);
            assert_eq!(pixels.len(), points.len());
            for (ray, [u, v]) in rays.iter().zip(pixels) {
                let expected = lens.project(ray).unwrap();
                let error = (u - expected.u).hypot(v - expected.v) / lens.k()[0];
                assert!(error < LARGEST_ERROR, "{error} at {}", ray.angle_to_axis());
            }
        }
    }
}

#[test]
fn derivatives_agree_with_the_single_point_functions() {
    for (lens, _) in lenses() {
        let rays = rays_over_field(&lens, 1_001);
        let range = |i: usize| 0.3 * (i + 1) as f64;
        let points: Vec<[f64; 3]> = rays.iter().enumerate().map(|(i, ray)| ray.at(range(i)).mm().into()).collect();
        for instructions in BOTH {
            let batch = BatchLens::new(&lens).with_instructions(instructions);
            let found = batch.project_with_derivatives(&points);
            assert_eq!(found.len(), points.len());
            for (i, ray) in rays.iter().enumerate() {
                let [at, expected] = [found.pixel(i).unwrap(), lens.project(ray).unwrap()];
                assert!((at.u - expected.u).hypot(at.v - expected.v) / lens.k()[0] < LARGEST_ERROR);
                let by_point = (found.by_point(i).unwrap() * range(i) - lens.pixel_by_ray(ray)).norm();
                let by_lens = (found.by_lens(i).unwrap() - lens.pixel_by_lens(ray)).norm();
                let largest = lens.pixel_by_lens(ray).norm().max(lens.k()[0]);
                assert!(by_point.max(by_lens) < 1e-12 * largest, "{by_point} {by_lens} at {}", ray.angle_to_axis());
            }
            let outside = batch.project_with_derivatives(&[[0.0, 0.0, -1.0], [0.0; 3]]);
            assert!(
                (0..2).all(|i| outside.pixel(i).unwrap().u.is_nan() && outside.by_lens(i).unwrap()[(1, 1)].is_nan())
            );
            assert!(outside.pixel(2).is_none() && !outside.is_empty());
        }
    }
}

#[test]
fn rays_agree_with_the_single_point_functions() {
    for (lens, _) in lenses() {
        let pixels: Vec<[f64; 2]> = rays_over_field(&lens, 10_001)
            .iter()
            .map(|ray| lens.project(ray).map(|pixel| [pixel.u, pixel.v]).unwrap())
            .collect();
        for instructions in BOTH {
            let rays = BatchLens::new(&lens).with_instructions(instructions).unproject(&pixels);
            assert_eq!(rays.len(), pixels.len());
            for (&[u, v], ray) in pixels.iter().zip(rays) {
                let expected = lens.unproject::<Camera>(Pixel { u, v }).unwrap();
                let error = (Vector3::from(ray) - expected.vector()).norm();
                assert!(error < LARGEST_ERROR, "{error} at {}", expected.angle_to_axis());
            }
        }
    }
}

#[test]
fn pixels_and_points_outside_the_field_give_nan() {
    for (lens, _) in lenses() {
        let beyond = ray(lens.theta_max().rad() + 1e-6, 0.7).vector();
        let radius = 1.0001 * lens.project(&ray(lens.theta_max().rad() - 1e-9, 0.0)).unwrap().u - 957.3 * 0.0001;
        let points = [beyond.into(), [0.0, 0.0, -1.0], [0.0; 3], [f64::NAN, 0.0, 1.0], [0.0, f64::INFINITY, 1.0]];
        let pixels = [[radius, 771.9], [f64::NAN, 0.0], [0.0, f64::INFINITY], [1e200, -1e200]];
        for instructions in BOTH {
            let batch = BatchLens::new(&lens).with_instructions(instructions);
            assert!(batch.project(&points).iter().flatten().all(|x| x.is_nan()), "{lens:?}");
            assert!(batch.unproject(&pixels).iter().flatten().all(|x| x.is_nan()), "{lens:?}");
            assert_eq!(batch.project(&[[0.0, 0.0, 2.0]]), [[957.3, 771.9]]);
            assert_eq!(batch.project(&[]), [[0.0; 2]; 0]);
        }
    }
}

proptest! {
    #[test]
    fn triangulation_agrees_with_the_single_point_functions(
        rows in prop::collection::vec([-1.0..1.0f64, -1.0..1.0, -0.3..1.0, -1.0..1.0, -1.0..1.0, -0.3..1.0], 0..200),
        t in [20.0..200.0f64, -50.0..50.0, -100.0..100.0],
    ) {
        let sigma = Angle::from_rad(1e-3);
        let t = Point::<Left>::from_mm(Vector3::from(t));
        let unit = |x, y, z| UnitRay::<Left>::new(Vector3::new(x, y, z)).unwrap();
        // Half of the pairs nearly meet in front, the others are arbitrary.
        let pairs: Vec<[UnitRay<Left>; 2]> = rows.iter().enumerate().map(|(i, &[a, b, c, d, e, f])| {
            let left = unit(a, b, c);
            let meeting = left.at(100.0 + 900.0 * f.abs()).mm() - t.mm() + Vector3::new(d, e, f);
            [left, if i % 2 == 0 { UnitRay::new(meeting).unwrap() } else { unit(d, e, f) }]
        }).collect();
        let [left, right] = [0, 1].map(|side| pairs.iter().map(|pair| pair[side].vector().into()).collect::<Vec<[f64; 3]>>());
        for instructions in BOTH {
            let batch = triangulate_batch(&left, &right, &t, sigma, instructions);
            prop_assert_eq!(batch.points.len(), pairs.len());
            prop_assert_eq!(batch.covariances.len(), pairs.len());
            for (row, (pair, found)) in pairs.iter().zip(&batch.points).enumerate() {
                let single = pseudo_intersection(&pair[0], &pair[1], &t).ok();
                let single = single.and_then(|made| Some((made, covariance(&made.point, &t, sigma)?)));
                // Where a condition is nearly met, rounding decides.
                let close_call = pair[0].vector().cross(&pair[1].vector()).norm() < 1e-3;
                match single {
                    Some((made, c)) if !close_call => {
                        let expected = made.point.mm();
                        prop_assert!((Vector3::from(*found) - expected).norm() < 1e-8 * expected.norm());
                        let difference = batch.covariance(row).unwrap() - c;
                        prop_assert!(difference.amax() < 1e-6 * c.trace(), "{} {}", difference, c);
                    }
                    Some(_) => {}
                    None => {
                        let nothing = found.iter().chain(&batch.covariances[row]).all(|value| value.is_nan());
                        prop_assert!(close_call || nothing);
                    }
                }
            }
        }
    }
}
