//! Matching of rendered pairs whose truth is known.
#![allow(clippy::unwrap_used, reason = "a test that cannot be set up fails")]

mod common;

use common::{Pair, median};
use nalgebra::{UnitQuaternion, Vector3};
use rayon::ThreadPoolBuilder;
use vergence_matching::{GuidedMatcher, ImagePair, Matcher, Matches};
use vergence_vision::{Angle, Transform};

const SIDE: u32 = 640;

fn find(images: &ImagePair<'_>) -> Matches {
    GuidedMatcher::default().find(images).unwrap()
}

/// Fraction of matches within a pixel of the truth, median error in pixels, fraction with a depth more than 10 % wrong.
fn accuracy(pair: &Pair, matches: &Matches) -> [f64; 3] {
    let verdicts: Vec<_> = matches.pairs.iter().map(|found| pair.judge(found)).collect();
    let part = |count: usize| count as f64 / verdicts.len() as f64;
    let right = part(verdicts.iter().filter(|verdict| verdict.error_px < 1.0).count());
    let wrong = part(verdicts.iter().filter(|verdict| verdict.relative_depth_error > 0.1).count());
    [right, median(verdicts.iter().map(|verdict| verdict.error_px).collect()), wrong]
}

fn assert_accurate(pair: &Pair, matches: &Matches, least: usize) {
    assert!(matches.pairs.len() >= least, "{} matches, dropped {:?}", matches.pairs.len(), matches.dropped);
    let [right, error, wrong] = accuracy(pair, matches);
    assert!(right > 0.98, "{right:.4} of the matches are right");
    assert!(error < 0.12, "median error {error:.3} px");
    assert!(wrong < 0.02, "{wrong:.4} of the depths are wrong");
    // The error is shared by both images: √2 of the stated sigma of each.
    let within = |found: &&vergence_matching::Match| pair.judge(found).error_px < 2.45 * 2f64.sqrt() * found.sigma;
    let honest = matches.pairs.iter().filter(within).count() as f64 / matches.pairs.len() as f64;
    assert!(honest > 0.95, "{honest:.3} of the errors are within the 95 % circle of their sigma");
    let near = matches.pairs.iter().map(|found| pair.judge(found)).filter(|verdict| verdict.range_mm < 1500.0);
    let depth = median(near.map(|verdict| verdict.relative_depth_error).collect());
    assert!(depth < 0.005, "median depth error {depth:.4}");
}

#[test]
fn parallel_axes() {
    let pair = Pair::new(SIDE, Angle::from_deg(0.0));
    assert_accurate(&pair, &find(&pair.images()), 1200);
}

#[test]
fn axes_60_degrees_apart() {
    let pair = Pair::new(SIDE, Angle::from_deg(60.0));
    assert_accurate(&pair, &find(&pair.images()), 1000);
}

#[test]
fn axes_120_degrees_apart() {
    let pair = Pair::new(SIDE, Angle::from_deg(120.0));
    assert_accurate(&pair, &find(&pair.images()), 700);
}

#[test]
fn a_pose_known_to_half_a_degree_is_enough() {
    let pair = Pair::new(SIDE, Angle::from_deg(60.0));
    let mut images = pair.images();
    let error = UnitQuaternion::from_scaled_axis(Vector3::new(0.4, -0.3, 0.35).map(f64::to_radians));
    images.left_from_right = images.left_from_right * Transform::new(error, Vector3::zeros());
    let trusting = find(&images);
    images.pose_sigma = Angle::from_deg(0.5);
    let wary = find(&images);
    assert_accurate(&pair, &wary, 900);
    // With a wrong pose stated as exact, some matches are lost, or so many that the error is detected and they are
    // found.
    assert!(trusting.pairs.len() <= wary.pairs.len() + wary.pairs.len() / 20, "{}", trusting.pairs.len());
}

#[test]
fn every_left_keypoint_is_accounted_for() {
    let pair = Pair::new(320, Angle::from_deg(90.0));
    let matches = find(&pair.images());
    assert!(!matches.pairs.is_empty());
    assert_eq!(matches.pairs.len() + matches.dropped.values().sum::<usize>(), matches.left_keypoints);
}

#[test]
fn the_number_of_threads_does_not_matter() {
    let pair = Pair::new(320, Angle::from_deg(60.0));
    let on = |threads: usize| {
        ThreadPoolBuilder::new().num_threads(threads).build().unwrap().install(|| find(&pair.images()))
    };
    let one = on(1);
    assert!(!one.pairs.is_empty());
    assert_eq!(one, on(2));
    assert_eq!(one, on(5));
}

#[test]
fn a_darker_right_image_does_not_matter() {
    let pair = Pair::new(SIDE, Angle::from_deg(0.0));
    let mut darker = pair.right.clone();
    for pixel in darker.pixels_mut() {
        pixel.0[0] = (255.0 * (f64::from(pixel.0[0]) / 255.0).powf(1.5) * 0.7).round() as u8;
    }
    let images = ImagePair { right: &darker, ..pair.images() };
    assert_accurate(&pair, &find(&images), 900);
}
