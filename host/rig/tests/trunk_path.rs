//! Paths of the trunk between its modes, and from any shape to any other.
#![allow(clippy::expect_used, clippy::panic, reason = "a test fails loudly")]

use proptest::prelude::*;
use vergence_rig::linkage::{
    Branch, CornerLimits, Corners, FlatTrunk, LegSample, NoPath, PathEnd, SixBarError, TrunkBodies, TrunkBody,
    TrunkCameras, TrunkLinks, TrunkPath, WantedClearance,
};

fn trunk() -> FlatTrunk {
    FlatTrunk {
        links: TrunkLinks::default().six_bar(),
        cameras: TrunkCameras::default(),
        bodies: TrunkBodies::default(),
        limits: CornerLimits::default(),
    }
}

/// Both sides alike, with the side joints at `b` degrees.
fn symmetrical(b: f64) -> Corners {
    let corner = 180.0 - b / 2.0;
    Corners([corner, b, corner, corner, b, corner].map(f64::to_radians))
}

fn shape(driven: [f64; 3], branch: usize) -> Corners {
    trunk().links.shapes(driven.map(f64::to_radians)).expect("a shape")[branch]
}

fn samples(path: &TrunkPath) -> impl Iterator<Item = &LegSample> + Clone {
    path.legs.iter().flat_map(|leg| &leg.samples)
}

const MODES: [(&str, f64); 3] = [("gecko", 180.0), ("spider", 120.0), ("stick-bug", 20.0)];

/// Gecko is a dead centre: its own reserve is zero, and it is left and entered by a leg of at most 10 degrees.
#[test]
fn every_mode_leads_to_every_other_with_a_degree_of_reserve() {
    let wanted = WantedClearance::default();
    for (from, start) in MODES {
        for (to, goal) in MODES {
            let path = trunk().path(&symmetrical(start), &symmetrical(goal), &wanted).expect("a path");
            assert_eq!(path.kept, wanted, "{from} to {to}");
            let last = path.legs.last().and_then(|leg| leg.end()).map(|end| end.corners);
            assert!(from == to || close(&last.expect("an end"), &symmetrical(goal)), "{from} to {to}: {last:?}");
            let tight = samples(&path).filter(|sample| !sample.room.has(&wanted));
            let near_gecko = |sample: &LegSample| sample.shape.corners.0[1].to_degrees() > 168.0;
            assert!(tight.clone().all(near_gecko), "{from} to {to}");
            assert_eq!(tight.count() > 0, (from == "gecko") != (to == "gecko"), "{from} to {to}");
        }
    }
}

/// Along the straight way from gecko the side joints open so slowly that the loop has a reserve of a degree only after 22 degrees
/// of B; the planner bends the left side first.
#[test]
fn gecko_is_left_by_a_bend_of_one_side() {
    let path = trunk().path(&symmetrical(180.0), &symmetrical(120.0), &WantedClearance::default()).expect("a path");
    assert_eq!(path.legs.len(), 2);
    let [a, b, c, _, e, _] = path.legs[0].end().expect("an end").corners.0.map(f64::to_degrees);
    assert!(a < 90.5 && b < 178.5 && c < 90.5, "{a} {b} {c}");
    assert!(e < b - 10.0, "the passive side opens far: {e}");
    // A path that has less time than the straight way would take does not exist.
    assert!(path.seconds() > 1.5 && path.seconds() < 2.0, "{}", path.seconds());
}

#[test]
fn a_way_round_is_found_where_the_straight_one_is_blocked() {
    // They lean to different sides; halfway between them the loop has too little reserve.
    let wanted = WantedClearance::default();
    let (start, goal) = (shape([86.0, 192.0, 52.0], 0), shape([150.0, 80.0, 185.0], 0));
    let path = trunk().path(&start, &goal, &wanted).expect("a path");
    assert!(path.legs.len() > 1);
}

#[test]
fn what_cannot_be_is_refused_with_a_reason() {
    let spider = symmetrical(120.0);
    let path = |goal: Corners| trunk().path(&spider, &goal, &WantedClearance::default());
    let open = path(Corners([91.0, 180.0, 90.0, 90.0, 180.0, 90.0].map(f64::to_radians)));
    let why = "the goal is no shape of the trunk: corners D and F are 281.745 mm apart, and the links between them reach 280.000 mm";
    assert!(matches!(open, Err(NoPath::NotClosed { end: PathEnd::Goal, why: SixBarError::TooFar { .. } })));
    assert_eq!(open.map_err(|error| error.to_string()), Err(why.into()));

    let flat = path(symmetrical(10.0));
    let Err(NoPath::Collides { end: PathEnd::Goal, gap }) = flat else { panic!("{flat:?}") };
    assert_eq!(gap.between[1], TrunkBody::Link(5), "the front link touches what is behind it");
    // Corner A is 140 mm times the sine of 10 degrees from the line BC, and each link is 30 mm wide.
    assert!((gap.mm - (140.0 * 10_f64.to_radians().sin() - 30.0)).abs() < 1e-9, "{gap:?}");

    let narrow = path(symmetrical(344.0));
    assert!(matches!(narrow, Err(NoPath::BeyondRange { .. } | NoPath::Collides { .. })), "{narrow:?}");
    assert_eq!(path(shape([80.0, 170.0, 90.0], 1)), Err(NoPath::OtherBranch));
}

/// Where nothing has the wanted room, the path says what it keeps.
#[test]
fn a_clearance_that_nothing_has_is_lowered_and_told() {
    let wanted = WantedClearance { loop_reserve: 20_f64.to_radians(), gap_mm: 3.0 };
    let path = trunk().path(&symmetrical(120.0), &symmetrical(20.0), &wanted).expect("a path");
    assert!(path.kept.loop_reserve < wanted.loop_reserve && path.kept.loop_reserve > 1_f64.to_radians());
    // Spider has some 9 degrees itself, stick-bug 6: both are left and entered like a dead centre.
    assert!(samples(&path).any(|sample| sample.room.has(&path.kept)));
}

#[test]
fn the_reserve_is_the_angle_by_which_the_joints_may_be_off() {
    // The worst of all corners of the box, in degrees, where the loop just closes.
    for driven in [[100.0, 150.0, 100.0], [120.0, 120.0, 120.0], [80.0, 170.0, 90.0]] {
        let reserve = trunk().clearance(&shape(driven, 0)).loop_reserve.to_degrees();
        let closes = |by: f64| {
            (0..8).all(|signs| {
                let off: [f64; 3] =
                    std::array::from_fn(|corner| driven[corner] + if signs >> corner & 1 == 0 { by } else { -by });
                trunk().links.shapes(off.map(f64::to_radians)).is_ok()
            })
        };
        assert!(closes(0.8 * reserve) && !closes(1.3 * reserve), "{driven:?}: {reserve}");
    }
}

fn close(one: &Corners, other: &Corners) -> bool {
    one.0.iter().zip(other.0).all(|(one, other)| (one - other).abs() < 1e-6)
}

/// Shapes in which nothing touches, of the outward branch.
fn allowed() -> impl Strategy<Value = Corners> {
    [30.0..200.0, 15.0..260.0, 30.0..200.0_f64].prop_filter_map("an allowed shape", |driven: [f64; 3]| {
        let shapes = trunk().links.shapes(driven.map(f64::to_radians)).ok()?;
        let shape = *shapes.first()?;
        let room = trunk().clearance(&shape);
        (!room.is_forbidden() && Branch::of(&shape) == Some(Branch::Outward)).then_some(shape)
    })
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(40))]

    #[test]
    fn a_path_is_continuous_and_has_the_room_it_tells(start in allowed(), goal in allowed()) {
        let path = match trunk().path(&start, &goal, &WantedClearance::default()) {
            Ok(path) => path,
            Err(error) => { prop_assert_eq!(error, NoPath::NoWay); return Ok(()) }
        };
        let mut last = start;
        for sample in samples(&path) {
            let moved = (0..3).map(|corner| (sample.shape.corners.0[corner] - last.0[corner]).abs()).fold(0.0, f64::max);
            prop_assert!(moved < 0.01, "{} degrees at once", moved.to_degrees());
            let closed = trunk().links.shapes([0, 1, 2].map(|corner: usize| sample.shape.corners.0[corner])).expect("it closes");
            prop_assert!(close(&closed[0], &sample.shape.corners));
            prop_assert!(!sample.room.is_forbidden());
            last = sample.shape.corners;
        }
        prop_assert!(close(&last, &goal), "{:?}", last);
        // Tight shapes are only near the ends.
        let tight = samples(&path).filter(|sample| !sample.room.has(&path.kept));
        for sample in tight {
            let from = |end: &Corners| {
                (0..3).map(|corner| (sample.shape.corners.0[corner] - end.0[corner]).abs()).fold(0.0, f64::max)
            };
            prop_assert!(from(&start).min(from(&goal)) <= 10.1_f64.to_radians());
        }
    }
}

/// Regression: a trunk at its dead centre read a shape that no links can have, and had no way out.
#[test]
fn readings_beyond_the_dead_centre_begin_a_path_at_the_nearest_shape() {
    let read = |degrees: [f64; 3]| {
        let driven = degrees.map(f64::to_radians);
        assert!(matches!(trunk().links.shapes(driven), Err(SixBarError::TooFar { .. })), "{degrees:?}");
        trunk().links.outward_or_straight(driven)
    };
    for off in [0.2, 0.7, 1.5] {
        let read = read([90.0 + off, 180.0 - off / 2.0, 90.0 + off]);
        let path = trunk().path(&read, &symmetrical(120.0), &WantedClearance::default()).expect("a way out");
        let start = path.legs[0].samples[0].shape.corners;
        let apart = (0..3).map(|corner| (start.0[corner] - read.0[corner]).abs()).fold(0.0, f64::max);
        assert!(apart < 2.5 * off.to_radians(), "{off}: {} degrees", apart.to_degrees());
    }
    // Ten degrees are no noise.
    let wrong = read([100.0, 180.0, 100.0]);
    let no_path = trunk().path(&wrong, &symmetrical(120.0), &WantedClearance::default());
    assert!(matches!(no_path, Err(NoPath::NotClosed { end: PathEnd::Start, .. })), "{no_path:?}");
}
