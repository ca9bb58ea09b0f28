//! Comparison of the triangulation methods: exact pixels, noise, and matches that slipped along an edge.
//!
//! `VERGENCE_SAMPLES=100000 cargo test --release -p vergence-reproduce --test kernels -- --nocapture` prints the full
//! tables.

#![allow(clippy::unwrap_used, reason = "helpers of tests may panic as tests do")]
#![allow(clippy::print_stdout, reason = "tests show their figures")]

mod common;

use common::{Gaussian, around, count, left_from_middle, left_from_right, lens, see};
use nalgebra::Vector3;
use proptest::prelude::*;
use vergence_reproduce::study;
use vergence_vision::{Angle, Base, DropReason, Kernel, Left, Length, Pixel, PixelPair, Point, StereoPair};

/// Where the rectified view ends, at 90° from its axis, the method has no point and the others do.
#[test]
fn only_the_rectified_view_ends_at_90_degrees() {
    let lens = lens(0.0);
    let pair = StereoPair { left: &lens, right: &lens, left_from_right: left_from_right(0.0) };
    let behind = left_from_middle(0.0) * Point::<Base>::from_mm(Vector3::new(10.0, 340.0, -20.0));
    let pixels = see(&pair, &behind).unwrap();
    for kernel in Kernel::ALL {
        let made = kernel.triangulate(&pixels, &pair);
        match kernel {
            Kernel::Rectified => assert_eq!(made, Err(DropReason::NoPoint)),
            _ => assert!((made.unwrap().point.mm() - behind.mm()).norm() < 1e-6, "{kernel}"),
        }
    }
}

/// RMS error of the distance from the middle of the rig in millimetres, for 1 px of noise at 560 px/rad, at each of
/// [`study::NOISE_PLACES`] by each of [`study::METHODS`], from an independent simulation in numpy.
const NOISE: [[f64; 6]; 5] = [
    [2.2202, 2.2203, 2.2203, 2.2203, 2.2203, 2.2203],
    [2.6246, 2.6246, 2.6246, 2.6246, 2.6246, 2.6070],
    [12.04, 12.06, 12.06, 12.06, 12.06, 12.06],
    [2.2213, 2.2215, 2.2215, 2.2215, 2.2215, 2.2215],
    [2.4175, 2.4178, 2.4177, 2.4178, 2.4178, 2.4178],
];

#[test]
fn with_ordinary_noise_no_method_is_better() {
    let samples = count("VERGENCE_SAMPLES", 4000);
    println!("rms mm: {}", study::METHODS.map(|kernel| kernel.to_string()).join(", "));
    for ((name, place), expected) in study::NOISE_PLACES.into_iter().zip(NOISE) {
        let rms = study::with_noise(&place, 1.0, samples, 7).unwrap();
        println!("{name:26} {rms:.4?}");
        // Both are samples: theirs of unknown size taken for as good as 20 000 of ours.
        let relative = 4.0 * (0.5 / f64::from(samples) + 0.5 / 20_000.0).sqrt();
        for (found, expected) in rms.iter().zip(expected) {
            assert!((found / expected - 1.0).abs() < relative, "{name}: {rms:.4?}, expected {expected}");
        }
        // All methods get the same noise.
        for found in &rms[..5] {
            assert!((found / rms[1] - 1.0).abs() < 0.01, "{name}: {rms:.4?}");
        }
    }
}

/// Error of the depth in millimetres of each of [`study::SLIPS`] by each of [`study::METHODS`], from an independent
/// computation in numpy.
const SLIPPED: [[f64; 6]; 7] = [
    [-0.416, 0.000, -0.036, 0.000, 0.000, 0.006],
    [-0.416, 0.000, -0.036, 0.000, 0.000, 0.046],
    [-6.53, 0.000, -0.57, 0.000, 0.000, 0.09],
    [-6.53, 0.000, -0.57, 0.000, 0.000, 0.73],
    [-37.0, 0.000, -3.54, 0.000, -0.001, 0.58],
    [-37.0, 0.000, -3.54, 0.000, -0.001, 4.55],
    [-7.77, -0.64, -1.91, -0.72, -0.81, -0.11],
];

#[test]
fn a_match_slipped_along_an_edge_moves_the_methods_apart() {
    println!("dZ mm: {}, edge-plane", study::METHODS.map(|kernel| kernel.to_string()).join(", "));
    for ((name, place, slip), expected) in study::SLIPS.into_iter().zip(SLIPPED) {
        let (found, by_edge) = study::with_slip(&place, slip).unwrap();
        println!("{name} {slip}: {found:.3?} {by_edge:.3}");
        assert!(by_edge.abs() < 1e-9, "{by_edge}");
        for (found, expected) in found.iter().zip(expected) {
            assert!((found - expected).abs() <= 0.0006_f64.max(0.006 * expected.abs().max(1.0)), "{found} {expected}");
        }
    }
}

/// Off the horizontal plane a vertical edge is not orthogonal to the epipolar plane, and only the edge's own plane
/// helps.
#[test]
fn above_the_horizon_only_the_edge_plane_is_exact() {
    let degrees = Angle::from_deg;
    let place = study::Place {
        separation: degrees(0.0),
        range: Length::from_mm(350.0),
        azimuth: degrees(40.0),
        elevation: degrees(20.0),
    };
    let (errors, by_edge) = study::with_slip(&place, Length::from_mm(-20.0)).unwrap();
    assert!(by_edge.abs() < 1e-9, "{by_edge}");
    // The second method is the pseudo-intersection.
    assert!(errors[1].abs() > 5.0, "{errors:?}");
}

proptest! {
    #[test]
    fn every_method_returns_the_point_of_exact_pixels(
        azimuth in -60.0..60.0f64, elevation in -50.0..50.0f64, range in 250.0..3000.0f64, separation in 0.0..100.0f64,
    ) {
        let (left, right) = (lens(0.01), lens(-0.02));
        let pair = StereoPair { left: &left, right: &right, left_from_right: left_from_right(separation) };
        let truth = left_from_middle(separation) * Point::from_mm(around(range, azimuth, elevation));
        let Some(pixels) = see(&pair, &truth) else { return Ok(()) };
        for kernel in Kernel::ALL {
            let made = kernel.triangulate(&pixels, &pair);
            prop_assert!(made.is_ok(), "{}: {:?}", kernel, made);
            let error = (made.unwrap().point.mm() - truth.mm()).norm();
            prop_assert!(error < 1e-6 * range, "{kernel}: {error} at {range}");
        }
    }

    /// No point nearby has a smaller reprojection error.
    #[test]
    fn reprojection_is_a_minimum(
        azimuth in -60.0..60.0f64, elevation in -40.0..40.0f64, seed in any::<u64>(),
    ) {
        let (left, right) = (lens(0.01), lens(-0.02));
        let pair = StereoPair { left: &left, right: &right, left_from_right: left_from_right(40.0) };
        let truth = left_from_middle(40.0) * Point::from_mm(around(600.0, azimuth, elevation));
        let Some(exact) = see(&pair, &truth) else { return Ok(()) };
        let mut gaussian = Gaussian(seed);
        let pixels = PixelPair { left: gaussian.noisy(exact.left, 2.0), right: gaussian.noisy(exact.right, 2.0) };
        let made = Kernel::Reprojection.triangulate(&pixels, &pair).unwrap().point;
        let cost = |point: &Point<Left>| {
            let seen = see(&pair, point).unwrap();
            let squared = |a: Pixel, b: Pixel| (a.u - b.u).powi(2) + (a.v - b.v).powi(2);
            squared(seen.left, pixels.left) + squared(seen.right, pixels.right)
        };
        for _ in 0..20 {
            let aside = Vector3::new(gaussian.normal(), gaussian.normal(), gaussian.normal()) * 0.05;
            prop_assert!(cost(&Point::from_mm(made.mm() + aside)) > cost(&made));
        }
    }
}
