//! Real photographs: pair 10 of sourishg/fisheye-stereo-calibration, two hand-held fisheye cameras of about 180° in an
//! office. The images live outside the repository, see `tests/common/data.rs`.
#![allow(clippy::unwrap_used, reason = "a test that cannot be set up fails")]

#[path = "../../../tests/common/data.rs"]
mod data;

use data::real_data;
use nalgebra::{Matrix3, Rotation3, UnitQuaternion, Vector3};
use vergence_matching::{GuidedMatcher, ImagePair, Matcher, SharedFrame};
use vergence_vision::{Angle, ImageSize, KannalaBrandt, Left, Length, Pixel, Right, Transform};

/// fx, fy, cx, cy, k1..k4 in the form θ (1 + k1 θ² + ...): bundle adjustment of 19 target views, RMS 0.5 px.
const LEFT: [f64; 8] = [
    228.458_513_786,
    228.308_671_792,
    472.034_638_777,
    307.708_045_327,
    -0.004_666_361_57,
    0.042_839_591_04,
    -0.036_053_789_23,
    0.008_271_426_85,
];
const RIGHT: [f64; 8] = [
    229.149_001_019,
    228.411_845_587,
    476.669_847_8,
    297.517_381_353,
    0.026_332_048_71,
    -0.044_963_992_8,
    0.048_849_332_86,
    -0.018_431_485_6,
];
/// The mean pose over the views; that of one pair scatters by 0.2° to 0.6° about it.
const RIGHT_FROM_LEFT: [f64; 9] = [
    0.999_993_886_17,
    -0.003_475_313_01,
    0.000_387_077_02,
    0.003_474_397_69,
    0.999_991_224_59,
    0.002_340_790_09,
    -0.000_395_208_6,
    -0.002_339_430_92,
    0.999_997_185_43,
];
const TRANSLATION_MM: [f64; 3] = [-109.440_414_38, -0.079_591_77, 3.032_998_81];

fn lens(p: &[f64; 8], half_field: f64) -> KannalaBrandt {
    let k = [p[0], p[0] * p[4], p[0] * p[5], p[0] * p[6], p[0] * p[7]];
    let size = ImageSize { width: 960, height: 600 };
    KannalaBrandt::new(k, p[1] / p[0], Pixel { u: p[2], v: p[3] }, Angle::from_deg(half_field), size).unwrap()
}

#[test]
fn an_office() {
    let Some(images) = real_data("data/sourishg_stereo/images") else { return };
    let [left, right] = ["left10.jpg", "right10.jpg"].map(|name| image::open(images.join(name)).unwrap().to_luma8());
    // The right lens's polynomial turns over soon after 83°.
    let (left_camera, right_camera) = (lens(&LEFT, 95.0), lens(&RIGHT, 83.0));
    let rotation = Rotation3::from_matrix(&Matrix3::from_row_slice(&RIGHT_FROM_LEFT));
    let right_from_left: Transform<Right, Left> =
        Transform::new(UnitQuaternion::from_rotation_matrix(&rotation), Vector3::from(TRANSLATION_MM));
    let pair = ImagePair {
        left: &left,
        right: &right,
        left_camera: &left_camera,
        right_camera: &right_camera,
        left_from_right: right_from_left.inverse(),
        pose_sigma: Angle::from_deg(0.5),
        nearest: Length::from_mm(250.0),
        masks: [None; 2],
    };
    let matches = GuidedMatcher::default().find(&pair).unwrap();
    assert!(matches.pairs.len() >= 400, "{} matches, dropped {:?}", matches.pairs.len(), matches.dropped);

    // The person with the target is near, the desks at the far wall are some metres away.
    let frame = SharedFrame::new(&pair.left_from_right).unwrap();
    let parallax = |found: &vergence_matching::Match| {
        let l = frame.shared_from_left() * left_camera.unproject::<Left>(found.left).unwrap();
        let r = frame.shared_from_right() * right_camera.unproject::<Right>(found.right).unwrap();
        Angle::from_rad(l.vector().x.asin() - r.vector().x.asin()).deg()
    };
    let within = |u: std::ops::Range<f64>, v: std::ops::Range<f64>| {
        let inside = matches.pairs.iter().filter(|found| u.contains(&found.left.u) && v.contains(&found.left.v));
        let mut angles: Vec<f64> = inside.map(parallax).collect();
        angles.sort_by(f64::total_cmp);
        angles
    };
    let (desks, seat) = (within(580.0..740.0, 280.0..380.0), within(440.0..600.0, 370.0..430.0));
    assert!(desks.len() >= 50 && seat.len() >= 10, "{} {}", desks.len(), seat.len());
    assert!((0.5..3.0).contains(&desks[desks.len() / 2]), "{}", desks[desks.len() / 2]);
    assert!((5.0..20.0).contains(&seat[seat.len() / 2]), "{}", seat[seat.len() / 2]);
}
