//! Errors of registered matches beside their stated standard deviations, along the epipolar curve and across it, in rendered rooms of both
//! modes. No place of this test had a part in the fit of the standard deviations.
//!
//! `VERGENCE_SEEDS=6 cargo test -p vergence-matching --test match_sigma -- --nocapture` prints the figures of docs/measured/matching.md.
#![allow(clippy::unwrap_used, clippy::print_stdout, reason = "a test fails loudly and shows its figures")]

#[path = "common/rendered.rs"]
mod rendered;

use nalgebra::{Vector2, Vector3};
use rendered::{CORRIDOR_HUMAN, HERBIVORE, HUMAN, Place, Rendered};
use vergence_matching::{GuidedMatcher, Match, Matcher};
use vergence_vision::{KannalaBrandt, Left, Pixel, Right, UnitRay};

const SIDE: u32 = 560;
/// Largest error of a match that counts as right, in pixels: the others are the score's concern.
const RIGHT_PX: f64 = 1.0;

/// Errors of a match in stated standard deviations, along and across.
type Errors = [f64; 2];
/// Matches that are less probably right are looked at by themselves as well: about one in eight.
const DOUBTFUL: f32 = 0.97;

/// Radians that a ray turns for a pixel at `at` in the image direction `towards`.
fn turn(camera: &KannalaBrandt, at: Pixel, towards: &Vector2<f64>) -> Option<f64> {
    let ray = |step: f64| {
        let beside = Pixel { u: at.u + step * towards.x, v: at.v + step * towards.y };
        camera.unproject::<Left>(beside).ok().map(|ray| ray.vector())
    };
    Some(ray(0.5)?.angle(&ray(-0.5)?))
}

/// The direction of the epipolar curve in an image, where it shows points of the ray at `range` and a little farther.
fn curve(show: impl Fn(f64) -> Option<Pixel>, range: f64) -> Option<Vector2<f64>> {
    let (near, far) = (show(0.99 * range)?, show(1.01 * range)?);
    Vector2::new(far.u - near.u, far.v - near.v).try_normalize(1e-9)
}

/// Error of the right pixel along and across the curve in pixels, and in the standard deviations that both pixels state together.
fn errors(found: &Match, truth: &Rendered, range: f64) -> Option<([f64; 2], Errors)> {
    let lens = &truth.camera;
    let from_right = truth.left_from_right;
    let left: UnitRay<Left> = lens.unproject(found.left).ok()?;
    let in_right = |range: f64| lens.project_point(&(from_right.inverse() * left.at(range))).ok();
    let shown = in_right(range)?;
    let along = curve(in_right, range)?;
    // The curve in the left image is that of the right camera's ray.
    let right: UnitRay<Right> = lens.unproject(found.right).ok()?;
    let from_right_range = (from_right.inverse() * left.at(range)).mm().norm();
    let along_left = curve(|range| lens.project_point(&(from_right * right.at(range))).ok(), from_right_range)?;
    let across = |along: &Vector2<f64>| Vector2::new(-along.y, along.x);
    let off = Vector2::new(found.right.u - shown.u, found.right.v - shown.v);
    let pixels = [off.dot(&along), off.dot(&across(&along))];
    let turns = |in_left: Vector2<f64>, in_right: Vector2<f64>| {
        let (left, right) = (turn(lens, found.left, &in_left)?, turn(lens, found.right, &in_right)?);
        Some(left.hypot(right) / right)
    };
    let both = [turns(along_left, along)?, turns(across(&along_left), across(&along))?];
    let sigma = [found.sigma.along, found.sigma.across];
    Some((pixels, [0, 1].map(|i| pixels[i] / (both[i] * sigma[i]))))
}

/// The errors of the right ones among the matches of a place, with their scores, and the part of the matches that is right.
fn judged(place: &Place, seed: u64) -> (Vec<(Errors, f32)>, f64) {
    let truth = place.rendered(SIDE, seed);
    let matches = GuidedMatcher::default().find(&truth.pair(Vector3::zeros())).unwrap();
    let (scene, world_from_left) = ((place.scene)(), place.world_from_left());
    let range = |found: &Match| {
        let ray = world_from_left * truth.camera.unproject::<Left>(found.left).ok()?;
        Some(scene.cast(&world_from_left.origin(), &ray)?.range.mm())
    };
    let of =
        |found: &Match| errors(found, &truth, range(found)?).map(|(pixels, errors)| (pixels, (errors, found.score)));
    let all: Vec<_> = matches.pairs.iter().filter_map(of).collect();
    let is_right = |pixels: &[f64; 2]| pixels[0].hypot(pixels[1]) < RIGHT_PX;
    let right: Vec<_> = all.iter().filter(|(pixels, _)| is_right(pixels)).map(|(_, errors)| *errors).collect();
    let part = right.len() as f64 / all.len() as f64;
    println!("{} at {:?}: {} matches, {part:.4} within {RIGHT_PX} px", place.name, place.at, matches.pairs.len());
    (right, part)
}

/// Mean of the squared errors along and across: two where the standard deviations are true.
fn nees(errors: &[Errors]) -> f64 {
    errors.iter().flatten().map(|error| error.powi(2)).sum::<f64>() / errors.len() as f64
}

/// Prints what is within one, two and three standard deviations, and asserts that it is what the words say.
fn assert_honest(name: &str, scored: &[(Errors, f32)], right: f64) {
    let errors: Vec<Errors> = scored.iter().map(|(errors, _)| *errors).collect();
    let of_all = nees(&errors);
    let doubtful: Vec<Errors> =
        scored.iter().filter(|(_, score)| *score < DOUBTFUL).map(|(errors, _)| *errors).collect();
    let of_doubtful = nees(&doubtful);
    for (i, way) in ["along", "across"].into_iter().enumerate() {
        let within =
            |sigmas: f64| errors.iter().filter(|errors| errors[i].abs() <= sigmas).count() as f64 / errors.len() as f64;
        let [one, two, three] = [1.0, 2.0, 3.0].map(within);
        println!("{name}, {way}: {one:.3}, {two:.3}, {three:.3} of {} within 1, 2, 3 sigma", errors.len());
        assert!((0.60..=0.85).contains(&one), "{name}, {way}: {one:.3} are within one sigma");
        assert!((0.92..=0.985).contains(&two), "{name}, {way}: {two:.3} are within two sigma");
    }
    println!("{name}: NEES of two {of_all:.2}, {right:.4} within {RIGHT_PX} px");
    println!("{name}: NEES of two {of_doubtful:.2} of {} with a score below {DOUBTFUL}", doubtful.len());
    assert!((1.2..=2.8).contains(&of_all), "{name}: mean squared error {of_all:.2} of two");
    assert!((1.0..=3.2).contains(&of_doubtful), "{name}: mean squared error {of_doubtful:.2} of two of doubtful ones");
    assert!(right > 0.985, "{name}: {right:.4} of the matches are right");
}

fn assert_mode_honest(name: &str, place: &Place) {
    let seeds = std::env::var("VERGENCE_SEEDS").map_or(1, |seeds| seeds.parse().unwrap());
    let (mut errors, mut right) = (Vec::new(), 0.0);
    for seed in 0..seeds {
        // Every seed stands elsewhere and looks elsewhere; every fourth stands in the corridor.
        let step = seed as f64;
        let at = [70.0 - 35.0 * step, -45.0 + 20.0 * step, 55.0 - 25.0 * step];
        let scene = if seed % 4 == 3 { CORRIDOR_HUMAN.scene } else { place.scene };
        let place = Place { scene, at, heading_deg: 33.0 + 77.0 * step, ..*place };
        let (found, part) = judged(&place, 900 + seed);
        errors.extend(found);
        right += part / seeds as f64;
    }
    assert!(errors.len() > 400 * seeds as usize, "{} matches", errors.len());
    assert_honest(name, &errors, right);
}

#[test]
fn matches_of_parallel_axes_are_as_far_off_as_stated() {
    assert_mode_honest("human", &HUMAN);
}

#[test]
fn matches_of_axes_120_degrees_apart_are_as_far_off_as_stated() {
    assert_mode_honest("herbivore", &HERBIVORE);
}
