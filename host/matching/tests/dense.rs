//! Dense ranges against the exact truth of the simulator's room, and laws that need no truth.
//!
//! `VERGENCE_SIDE=1280 cargo test --release -p vergence-matching --test dense -- --nocapture` prints the figures of
//! docs/measured/dense.md.
#![allow(clippy::unwrap_used, reason = "a test that cannot be set up fails")]

mod common;
#[path = "common/rendered.rs"]
mod rendered;

use std::collections::BTreeMap;

use common::{Pair, equidistant};
use image::GrayImage;
use image::imageops::flip_horizontal;
use nalgebra::{Matrix6, Vector3};
use rendered::{BASELINE_MM, HUMAN, Rendered};
use vergence_matching::{DenseDepth, DenseRange, DenseSample, DenseViews, ImagePair, MatchError, dense_depth};
use vergence_vision::{Angle, Left, Length, Pixel, Right, SharedCovariance, Transform};

/// Smallest standard deviation of grey levels in a textured window: some four times the sensor's noise.
const TEXTURED: f64 = 4.0;
/// Standard deviation of a matched position that the prediction assumes, in pixels of each image.
const PIXEL_SIGMA: f64 = 0.2;

/// The true range of a left pixel, and its predicted relative sigma; `None` where not both lenses see it.
fn expected(human: &Rendered, x: u32, y: u32) -> Option<(f64, f64)> {
    let (point, lens) = (human.point(x, y)?, &human.camera);
    let (truth, in_right) = (point.mm().norm(), human.left_from_right.inverse() * point);
    let pixel = lens.project_point(&in_right).ok()?;
    let from_right = in_right.mm().norm();
    let parallax = point.mm().angle(&(point.mm() - human.left_from_right.origin().mm()));
    let disparity_sigma = PIXEL_SIGMA * 2f64.sqrt() / lens.k()[0];
    lens.on_sensor(pixel).then(|| (truth, from_right / parallax.sin() * disparity_sigma / truth))
}

/// Standard deviation of the grey levels in the 7 × 7 pixels around.
fn contrast(image: &GrayImage, x: u32, y: u32) -> f64 {
    let (mut sum, mut squares, mut count) = (0.0, 0.0, 0.0);
    for j in y.saturating_sub(3)..(y + 4).min(image.height()) {
        for i in x.saturating_sub(3)..(x + 4).min(image.width()) {
            let level = f64::from(image.get_pixel(i, j).0[0]);
            (sum, squares, count) = (sum + level, squares + level * level, count + 1.0);
        }
    }
    (squares / count - (sum / count) * (sum / count)).max(0.0).sqrt()
}

/// A number of good cases and the number of all.
#[derive(Clone, Copy, Debug, Default)]
struct Share {
    good: usize,
    of: usize,
}

impl Share {
    fn count(&mut self, good: bool) {
        self.good += usize::from(good);
        self.of += 1;
    }

    fn value(self) -> f64 {
        self.good as f64 / self.of.max(1) as f64
    }
}

/// Comparison of a dense result with the truth.
#[derive(Debug, Default)]
struct Judgement {
    /// Stated sigma at most 1 % and textured: within 2 %.
    sure: Share,
    /// Every other measured pixel: within 3 sigma.
    elsewhere: Share,
    /// Predicted sigma at most 1 %, textured, in both fields: measured and within 2 %. Gaps count as failures, also
    /// where one camera cannot see.
    expected: Share,
    /// All measured pixels: within 1, 2 and 3 sigma.
    within: [Share; 3],
}

fn judge(human: &Rendered, depth: &DenseDepth) -> Judgement {
    let side = depth.size().width;
    let mut judged = Judgement::default();
    for (index, sample) in (0..side * side).zip(depth.samples()) {
        let (x, y) = (index % side, index / side);
        let textured = contrast(&human.grey[0], x, y) >= TEXTURED;
        let truth = human.point(x, y).map(|point| point.mm().norm());
        let measured = if let DenseSample::Measured(measured) = sample { Some(measured) } else { None };
        let off = |it: &DenseRange| truth.map_or(f64::INFINITY, |truth| (it.range().mm() - truth).abs() / truth);
        if let Some((_, sigma)) = expected(human, x, y)
            && textured
            && sigma <= 0.01
        {
            judged.expected.count(measured.is_some_and(|it| off(it) <= 0.02));
        }
        let Some(measured) = measured else { continue };
        let sigmas = truth.map_or(f64::INFINITY, |truth| (measured.range().mm() - truth).abs() / measured.sigma().mm());
        if textured && measured.sigma().mm() <= 0.01 * measured.range().mm() {
            judged.sure.count(off(measured) <= 0.02);
        } else {
            judged.elsewhere.count(sigmas <= 3.0);
        }
        (1..).zip(&mut judged.within).for_each(|(count, within)| within.count(sigmas <= f64::from(count)));
    }
    judged
}

#[test]
fn the_room_in_human_mode_is_measured_as_well_as_stated() {
    let side = std::env::var("VERGENCE_SIDE").map_or(960, |side| side.parse().expect("VERGENCE_SIDE is in pixels"));
    let human = HUMAN.rendered(side, 1);
    let (depth, seconds) = timed(&human.pair(Vector3::zeros()));
    let judged = judge(&human, &depth);
    let counts = depth.counts();
    let names: BTreeMap<String, usize> = counts.gaps.iter().map(|(gap, &count)| (gap.to_string(), count)).collect();
    println!("{side} px: {} measured, {} far, without {names:?}; {seconds}", counts.measured, counts.far);
    for (name, share) in [
        ("stated sigma <= 1 % and textured, within 2 %", judged.sure),
        ("elsewhere, within 3 sigma", judged.elsewhere),
        ("predicted sigma <= 1 % and textured, measured and within 2 %", judged.expected),
        ("all measured, within 1 sigma", judged.within[0]),
        ("all measured, within 2 sigma", judged.within[1]),
        ("all measured, within 3 sigma", judged.within[2]),
    ] {
        println!("{name}: {:.1} % of {}", 100.0 * share.value(), share.of);
    }
    assert!(judged.sure.of > counts.measured / 3 && judged.sure.value() >= 0.9);
    assert!(judged.elsewhere.value() >= 0.88);
    assert!(judged.expected.value() >= 0.74);
    assert!(judged.within[2].value() >= 0.92);
}

/// The dense result, and the times of its stages as a sentence for people.
#[allow(clippy::disallowed_methods, reason = "figures for people")]
fn timed(pair: &ImagePair<'_>) -> (DenseDepth, String) {
    let start = std::time::Instant::now();
    let seconds = || start.elapsed().as_secs_f64();
    let mut views = DenseViews::new(pair).unwrap().aligned();
    let turned = seconds();
    let swept = views.sweep();
    let sweep = seconds();
    let disparities = views.register(swept);
    let registered = seconds();
    let depth = views.ranges(&disparities, &SharedCovariance::exact());
    let all = seconds();
    let text = format!(
        "turn {turned:.2} s, sweep {:.2} s, register {:.2} s, ranges {:.2} s, in all {all:.2} s",
        sweep - turned,
        registered - sweep,
        all - registered
    );
    (depth, text)
}

#[test]
fn identical_images_are_far_everywhere() {
    let pair = Pair::new(320, Angle::from_deg(0.0));
    let left_from_right = Transform::new(nalgebra::UnitQuaternion::identity(), Vector3::new(BASELINE_MM, 0.0, 0.0));
    let depth =
        dense_depth(&ImagePair { right: &pair.left, left_from_right, ..pair.images() }, &SharedCovariance::exact())
            .unwrap();
    let counts = depth.counts();
    println!("{counts:?}");
    assert!(counts.far > 20_000 && counts.measured * 1000 < counts.far, "{counts:?}");
}

/// The pose of the mirrored and swapped cameras: the plane x = 0 mirrors axes and shifts.
fn across_x(right_from_left: &Transform<Right, Left>) -> Transform<Left, Right> {
    let (turn, shift) = (right_from_left.rotation().scaled_axis(), right_from_left.origin().mm());
    let turn = nalgebra::UnitQuaternion::from_scaled_axis(Vector3::new(turn.x, -turn.y, -turn.z));
    Transform::new(turn, Vector3::new(-shift.x, shift.y, shift.z))
}

/// Mirrored images of swapped cameras show the mirrored scene.
#[test]
fn swapped_and_mirrored_cameras_measure_the_same() {
    let pair = Pair::new(320, Angle::from_deg(0.0));
    let straight = pair.images();
    let left_from_right = straight.left_from_right;
    let (flipped_left, flipped_right) = (flip_horizontal(&pair.left), flip_horizontal(&pair.right));
    let mirrored = ImagePair {
        left: &flipped_right,
        right: &flipped_left,
        left_from_right: across_x(&left_from_right.inverse()),
        ..straight
    };
    let [straight, mirrored] = [straight, mirrored].map(|pair| dense_depth(&pair, &SharedCovariance::exact()).unwrap());
    let mut same = Share::default();
    for (index, sample) in (0..320 * 320).zip(straight.samples()) {
        let DenseSample::Measured(by_left) = sample else { continue };
        let pixel = Pixel { u: f64::from(index % 320), v: f64::from(index / 320) };
        let point = pair.camera.unproject::<Left>(pixel).unwrap().at(by_left.range().mm());
        let in_right = left_from_right.inverse() * point;
        let Ok(seen) = pair.camera.project_point(&in_right) else { continue };
        // The place lies between four pixels of the mirrored image; their ranges differ on slanted surfaces.
        let (column, row) = (319.0 - seen.u, seen.v);
        let around = [(0, 0), (0, 1), (1, 0), (1, 1)].map(|(i, j)| {
            match mirrored.samples()[(row as usize + j) * 320 + column as usize + i] {
                DenseSample::Measured(by_right) => Some((by_right.range().mm(), by_right.sigma().mm())),
                _ => None,
            }
        });
        if let [Some(a), Some(b), Some(c), Some(d)] = around {
            let ranges = [a.0, b.0, c.0, d.0];
            let (low, high) =
                ranges.iter().fold((f64::INFINITY, 0.0_f64), |(low, high), it| (low.min(*it), high.max(*it)));
            let slack = 3.0 * by_left.sigma().mm().hypot(a.1.max(b.1).max(c.1).max(d.1));
            same.count((low - slack..=high + slack).contains(&in_right.mm().norm()));
        }
    }
    println!("{:.3} of {}", same.value(), same.of);
    assert!(same.of > 12_000 && same.value() > 0.95, "{same:?}");
}

#[test]
fn unrelated_images_have_no_ranges() {
    let camera = equidistant(320);
    let noise = |seed: u64| {
        let mut state = seed;
        GrayImage::from_fn(320, 320, |_, _| {
            state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            image::Luma([(state >> 56) as u8])
        })
    };
    let even = |level: u8| GrayImage::from_pixel(320, 320, image::Luma([level]));
    let left_from_right = Transform::new(nalgebra::UnitQuaternion::identity(), Vector3::new(BASELINE_MM, 0.0, 0.0));
    for (left, right) in [(noise(1), noise(2)), (even(0), even(0)), (even(90), even(90)), (even(0), noise(1))] {
        let pair = ImagePair {
            left: &left,
            right: &right,
            left_camera: &camera,
            right_camera: &camera,
            left_from_right,
            pose_sigma: Angle::from_deg(0.0),
            nearest: Length::from_mm(200.0),
            masks: [None; 2],
        };
        let counts = dense_depth(&pair, &SharedCovariance::exact()).unwrap().counts();
        println!("{counts:?}");
        assert!((counts.measured + counts.far) * 50 < 320 * 320, "{counts:?}");
    }
}

#[test]
fn any_number_of_threads_gives_the_same() {
    let pair = Pair::new(320, Angle::from_deg(30.0));
    let on = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| {
            dense_depth(&pair.images(), &SharedCovariance::exact().with_pose(&Matrix6::identity())).unwrap()
        })
    };
    // Bit for bit: a NaN would not equal itself.
    assert_eq!(on(1), on(3));
}

#[test]
fn a_pose_without_baseline_or_a_wrong_size_is_refused() {
    let pair = Pair::new(320, Angle::from_deg(0.0));
    let refused = |pair: ImagePair<'_>| dense_depth(&pair, &SharedCovariance::exact()).unwrap_err();
    let here = Transform::new(nalgebra::UnitQuaternion::identity(), Vector3::zeros());
    assert_eq!(refused(ImagePair { left_from_right: here, ..pair.images() }), MatchError::NoBaseline);
    let small = GrayImage::new(300, 320);
    assert!(matches!(refused(ImagePair { right: &small, ..pair.images() }), MatchError::ImageSize { .. }));
}
