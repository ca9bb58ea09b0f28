//! Pairs that cannot be matched, and pairs without texture.
#![allow(clippy::unwrap_used, reason = "a test that cannot be set up fails")]

mod common;

use common::equidistant;
use image::{GrayImage, Luma};
use nalgebra::{UnitQuaternion, Vector3};
use vergence_matching::{GuidedMatcher, ImagePair, MatchError, Matcher, Side};
use vergence_vision::{Angle, ImageSize, KannalaBrandt, Length, Pixel, Transform};

const SIDE: u32 = 200;

fn find_in(image: &GrayImage, change: impl Fn(&mut ImagePair<'_>)) -> Result<vergence_matching::Matches, MatchError> {
    let camera = equidistant(SIDE);
    let mut pair = ImagePair {
        left: image,
        right: image,
        left_camera: &camera,
        right_camera: &camera,
        left_from_right: Transform::new(UnitQuaternion::identity(), Vector3::new(145.0, 0.0, 0.0)),
        pose_sigma: Angle::from_deg(0.1),
        nearest: Length::from_mm(300.0),
        masks: [None; 2],
    };
    change(&mut pair);
    GuidedMatcher::default().find(&pair)
}

#[test]
fn flat_images_have_no_matches() {
    for level in [0, 128, 255] {
        let flat = GrayImage::from_pixel(SIDE, SIDE, Luma([level]));
        let matches = find_in(&flat, |_| {}).unwrap();
        assert!(matches.pairs.is_empty());
        assert_eq!((matches.left_keypoints, matches.right_keypoints), (0, 0));
    }
}

#[test]
fn an_image_of_another_size_is_refused() {
    let image = GrayImage::new(SIDE, SIDE);
    let other = GrayImage::new(SIDE, SIDE - 1);
    let error = {
        let camera = equidistant(SIDE);
        let pair = ImagePair {
            left: &image,
            right: &other,
            left_camera: &camera,
            right_camera: &camera,
            left_from_right: Transform::new(UnitQuaternion::identity(), Vector3::new(145.0, 0.0, 0.0)),
            pose_sigma: Angle::from_deg(0.0),
            nearest: Length::from_mm(300.0),
            masks: [None; 2],
        };
        GuidedMatcher::default().find(&pair).unwrap_err()
    };
    let camera = ImageSize { width: SIDE, height: SIDE };
    assert_eq!(
        error,
        MatchError::ImageSize { side: Side::Right, image: ImageSize { height: SIDE - 1, ..camera }, camera }
    );
    assert_eq!(error.to_string(), "the right image is 200 x 199, its camera is calibrated for 200 x 200");
}

#[test]
fn an_empty_image_is_refused() {
    assert_eq!(find_in(&GrayImage::new(0, 0), |_| {}), Err(MatchError::EmptyImage(Side::Left)));
}

#[test]
fn cameras_at_one_place_are_refused() {
    let image = GrayImage::new(SIDE, SIDE);
    for place in [Vector3::zeros(), Vector3::new(f64::NAN, 0.0, 0.0)] {
        let coincide = |pair: &mut ImagePair<'_>| {
            pair.left_from_right = Transform::new(UnitQuaternion::identity(), place);
        };
        assert_eq!(find_in(&image, coincide), Err(MatchError::NoBaseline));
    }
}

#[test]
fn quantities_out_of_range_are_refused() {
    let image = GrayImage::new(SIDE, SIDE);
    for nearest in [0.0, -5.0, f64::INFINITY] {
        let nearest = Length::from_mm(nearest);
        assert_eq!(find_in(&image, |pair| pair.nearest = nearest), Err(MatchError::Nearest(nearest)));
    }
    for sigma in [-0.1, f64::INFINITY] {
        let sigma = Angle::from_deg(sigma);
        assert_eq!(find_in(&image, |pair| pair.pose_sigma = sigma), Err(MatchError::PoseSigma(sigma)));
    }
    let not_a_number = find_in(&image, |pair| pair.pose_sigma = Angle::from_rad(f64::NAN));
    assert!(matches!(not_a_number, Err(MatchError::PoseSigma(_))));
}

#[test]
fn cameras_without_a_shared_field_are_refused() {
    let size = ImageSize { width: SIDE, height: SIDE };
    let centre = Pixel { u: 99.5, v: 99.5 };
    let narrow = KannalaBrandt::new([100.0, 0.0, 0.0, 0.0, 0.0], 1.0, centre, Angle::from_deg(50.0), size).unwrap();
    let image = GrayImage::new(SIDE, SIDE);
    let back_to_back = UnitQuaternion::from_axis_angle(&Vector3::y_axis(), std::f64::consts::PI);
    let pair = ImagePair {
        left: &image,
        right: &image,
        left_camera: &narrow,
        right_camera: &narrow,
        left_from_right: Transform::new(back_to_back, Vector3::new(145.0, 0.0, 0.0)),
        pose_sigma: Angle::from_deg(0.0),
        nearest: Length::from_mm(300.0),
        masks: [None; 2],
    };
    assert_eq!(GuidedMatcher::default().find(&pair), Err(MatchError::NoSharedField));
}

#[test]
fn tiny_and_extreme_pairs_do_not_panic() {
    for side in [1, 2, 5, 17, 40] {
        let camera = equidistant(side);
        let image = GrayImage::from_fn(side, side, |x, y| Luma([((x * 37 + y * 91) % 256) as u8]));
        for (nearest, sigma, baseline) in [(1e-6, 0.0, 145.0), (1e9, 170.0, 1e-6), (300.0, 1e4, 1e9)] {
            let pair = ImagePair {
                left: &image,
                right: &image,
                left_camera: &camera,
                right_camera: &camera,
                left_from_right: Transform::new(UnitQuaternion::identity(), Vector3::new(0.0, baseline, 0.0)),
                pose_sigma: Angle::from_deg(sigma),
                nearest: Length::from_mm(nearest),
                masks: [None; 2],
            };
            for oversampling in [None, Some(f64::NAN), Some(-1.0), Some(1e9)] {
                let matcher = GuidedMatcher { keypoints: 100, oversampling };
                assert!(matches!(matcher.find(&pair), Ok(_) | Err(MatchError::NoSharedField)));
            }
        }
    }
}
