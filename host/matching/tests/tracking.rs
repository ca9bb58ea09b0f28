//! The tracking matcher on rendered pairs that follow one another, while the stages turn the cameras against each other.
//!
//! `VERGENCE_SEEDS=50 cargo test -p vergence-matching --test tracking -- --nocapture` prints the figures of docs/measured/live.md.
#![allow(clippy::unwrap_used, clippy::print_stdout, reason = "a test fails loudly and shows its figures")]

#[path = "common/rendered.rs"]
mod rendered;

use std::collections::{BTreeMap, BTreeSet};

use nalgebra::Vector3;
use rendered::{CORRIDOR_HUMAN, HUMAN, Place, Rendered};
use vergence_matching::{GuidedMatcher, ImagePair, Match, Matcher, TrackingMatcher};
use vergence_scene::Scene;
use vergence_vision::{Angle, Left, Point, World};

const SIDE: u32 = 320;
/// Largest error of a right match, in pixels.
const RIGHT_PX: f64 = 2.5;
/// Largest distance of a place from where a track showed it first, as a part of the range: a few pixels on a slanted surface.
const SAME_PLACE: f64 = 0.03;

fn seeds() -> u64 {
    std::env::var("VERGENCE_SEEDS").map_or(1, |seeds| seeds.parse().unwrap())
}

/// Every seed stands and looks elsewhere; every fourth stands in the corridor.
fn place(seed: u64, separation_deg: f64) -> Place {
    let step = seed as f64 % 12.0;
    let scene = if seed % 4 == 3 { CORRIDOR_HUMAN.scene } else { HUMAN.scene };
    let at = [60.0 - 30.0 * step, -40.0 + 18.0 * step, 50.0 - 22.0 * step];
    Place { scene, at, heading_deg: 20.0 + 47.0 * seed as f64, separation_deg, ..HUMAN }
}

/// A pair with the uncertainty of the pose that the pipeline gives to matchers.
fn pair(truth: &Rendered) -> ImagePair<'_> {
    ImagePair { pose_sigma: Angle::from_deg(0.15), ..truth.pair(Vector3::zeros()) }
}

/// The point in the scene that the left pixel of a match shows.
fn shown(place: &Place, scene: &Scene, truth: &Rendered, found: &Match) -> Option<Point<World>> {
    let world_from_left = place.world_from_left();
    let ray = world_from_left * truth.camera.unproject::<Left>(found.left).ok()?;
    let range = scene.cast(&world_from_left.origin(), &ray)?.range;
    Some(Point::from_mm(world_from_left.origin().mm() + ray.vector() * range.mm()))
}

/// Whether the right pixel shows what the left pixel, or one beside it at an edge, shows.
fn is_right(place: &Place, scene: &Scene, truth: &Rendered, found: &Match) -> bool {
    [(0.0, 0.0), (0.8, 0.0), (-0.8, 0.0), (0.0, 0.8), (0.0, -0.8)].into_iter().any(|(du, dv)| {
        let beside = Match { left: vergence_vision::Pixel { u: found.left.u + du, v: found.left.v + dv }, ..*found };
        let range = |point: Point<World>| (point.mm() - place.world_from_left().origin().mm()).norm();
        let Some(range) = shown(place, scene, truth, &beside).map(range) else { return false };
        let ray = truth.camera.unproject::<Left>(found.left).unwrap();
        let there = truth.camera.project_point(&(truth.left_from_right.inverse() * ray.at(range)));
        there.is_ok_and(|there| (there.u - found.right.u).hypot(there.v - found.right.v) <= RIGHT_PX)
    })
}

/// Counts over a sequence.
#[derive(Default)]
struct Counts {
    matches: usize,
    right: usize,
    /// Of the single-pair matcher on the same pairs.
    alone: [usize; 2],
    /// Tracked points that both cameras still see in the next pair, and those of them that are still tracked.
    possible: usize,
    kept: usize,
    /// Tracked points after the first pair, and those that show another place than at first.
    tracked: usize,
    strayed: usize,
}

impl Counts {
    /// Follows the pairs of one place at these separations.
    fn add(&mut self, seed: u64, separations_deg: &[f64]) {
        let (tracking, alone) = (TrackingMatcher::default(), GuidedMatcher::default());
        let mut first: BTreeMap<u64, Point<World>> = BTreeMap::new();
        let mut before: Vec<(u64, Point<World>)> = Vec::new();
        let scene = (place(seed, 0.0).scene)();
        for (number, &separation) in separations_deg.iter().enumerate() {
            let place = place(seed, separation);
            let truth = place.rendered(SIDE, 100 * seed + number as u64);
            let found = tracking.find(&pair(&truth)).unwrap().pairs;
            self.matches += found.len();
            self.right += found.iter().filter(|found| is_right(&place, &scene, &truth, found)).count();
            if number % 6 == 0 {
                let found = alone.find(&pair(&truth)).unwrap().pairs;
                let right = found.iter().filter(|found| is_right(&place, &scene, &truth, found)).count();
                self.alone = [self.alone[0] + right, self.alone[1] + found.len()];
            }
            let now: Vec<(u64, Point<World>)> =
                found.iter().filter_map(|found| Some((found.track?, shown(&place, &scene, &truth, found)?))).collect();
            let numbers: BTreeSet<u64> = now.iter().map(|(track, _)| *track).collect();
            let left_from_world = place.world_from_left().inverse();
            for (track, point) in before.iter().filter(|(_, point)| sees(&truth, &(left_from_world * *point))) {
                self.possible += 1;
                self.kept += usize::from(numbers.contains(track) && point.mm().norm() > 0.0);
            }
            for (track, point) in &now {
                let origin = first.entry(*track).or_insert(*point);
                let range = (left_from_world * *point).mm().norm();
                self.tracked += usize::from(number > 0);
                self.strayed += usize::from((origin.mm() - point.mm()).norm() > SAME_PLACE * range);
            }
            before = now;
        }
    }
}

/// Whether both cameras see a point, well inside their fields.
fn sees(truth: &Rendered, point: &Point<Left>) -> bool {
    let margin = 12.0;
    let inside = |u: f64| (margin..f64::from(SIDE) - margin).contains(&u);
    let in_left = truth.camera.project_point(point).is_ok_and(|pixel| inside(pixel.u) && inside(pixel.v));
    let right = truth.left_from_right.inverse() * *point;
    let in_right = truth.camera.project_point(&right).is_ok_and(|pixel| inside(pixel.u) && inside(pixel.v));
    in_left && in_right && truth.is_seen_by_right(point)
}

/// From nearly parallel axes to 103 degrees and back a little, by 5 degrees from pair to pair: 75 degrees a second at 15 Hz, more than the
/// bench's stage can do.
#[test]
fn tracks_keep_their_places_through_a_change_of_the_mode() {
    let there = (0..20).map(|step| 8.0 + 5.0 * f64::from(step));
    let separations: Vec<f64> = there.chain([98.0, 93.0]).collect();
    let mut counts = Counts::default();
    (0..seeds()).for_each(|seed| counts.add(300 + seed, &separations));
    let part = |some: usize, all: usize| some as f64 / all as f64;
    let pairs = seeds() as usize * separations.len();
    println!(
        "{} matches a pair, {:.4} right (alone {:.4} of {}); {:.3} of {} tracks kept from pair to pair; {:.4} of {} strayed",
        counts.matches / pairs,
        part(counts.right, counts.matches),
        part(counts.alone[0], counts.alone[1]),
        counts.alone[1],
        part(counts.kept, counts.possible),
        counts.possible,
        part(counts.strayed, counts.tracked),
        counts.tracked,
    );
    assert!(counts.matches / pairs > 120, "{} matches a pair", counts.matches / pairs);
    assert!(part(counts.right, counts.matches) > part(counts.alone[0], counts.alone[1]) - 0.005);
    assert!(part(counts.kept, counts.possible) > 0.8);
    assert!(part(counts.strayed, counts.tracked) < 0.01);
}

/// Between two pairs the rig is carried to where everything looks different: no track may go on with another place.
#[test]
fn no_track_survives_in_another_scene() {
    let tracking = TrackingMatcher::default();
    let numbers = |place: Place, seed: u64| -> (BTreeSet<u64>, usize) {
        let truth = place.rendered(SIDE, seed);
        let found = tracking.find(&pair(&truth)).unwrap().pairs;
        (found.iter().filter_map(|found| found.track).collect(), found.len())
    };
    let (first, count) = numbers(place(0, 40.0), 1);
    let (same, _) = numbers(place(0, 40.0), 2);
    let (followed, kept) = (first.len(), first.intersection(&same).count());
    let (elsewhere, found) = numbers(Place { scene: CORRIDOR_HUMAN.scene, ..place(0, 40.0) }, 3);
    let survived = same.intersection(&elsewhere).count();
    println!("{count} matches, {kept} of {followed} tracks kept; {survived} survived among {found}");
    assert!(count > 120 && followed * 10 > 7 * count && kept * 10 > 9 * followed, "{kept} of {followed}, of {count}");
    assert!(found > 100 && survived * 100 < same.len(), "{survived} of {}", same.len());
}

/// A limit leaves few points, which are those of before where they were, all over the image; without it the others come back.
#[test]
fn fewer_points_are_spread_over_the_image() {
    let tracking = TrackingMatcher::default();
    let found = |seed: u64, most: Option<usize>| {
        let truth = place(0, 40.0).rendered(SIDE, seed);
        tracking.find_at_most(&pair(&truth), most).unwrap().pairs
    };
    let cells = |found: &[Match]| -> usize {
        let cell = |found: &Match| ((found.left.u / 40.0) as usize, (found.left.v / 40.0) as usize);
        found.iter().map(cell).collect::<BTreeSet<_>>().len()
    };
    let numbers = |found: &[Match]| -> BTreeSet<u64> { found.iter().filter_map(|found| found.track).collect() };
    found(1, None);
    let (all, few) = (found(2, None), found(3, Some(120)));
    let (kept, again) = (numbers(&few).intersection(&numbers(&all)).count(), found(4, None));
    println!(
        "{} points in {} cells, {} in {}, {kept} kept, then {}",
        all.len(),
        cells(&all),
        few.len(),
        cells(&few),
        again.len()
    );
    assert!((80..=135).contains(&few.len()) && kept * 10 > few.len() * 8);
    assert!(cells(&few) * 10 >= cells(&all) * 6, "{} of {}", cells(&few), cells(&all));
    assert!(again.len() > few.len());
}

/// Where there is no time for all points, a first pair takes a part of the work of a whole search, and the next pairs find what it left.
#[test]
fn the_first_search_is_bounded_where_time_is_short() {
    let first = |most: Option<usize>| {
        let truth = place(0, 40.0).rendered(SIDE, 1);
        TrackingMatcher::default().find_at_most(&pair(&truth), most).unwrap()
    };
    let (whole, bounded) = (first(None), first(Some(200)));
    let tracking = TrackingMatcher::default();
    let later = (1..=8).map(|seed| {
        let truth = place(0, 40.0).rendered(SIDE, seed);
        tracking.find_at_most(&pair(&truth), Some(200)).unwrap().pairs
    });
    let later: Vec<Vec<Match>> = later.collect();
    let high = |found: &[Match]| found.iter().filter(|found| found.left.v < f64::from(SIDE) / 4.0).count();
    let last = &later[later.len() - 1];
    println!(
        "{} of {} keypoints give {} points of {}, {} above; then {}, {} above",
        bounded.left_keypoints,
        whole.left_keypoints,
        bounded.pairs.len(),
        whole.pairs.len(),
        high(&bounded.pairs),
        last.len(),
        high(last),
    );
    assert!(bounded.left_keypoints * 2 < whole.left_keypoints && bounded.pairs.len() >= 60);
    assert!(last.len() >= 140 && high(last) >= 5 && high(last) > high(&bounded.pairs));
    assert_eq!(later[0], bounded.pairs, "the same pairs give the same matches");
}

/// A pair of other cameras has no tracks in common with the pair before; neither has an image of the wrong size, which is refused.
#[test]
fn other_cameras_begin_anew() {
    let tracking = TrackingMatcher::default();
    let (small, large) = (place(0, 40.0).rendered(SIDE, 1), place(0, 40.0).rendered(SIDE + 40, 1));
    let of = |truth: &Rendered| -> BTreeSet<u64> {
        tracking.find(&pair(truth)).unwrap().pairs.iter().filter_map(|found| found.track).collect()
    };
    let (first, other) = (of(&small), of(&large));
    assert!(first.len() > 100 && other.len() > 100 && first.is_disjoint(&other));
    assert!(tracking.find(&ImagePair { left: &small.grey[0], ..pair(&large) }).is_err());
    let again = of(&large);
    assert!(again.intersection(&other).count() * 10 > 9 * other.len(), "a refused pair changes nothing");
}
