//! Dense ranges with a pose that is off: what it costs, what is said of it, and what the stated sigma says.
//!
//! `VERGENCE_SIDE=1280 cargo test --release -p vergence-matching --test dense_pose -- --nocapture` prints the figures of
//! docs/measured/dense.md.
#![allow(
    clippy::unwrap_used,
    clippy::expect_used,
    clippy::print_stdout,
    reason = "a test fails loudly and shows its figures"
)]

#[path = "common/rendered.rs"]
mod rendered;

use std::sync::LazyLock;

use nalgebra::{Matrix6, UnitQuaternion, Vector3};
use rendered::{HERBIVORE, HUMAN, Place, Rendered};
use vergence_alignment::pose_drift;
use vergence_matching::{DenseDepth, DenseSample, DenseViews, ImagePair, SharedFrame};
use vergence_vision::{Left, Point, Right, SharedCovariance, StereoPair, Transform, UnitRay};

/// Largest error of a parallax, in pixels at the lens's axis, of a pixel whose partner is found.
const FOUND_PX: f64 = 1.0;

/// Both modes in the room.
static MODES: LazyLock<[(Place, Rendered); 2]> =
    LazyLock::new(|| [HUMAN, HERBIVORE].map(|place| (place, place.rendered(side(), 1))));

fn side() -> u32 {
    std::env::var("VERGENCE_SIDE").map_or(640, |side| side.parse().expect("VERGENCE_SIDE is in pixels"))
}

/// The parallax in radians of two rays in the axes of a stated pose.
fn parallax(frame: &SharedFrame, left: UnitRay<Left>, right: UnitRay<Right>) -> f64 {
    let across = |ray: Vector3<f64>| ray.x.atan2(ray.y.hypot(ray.z));
    across((frame.shared_from_left() * left).vector()) - across((frame.shared_from_right() * right).vector())
}

/// Number of left pixels whose partner was found, whatever range the stated pose makes of it; and of those measured.
fn found(rendered: &Rendered, pair: &ImagePair<'_>, depth: &DenseDepth) -> (usize, usize) {
    let (side, stated) = (depth.size().width, pair.left_from_right);
    let frame = SharedFrame::new(&stated).unwrap();
    let (mut right, mut measured) = (0, 0);
    for (index, sample) in (0..side * side).zip(depth.samples()) {
        let DenseSample::Measured(range) = sample else { continue };
        measured += 1;
        let Some(truth) = rendered.point(index % side, index / side) else { continue };
        let seen: Point<Right> = rendered.left_from_right.inverse() * truth;
        let towards = truth.direction().unwrap();
        let stated_point = stated.inverse() * towards.at(range.range().mm());
        let [by_range, by_truth] =
            [stated_point, seen].map(|point| parallax(&frame, towards, point.direction().unwrap()));
        right += usize::from((by_range - by_truth).abs() * rendered.camera.k()[0] <= FOUND_PX);
    }
    (right, measured)
}

#[test]
fn three_tenths_of_a_degree_cost_less_than_a_tenth_of_the_pixels() {
    for (place, rendered) in &*MODES {
        let (mut exact, stated) = (0, Matrix6::identity() * 1e-10);
        for degrees in [0.0, 0.05, 0.1, 0.3] {
            for (axis, name) in [(Vector3::x(), "pitch"), (Vector3::y(), "yaw"), (Vector3::z(), "roll")] {
                if degrees == 0.0 && name != "pitch" || side() < 1000 && degrees < 0.3 && degrees > 0.0 {
                    continue;
                }
                let off = axis * f64::to_radians(degrees);
                let pair = rendered.pair(off);
                let mut views = DenseViews::new(&pair).unwrap().aligned();
                let swept = views.sweep();
                let depth = views.ranges(&views.register(swept), &SharedCovariance::exact());
                let (right, measured) = found(rendered, &pair, &depth);
                let stereo = StereoPair {
                    left: pair.left_camera,
                    right: pair.right_camera,
                    left_from_right: pair.left_from_right,
                };
                let drift = pose_drift(views.row_matches(), &stereo, &stated).unwrap();
                println!(
                    "{} {name} {degrees}: {right} of {measured} are found; by {} matches the pose is {:.3} off (chi² {:.0})",
                    place.name,
                    views.row_matches().len(),
                    drift.angle.deg(),
                    drift.chi_squared
                );
                if degrees == 0.0 {
                    exact = right;
                    continue;
                }
                assert!(10 * right >= 9 * exact, "{} {name} {degrees}: {right} of {exact}", place.name);
                // A narrow field hardly tells a yaw.
                if degrees >= 0.3 && (place.separation_deg == 0.0 || name != "yaw") {
                    assert!(drift.is_significant() && (drift.angle.deg() - degrees).abs() < 0.15, "{drift:?}");
                }
            }
        }
    }
}

/// The errors that the turns of one standard deviation about each axis make add up to the variance that is stated.
#[test]
fn the_uncertainty_of_the_pose_is_in_the_uncertainty_of_the_range() {
    // Large beside the noise of the images, which differs between the runs.
    let sigma = 0.3f64.to_radians();
    let covariance = Matrix6::from_diagonal(&[sigma * sigma, sigma * sigma, sigma * sigma, 0.0, 0.0, 0.0].into());
    let shared = SharedCovariance::exact().with_pose(&covariance);
    for (place, rendered) in &*MODES {
        let measured = |turn: Vector3<f64>| {
            let truth = rendered.left_from_right;
            let turn = UnitQuaternion::from_scaled_axis(turn) * truth.rotation();
            let stated: Transform<Left, Right> = Transform::new(turn, truth.origin().mm());
            let pair = ImagePair { left_from_right: stated, ..rendered.pair(Vector3::zeros()) };
            vergence_matching::dense_depth(&pair, &shared).unwrap()
        };
        let [exact, by_x, by_y, by_z] =
            [Vector3::zeros(), Vector3::x(), Vector3::y(), Vector3::z()].map(|axis| measured(axis * sigma));
        let mut ratios: Vec<f64> = Vec::new();
        for (index, sample) in exact.samples().iter().enumerate() {
            let DenseSample::Measured(exact) = sample else { continue };
            let moved = [&by_x, &by_y, &by_z].map(|depth| match depth.samples()[index] {
                DenseSample::Measured(range) => (range.range().mm() - exact.range().mm()).powi(2),
                _ => f64::NAN,
            });
            let stated = exact.sigma().mm().powi(2) - exact.own_sigma().mm().powi(2);
            // Farther away the range is no longer linear in the pose.
            let near = exact.range().mm() < 1500.0;
            ratios.extend(Some((moved.iter().sum::<f64>() / stated).sqrt()).filter(|it| near && it.is_finite()));
        }
        ratios.sort_by(f64::total_cmp);
        let at = |part: f64| ratios[(part * ratios.len() as f64) as usize];
        let [low, median, high] = [at(0.25), at(0.5), at(0.75)];
        println!("{}: real over stated {low:.3}, {median:.3}, {high:.3} of {} pixels", place.name, ratios.len());
        assert!(ratios.len() > 2_000 && (0.9..1.1).contains(&median) && low > 0.8 && high < 1.3, "{median}");
    }
}
