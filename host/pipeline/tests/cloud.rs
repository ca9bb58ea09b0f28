//! Clouds of a pair whose matches are known.
#![allow(clippy::expect_used, reason = "a test fails loudly")]

use std::collections::BTreeMap;

use image::RgbImage;
use vergence_matching::{GuidedMatcher, ImagePair, Match, MatchError, Matcher, Matches, UnmatchedReason};
use vergence_pipeline::{
    Method, Motion, PairCloud, PairCloudError, PairImages, PairPose, Stage, TriggeredImage, UnpairedImage, pair_cloud,
    pair_exposure,
};
use vergence_protocol::Counts;
use vergence_rig::{
    BENCH_TOML, BoardInstant, ExposureDelay, HostInstant, JointsAt, Rig, RigPose, StampedImage, SteadyMotion,
    TimedEvent,
};
use vergence_vision::{DropReason, Left, Pixel, Point};

fn rig() -> Rig {
    Rig::from_toml(BENCH_TOML).expect("a rig")
}

fn standing(rig: &Rig) -> RigPose {
    rig.pose_read_at(&[145.0, 60f64.to_radians()])
}

/// A matcher that finds the images of known points in the left frame, in millimetres, the last of them 30 pixels off its
/// epipolar curve, and gives up five keypoints.
struct Known {
    rig: Rig,
    points: Vec<[f64; 3]>,
}

impl Matcher for Known {
    fn name(&self) -> &str {
        "known"
    }

    fn find(&self, pair: &ImagePair<'_>) -> Result<Matches, MatchError> {
        let right_from_left = pair.left_from_right.inverse();
        let placed = |&[x, y, z]: &[f64; 3]| {
            let point = Point::<Left>::from_mm(nalgebra::Vector3::new(x, y, z));
            let left = self.rig.left_camera.project_point(&point).expect("in the left field");
            let right = self.rig.right_camera.project_point(&(right_from_left * point)).expect("in the right field");
            Match { left, right, sigma: 0.2.into(), score: 0.9, registered: true, track: None }
        };
        let mut pairs: Vec<Match> = self.points.iter().map(placed).collect();
        if let Some(wrong) = pairs.last_mut() {
            wrong.right = Pixel { v: wrong.right.v + 30.0, ..wrong.right };
        }
        let dropped = BTreeMap::from([(UnmatchedReason::Epipolar, 3), (UnmatchedReason::Uncertain, 2)]);
        let left_keypoints = pairs.len() + 5;
        Ok(Matches { pairs, dropped, left_keypoints, right_keypoints: left_keypoints })
    }
}

fn cloud_in(pose: &PairPose, ended: &mut dyn FnMut(Stage)) -> PairCloud {
    let points = vec![[30.0, 10.0, 500.0], [90.0, -60.0, 600.0], [72.0, 0.0, 450.0]];
    let (rig, matcher) = (rig(), Known { rig: rig(), points });
    let image = RgbImage::new(1, 1);
    let images = PairImages { left: &image, right: &image };
    let matcher: &dyn Matcher = &matcher;
    let method = Method::from(matcher);
    pair_cloud(images, &rig, pose, method, ended).expect("a cloud")
}

/// Both the matcher and the cloud have a reason called `epipolar`: a keypoint without a match is not a match without a point.
#[test]
fn dropped_keypoints_and_dropped_matches_are_counted_apart() {
    let mut stages = Vec::new();
    let cloud = cloud_in(&PairPose::standing(standing(&rig())), &mut |stage| stages.push(stage));
    assert_eq!((cloud.points.len(), cloud.matches, cloud.keypoints), (2, 3, 8));
    assert_eq!(cloud.dropped.matches, BTreeMap::from([(DropReason::Epipolar, 1)]));
    assert_eq!(
        cloud.dropped.keypoints,
        BTreeMap::from([(UnmatchedReason::Epipolar, 3), (UnmatchedReason::Uncertain, 2)])
    );
    assert_eq!(stages, [Stage::Match, Stage::Triangulate]);
    assert!(cloud.points.iter().all(|point| (point.score - 0.9).abs() < 1e-6));
    assert!((cloud.points[0].point.point.mm().z - 500.0).abs() < 1e-6);
}

/// Joints in counts: 60 degrees and 145 mm.
fn joints(rig: &Rig) -> JointsAt {
    let counts: Vec<f64> =
        rig.axes.iter().zip([145.0, 60f64.to_radians()]).map(|(axis, value)| axis.counts_at(value)).collect();
    JointsAt { sigma: vec![0.3; counts.len()], timing: vec![0.0; counts.len()], counts }
}

/// A rig that stands still gives the same points whether one pose serves the pair or every row has its own.
#[test]
fn a_rig_at_rest_measures_the_same_row_by_row() {
    let rig = rig();
    let motion = Motion::Steady(SteadyMotion { from_us: 0.0, joints: joints(&rig), rates: vec![0.0; rig.axes.len()] });
    let middle = BoardInstant { us: 0.0, error_us: 0.0 };
    let rows = PairPose::in_motion(&rig, motion, pair_exposure(&rig, [middle; 2])).expect("a pose");
    assert!(rows.is_steady() && !rows.is_moving());
    let (rows, whole) = (cloud_in(&rows, &mut |_| ()), cloud_in(&PairPose::standing(standing(&rig)), &mut |_| ()));
    assert_eq!(rows.points.len(), whole.points.len());
    for (row, whole) in rows.points.iter().zip(&whole.points) {
        assert!((row.point.point.mm() - whole.point.point.mm()).norm() < 1e-6);
    }
}

#[test]
fn a_moving_rig_says_so() {
    let rig = rig();
    // Ten counts in a millisecond.
    let motion = Motion::Steady(SteadyMotion { from_us: 0.0, joints: joints(&rig), rates: vec![0.01; rig.axes.len()] });
    let middle = BoardInstant { us: 0.0, error_us: 0.0 };
    let pose = PairPose::in_motion(&rig, motion, pair_exposure(&rig, [middle; 2])).expect("a pose");
    assert!(pose.is_moving());
}

#[test]
fn an_image_of_another_pulse_has_no_pose() {
    let rig = rig();
    let counts: Vec<Counts> = joints(&rig).counts.iter().map(|&count| Counts(count.round() as i32)).collect();
    let image = |us: f64| TriggeredImage {
        pulse: TimedEvent { seq: 4, at: HostInstant { us: 1e6, error_us: 0.0 } },
        counts: &counts,
        stamp: StampedImage { seq: 0, middle: HostInstant { us, error_us: 0.0 } },
        delay: ExposureDelay { least_us: 0.0, most_us: 50_000.0 },
    };
    let pose = PairPose::at_pulse(&rig, &image(1.02e6)).expect("its own pulse");
    assert_eq!(pose.at_middle(), &rig.pose(&JointsAt::latched(&counts)));
    assert_eq!(PairPose::at_pulse(&rig, &image(0.9e6)).err(), Some(UnpairedImage));
}

/// A trunk whose joints read what its links cannot do is no pose to measure with.
#[test]
fn a_trunk_that_does_not_close_gives_no_cloud() {
    let rig = Rig::from_toml(include_str!("../../../docs/rigs/origaker.toml")).expect("the robot's file");
    let images = [(); 2].map(|()| RgbImage::new(1280, 1280));
    let cloud = |front_corner: f64| {
        let values = [front_corner, 90.0, 180.0, 180.0, 180.0].map(f64::to_radians);
        let pose = PairPose::standing(rig.pose_read_at(&values));
        let pair = PairImages { left: &images[0], right: &images[1] };
        let matcher: &dyn Matcher = &GuidedMatcher::default();
        pair_cloud(pair, &rig, &pose, Method::from(matcher), &mut |_| ()).err()
    };
    let refused = cloud(97.0);
    assert!(matches!(&refused, Some(PairCloudError::Trunk(open)) if open.missed > 4.0), "{refused:?}");
    assert!(!matches!(cloud(90.0), Some(PairCloudError::Trunk(_))));
}
