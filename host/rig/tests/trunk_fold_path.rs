//! Paths of the trunk to, from and among folded shapes.
#![allow(clippy::expect_used, clippy::panic, reason = "a test fails loudly")]

use std::f64::consts::PI;

use proptest::prelude::*;
use vergence_rig::linkage::{
    Branch, CornerLimits, Corners, FlatTrunk, FoldingTrunk, LegSample, NoPath, PathEnd, TrunkBodies, TrunkBody,
    TrunkCameras, TrunkLinks, TrunkPath, TrunkShape, WantedClearance, trunk,
};
use vergence_rig::{Rig, RigTrunk};

fn folding() -> FoldingTrunk {
    let links = TrunkLinks::default();
    let flat = FlatTrunk {
        links: links.six_bar(),
        cameras: TrunkCameras::default(),
        bodies: TrunkBodies::default(),
        limits: CornerLimits::default(),
    };
    FoldingTrunk { flat, links }
}

/// Side joints and folds in degrees.
fn folded(side_joint: f64, fold: f64) -> TrunkShape {
    TrunkShape::alike(side_joint.to_radians(), fold.to_radians())
}

fn path(start: &TrunkShape, goal: &TrunkShape) -> Result<TrunkPath, NoPath> {
    folding().path(start, goal, &WantedClearance::default())
}

fn samples(path: &TrunkPath) -> impl Iterator<Item = &LegSample> + Clone {
    path.legs.iter().flat_map(|leg| &leg.samples)
}

fn driven(shape: &TrunkShape) -> [f64; 5] {
    let Corners([a, b, c, ..]) = shape.corners;
    [a, b, c, shape.fold, shape.fold]
}

fn apart(one: &TrunkShape, other: &TrunkShape) -> f64 {
    driven(one).iter().zip(driven(other)).map(|(one, other)| (one - other).abs()).fold(0.0, f64::max)
}

/// 90 degrees at 60 degrees a second, reached in half a second.
#[test]
fn a_fold_from_a_free_shape_is_one_straight_leg() {
    let path = path(&folded(120.0, 180.0), &folded(120.0, 90.0)).expect("a path");
    assert!((path.legs.len(), path.kept) == (1, WantedClearance::default()) && (path.seconds() - 2.0).abs() < 1e-9);
    let end = path.legs[0].end().expect("an end");
    assert!(apart(end, &folded(120.0, 90.0)) == 0.0);
}

/// All joints run at once where that is allowed: the folds have 80 degrees to go, the side joints 60.
#[test]
fn sides_and_folds_move_together() {
    let path = path(&folded(120.0, 180.0), &folded(60.0, 100.0)).expect("a path");
    assert!(path.legs.len() == 1 && (path.seconds() - (80.0 / 60.0 + 0.5)).abs() < 1e-9, "{}", path.seconds());
}

/// Gecko can fold, but its sides are at the dead centre: they bend first, and the loop is folded with a degree of reserve.
#[test]
fn gecko_bends_before_it_folds() {
    for (start, goal) in [((180.0, 180.0), (120.0, 90.0)), ((100.0, 90.0), (180.0, 180.0))] {
        let Ok(path) = path(&folded(start.0, start.1), &folded(goal.0, goal.1)) else { panic!("no path to {goal:?}") };
        assert_eq!(path.kept, WantedClearance::default());
        let tight = |sample: &&LegSample| !sample.room.has(&path.kept);
        for sample in samples(&path).filter(tight) {
            assert!(apart(&sample.shape, &folded(180.0, 180.0)) < 10.1_f64.to_radians(), "{sample:?}");
        }
    }
}

/// Shapes with a degree of reserve and 3 mm between bodies, by steps of 30 degrees: from every mode a path leads to each, and back.
#[test]
fn every_folded_shape_with_room_is_reached_from_every_mode() {
    let steps = |from: u32, to: u32| (from..=to).step_by(30).map(f64::from);
    let all = steps(30, 150).flat_map(|side_joint| steps(0, 240).map(move |fold| folded(side_joint, fold)));
    let roomy: Vec<TrunkShape> =
        all.filter(|shape| folding().clearance(shape).has(&WantedClearance::default())).collect();
    assert!(roomy.len() > 20, "{}", roomy.len());
    for shape in &roomy {
        for mode in [180.0, 120.0, 20.0].map(|side_joint| folded(side_joint, 180.0)) {
            for (start, goal) in [(&mode, shape), (shape, &mode)] {
                let path = path(start, goal).expect("a path");
                assert_eq!(path.kept, WantedClearance::default(), "{start:?} {goal:?}");
            }
        }
    }
}

/// Folded with straight sides the trunk is at a dead centre that it can leave with both sides alike only: it then keeps less, and says so.
#[test]
fn straight_sides_are_left_with_less_reserve() {
    let path = path(&folded(180.0, 100.0), &folded(120.0, 180.0)).expect("a path");
    let wanted = WantedClearance::default().loop_reserve;
    assert!(path.kept.loop_reserve > 0.0 && path.kept.loop_reserve < wanted, "{:?}", path.kept);
    assert_eq!(samples(&path).next().map(|sample| sample.room.loop_reserve < 1e-9), Some(true));
}

/// A mode of the robot folds the trunk wholly (mammal, folds at 0): with the assumed round bodies its cameras would be in each other.
#[test]
fn what_cannot_be_is_refused_with_a_reason() {
    let spider = folded(120.0, 180.0);
    let whole = path(&spider, &folded(180.0, 0.0));
    let Err(NoPath::Collides { end: PathEnd::Goal, gap }) = whole else { panic!("{whole:?}") };
    assert_eq!(gap.between, [TrunkBody::LeftCamera, TrunkBody::RightCamera]);
    // Each camera lies 10 mm below the hinge.
    assert!((gap.mm - (20.0 - 36.0)).abs() < 1e-9, "{gap:?}");
    assert!(matches!(path(&spider, &folded(120.0, 250.0)), Err(NoPath::BeyondRange { end: PathEnd::Goal, .. })));
    assert_eq!(path(&spider, &folded(190.0, 120.0)).map(|_| ()), Err(NoPath::OtherBranch));
    let lop = TrunkShape {
        fold: 2.0,
        ..TrunkShape::flat(Corners([80.0, 170.0, 90.0, 123.5, 121.5, 134.9].map(f64::to_radians)))
    };
    assert!(matches!(path(&spider, &lop), Err(NoPath::NotAlike { end: PathEnd::Goal, .. })));
}

fn robot() -> (Rig, Box<RigTrunk>) {
    let rig = Rig::from_toml(include_str!("../../../docs/rigs/origaker.toml")).expect("the robot's file");
    let trunk = rig.trunk.clone().expect("a trunk");
    (rig, trunk)
}

/// Readings of a folded trunk differ from a closed shape by play; a trunk of which one fold alone is folded is wrong.
#[test]
fn readings_begin_at_the_nearest_closed_shape() {
    let (_, trunk) = robot();
    let values = |degrees: [f64; 5]| degrees.map(f64::to_radians);
    let wanted = WantedClearance::default();
    let goal = values([120.0, 120.0, 120.0, 180.0, 180.0]);
    let read = trunk.path(&values([119.7, 120.2, 120.4, 89.8, 90.3]), &goal, &wanted).expect("a path");
    let start = read.legs[0].samples[0].shape;
    assert!(apart(&start, &folded(120.0, 90.0)) < 0.4_f64.to_radians(), "{start:?}");
    let wrong = trunk.path(&values([120.0, 120.0, 120.0, 180.0, 120.0]), &goal, &wanted);
    assert!(
        matches!(wrong, Err(NoPath::NotAlike { end: PathEnd::Start, by }) if (by.to_degrees() - 30.0).abs() < 1e-6)
    );
    let wrong = trunk.path(&values([110.0, 120.0, 120.0, 90.0, 90.0]), &goal, &wanted).map(|_| ());
    let why = wrong.expect_err("both sides differ").to_string();
    assert!(why.starts_with("folded, the loop closes only with both sides alike") && why.contains("start"), "{why}");
}

/// Shapes in which nothing touches, of the outward branch.
fn flat() -> impl Strategy<Value = TrunkShape> {
    [30.0..200.0, 15.0..260.0, 30.0..200.0_f64].prop_filter_map("an allowed shape", |degrees: [f64; 3]| {
        let shapes = folding().flat.links.shapes(degrees.map(f64::to_radians)).ok()?;
        let shape = *shapes.first()?;
        let room = folding().flat.clearance(&shape);
        (!room.is_forbidden() && Branch::of(&shape) == Some(Branch::Outward)).then(|| TrunkShape::flat(shape))
    })
}

fn folded_shape() -> impl Strategy<Value = TrunkShape> {
    (15.0..179.9_f64, 5.0..239.9_f64).prop_filter_map("an allowed shape", |(side_joint, fold)| {
        let shape = folded(side_joint, fold);
        (!folding().clearance(&shape).is_forbidden()).then_some(shape)
    })
}

fn any_pair() -> impl Strategy<Value = [TrunkShape; 2]> {
    prop_oneof![
        (folded_shape(), flat()).prop_map(|(one, other)| [one, other]),
        (flat(), folded_shape()).prop_map(|(one, other)| [one, other]),
        (folded_shape(), folded_shape()).prop_map(|(one, other)| [one, other]),
    ]
}

/// `PROPTEST_CASES=1500` plays that many.
fn cases() -> ProptestConfig {
    let set = std::env::var_os("PROPTEST_CASES").is_some();
    if set { ProptestConfig::default() } else { ProptestConfig::with_cases(60) }
}

proptest! {
    #![proptest_config(cases())]

    #[test]
    fn a_path_is_closed_continuous_and_has_the_room_it_tells([start, goal] in any_pair()) {
        let path = match path(&start, &goal) {
            Ok(path) => path,
            Err(error) => { prop_assert_eq!(error, NoPath::NoWay); return Ok(()) }
        };
        let (linkage, trunk) = (trunk(&folding().links), folding());
        let mut last = start;
        for sample in samples(&path) {
            prop_assert!(apart(&sample.shape, &last) < 0.01, "from {last:?} to {sample:?}");
            let error = linkage.closure_error(&sample.shape.trunk_angles());
            prop_assert!(error < 1e-12, "{error:e} at {sample:?}");
            let room = trunk.clearance(&sample.shape);
            prop_assert!(!room.is_forbidden() && !sample.room.is_forbidden());
            prop_assert!((room.loop_reserve - sample.room.loop_reserve).abs() < 1e-6, "{room:?} {sample:?}");
            if !sample.room.has(&path.kept) {
                let from_end = apart(&sample.shape, &start).min(apart(&sample.shape, &goal));
                prop_assert!(from_end <= 10.1_f64.to_radians(), "{sample:?}");
            }
            last = sample.shape;
        }
        prop_assert!(apart(&last, &goal) < 1e-12, "{last:?}");
        prop_assert!(path.legs.is_empty() || apart(&path.legs[0].samples[0].shape, &start) < 1e-12);
    }

    /// No slower than one part after the other, over any flat shape with both sides alike that is free.
    #[test]
    fn a_path_is_no_slower_than_straightening_the_folds_first(start in folded_shape(), goal in any_pair()) {
        let goal = goal[0];
        let Ok(whole) = path(&start, &goal) else { return Ok(()) };
        let [first, last] = [&start, &goal].map(|end| TrunkShape::flat(end.corners));
        let trunk = folding();
        let is_free = |shape: &TrunkShape| {
            trunk.clearance(shape).has(&whole.kept) && (shape.side_joint_alike().is_some() || shape == &last)
        };
        if !is_free(&first) || !(goal.is_flat() || is_free(&last)) {
            return Ok(());
        }
        let mut seconds = 0.0;
        for (from, to) in [(&start, &first), (&first, &last), (&last, &goal)] {
            match trunk.path(from, to, &whole.kept) {
                Ok(part) if part.kept == whole.kept => seconds += part.seconds(),
                _ => return Ok(()),
            }
        }
        // The parts are looked for anew, among shapes of one fold: the search keeps to a hundredth of a second.
        prop_assert!(whole.seconds() <= seconds + 0.01, "{} against {seconds}", whole.seconds());
    }

    /// The bodies in space are where the loop puts the cameras, and flat shapes have the same room by both ways.
    #[test]
    fn bodies_in_space_are_those_of_the_loop(side_joint in 15.0..179.9_f64, fold in 5.0..239.9_f64) {
        let (shape, trunk_loop) = (folded(side_joint, fold), trunk(&folding().links));
        let gap = folding().clearance(&shape).gap;
        let cameras = folding().flat.cameras.left_from_right(&trunk_loop, &shape.trunk_angles());
        let between_cameras = cameras.origin().mm().norm() - 36.0;
        prop_assert!(gap.mm <= between_cameras + 1e-9);
        if gap.between == [TrunkBody::LeftCamera, TrunkBody::RightCamera] {
            prop_assert!((gap.mm - between_cameras).abs() < 1e-9, "{gap:?} {between_cameras}");
        }
        let [flat, nearly] = [PI, PI - 1e-7].map(|fold| {
            folding().clearance(&TrunkShape::alike(side_joint.to_radians(), fold))
        });
        prop_assert!((flat.loop_reserve - nearly.loop_reserve).abs() < 1e-5);
        // Halves of the end links keep from the other side's links, which flat they share a corner with.
        prop_assert!(nearly.gap.mm <= flat.gap.mm + 1e-4);
    }
}
