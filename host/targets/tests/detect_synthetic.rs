//! Targets rendered with known truth: found where they are, labelled as they are, and refused where there is none.

#![allow(clippy::unwrap_used, clippy::panic, reason = "a test fails by panicking")]
#![allow(clippy::print_stdout, reason = "measured figures are printed")]

use std::collections::BTreeMap;

use image::{DynamicImage, GrayImage, Luma};
use nalgebra::{UnitQuaternion, Vector3};
use vergence_scene::{Optics, Scene, Target, View, render};
use vergence_targets::{
    CornerQuality, DetectError, Detection, Placement, SearchedImage, TargetSpec, detect, detect_from,
};
use vergence_vision::{Angle, Camera, ImageSize, KannalaBrandt, Length, Pixel, Point, Transform, World};

const TARGET: Target = Target { columns: 9, rows: 6, square: Length::from_mm(24.0) };

fn spec(target: Target) -> TargetSpec {
    TargetSpec { columns: target.columns, rows: target.rows, square: target.square }
}

/// A lens of 196° on a square sensor of `side` pixels.
fn fisheye(side: u32) -> KannalaBrandt {
    let scale = f64::from(side) / 1280.0;
    let middle = 0.5 * f64::from(side) - 0.5;
    let k = [374.0 * scale, -6.0 * scale, 0.5 * scale, 0.0, 0.0];
    let centre = Pixel { u: middle + 0.3, v: middle - 0.2 };
    KannalaBrandt::new(k, 1.001, centre, Angle::from_deg(98.0), ImageSize { width: side, height: side }).unwrap()
}

/// Noise of 1.5 grey levels on grey; edges sampled so finely that it prevails.
fn optics(blur_px: f64) -> Optics {
    Optics { edge_samples: 60, blur_px, read_noise: 1.3, shot_noise: 1.1, ..Optics::default() }
}

/// A target that faces the camera at `theta` from its axis, in the direction `azimuth` (0° right, 90° down).
#[derive(Clone, Copy)]
struct Pose {
    theta_deg: f64,
    azimuth_deg: f64,
    roll_deg: f64,
    tilt_deg: f64,
    distance_mm: f64,
}

impl Pose {
    fn camera_from_target(self, target: Target) -> Transform<Camera, Target> {
        let [theta, azimuth, roll, tilt] =
            [self.theta_deg, self.azimuth_deg, self.roll_deg, self.tilt_deg].map(f64::to_radians);
        let turn = |axis: Vector3<f64>, angle: f64| UnitQuaternion::from_scaled_axis(axis * angle);
        let towards = turn(Vector3::new(-azimuth.sin(), azimuth.cos(), 0.0), theta);
        let rotation = towards * turn(Vector3::z(), roll) * turn(Vector3::y(), tilt);
        target.placed(rotation, towards * Vector3::z() * self.distance_mm)
    }
}

fn photograph(scene: &Scene, camera: &KannalaBrandt, optics: &Optics, seed: u64) -> GrayImage {
    let world_from_camera = Transform::<World, Camera>::new(UnitQuaternion::identity(), Vector3::zeros());
    DynamicImage::from(render(&View { scene, camera, world_from_camera, optics }, seed).image).to_luma8()
}

fn photograph_target(target: Target, pose: Pose, camera: &KannalaBrandt, optics: &Optics, seed: u64) -> GrayImage {
    photograph(&Scene::target_in_studio(target, pose.camera_from_target(target).renamed()), camera, optics, seed)
}

/// Pixels of the corners by column and row, where all four squares about them are seen to `part` of their side.
fn truth(target: Target, pose: Pose, camera: &KannalaBrandt, part: f64) -> BTreeMap<[i32; 2], Pixel> {
    let camera_from_target = pose.camera_from_target(target);
    let project = |x: f64, y: f64| {
        let point = Point::<Target>::from_mm(Vector3::new(x, y, 0.0) * target.square.mm());
        camera.project_point(&(camera_from_target * point)).ok().filter(|&pixel| camera.on_sensor(pixel))
    };
    let nodes = (0..target.rows as i32).flat_map(|j| (0..target.columns as i32).map(move |i| [i, j]));
    nodes
        .filter_map(|[i, j]| {
            let (x, y) = (f64::from(i), f64::from(j));
            let seen = [[-part, -part], [part, -part], [-part, part], [part, part]]
                .iter()
                .all(|[dx, dy]| project(x + dx, y + dy).is_some());
            Some(([i, j], project(x, y).filter(|_| seen)?))
        })
        .collect()
}

fn found(detection: &Detection, target: Target) -> Vec<([i32; 2], Pixel)> {
    let good = detection.corners.iter().filter(|corner| corner.quality == CornerQuality::Good);
    good.map(|corner| ([corner.index % target.columns, corner.index / target.columns].map(|n| n as i32), corner.pixel))
        .collect()
}

fn distance(a: Pixel, b: Pixel) -> f64 {
    (a.u - b.u).hypot(a.v - b.v)
}

/// Distances to the truth under the labelling that fits best among those the placement leaves open.
fn errors(detection: &Detection, target: Target, truth: &BTreeMap<[i32; 2], Pixel>) -> Vec<f64> {
    let (columns, rows) = (target.columns as i32, target.rows as i32);
    let shifts: Vec<[i32; 2]> = match detection.placement {
        Placement::Shifted => (-columns..=columns).flat_map(|i| (-rows..=rows).map(move |j| [i, j])).collect(),
        _ => vec![[0, 0]],
    };
    let turns: &[bool] = if detection.placement == Placement::Unique { &[false] } else { &[false, true] };
    let found = found(detection, target);
    let under = |turn: bool, [di, dj]: [i32; 2]| -> Vec<f64> {
        let label = |[i, j]: [i32; 2]| {
            if turn { [columns - 1 - i + di, rows - 1 - j + dj] } else { [i + di, j + dj] }
        };
        found
            .iter()
            .map(|&(node, pixel)| truth.get(&label(node)).map_or(f64::INFINITY, |&at| distance(at, pixel)))
            .collect()
    };
    let mean = |errors: &[f64]| errors.iter().map(|e| e.min(100.0)).sum::<f64>() / errors.len() as f64;
    turns
        .iter()
        .flat_map(|&turn| shifts.iter().map(move |&shift| (turn, shift)))
        .map(|(turn, shift)| under(turn, shift))
        .min_by(|a, b| mean(a).total_cmp(&mean(b)))
        .unwrap()
}

/// Asserts that the corners found are labelled rightly and lie where they are projected, and that at least `recall` of
/// those in full sight are found.
fn assert_found(detection: &Detection, target: Target, pose: Pose, camera: &KannalaBrandt, recall: f64) {
    let mut errors = errors(detection, target, &truth(target, pose, camera, 0.0));
    errors.sort_by(f64::total_cmp);
    let (mean, p95) = (errors.iter().sum::<f64>() / errors.len() as f64, errors[errors.len() * 95 / 100]);
    let in_sight = truth(target, pose, camera, 0.5);
    let found = found(detection, target);
    let seen = in_sight.values().filter(|at| found.iter().any(|(_, pixel)| distance(**at, *pixel) < 0.5)).count();
    let sigma = detection.corners.iter().map(|c| c.sigma_px).sum::<f64>() / detection.corners.len() as f64;
    println!(
        "theta {}°: {}/{} in sight, {} found ({} filled), mean {mean:.4} px, p95 {p95:.4} px, stated sigma {sigma:.3}, {:?}",
        pose.theta_deg,
        seen,
        in_sight.len(),
        found.len(),
        detection.corners.iter().filter(|corner| corner.filled).count(),
        detection.placement,
    );
    assert!(errors.iter().all(|&error| error < 0.5), "false label or false corner: {errors:?}");
    assert!(mean < 0.06 && p95 < 0.12, "mean {mean}, p95 {p95}");
    assert!(seen as f64 >= recall * in_sight.len() as f64, "{seen} of {} in sight", in_sight.len());
}

#[test]
fn whole_targets_are_found_at_any_angle() {
    let camera = fisheye(1280);
    let poses = [
        (Pose { theta_deg: 0.0, azimuth_deg: 0.0, roll_deg: 8.0, tilt_deg: 20.0, distance_mm: 260.0 }, 0.5),
        (Pose { theta_deg: 25.0, azimuth_deg: 200.0, roll_deg: -60.0, tilt_deg: 35.0, distance_mm: 300.0 }, 0.8),
        (Pose { theta_deg: 45.0, azimuth_deg: 70.0, roll_deg: 30.0, tilt_deg: -25.0, distance_mm: 280.0 }, 0.6),
        (Pose { theta_deg: 72.0, azimuth_deg: 150.0, roll_deg: 100.0, tilt_deg: 0.0, distance_mm: 420.0 }, 0.5),
        (Pose { theta_deg: 80.0, azimuth_deg: 0.0, roll_deg: 0.0, tilt_deg: 0.0, distance_mm: 460.0 }, 0.5),
    ];
    for (seed, (pose, blur)) in poses.into_iter().enumerate() {
        let image = photograph_target(TARGET, pose, &camera, &optics(blur), seed as u64);
        let detection = detect(&image, &spec(TARGET), None).unwrap();
        assert_found(&detection, TARGET, pose, &camera, 1.0);
        assert!(detection.complete, "{} corners", detection.corners.len());
        assert_eq!(detection.placement, Placement::Unique);
    }
}

#[test]
fn targets_cut_by_the_field_are_found_past_95_degrees() {
    let camera = fisheye(1280);
    for (seed, azimuth_deg) in [0.0, 135.0, 250.0].into_iter().enumerate() {
        let pose = Pose { theta_deg: 86.0, azimuth_deg, roll_deg: 15.0, tilt_deg: 0.0, distance_mm: 330.0 };
        let image = photograph_target(TARGET, pose, &camera, &optics(0.5), seed as u64);
        let searched = SearchedImage::default();
        for hint in [None, Some(&camera)] {
            let detection = detect_from(&searched, &image, &spec(TARGET), hint).unwrap();
            assert_eq!(detection, detect(&image, &spec(TARGET), hint).unwrap(), "searched once or twice");
            assert_found(&detection, TARGET, pose, &camera, 0.95);
            assert!(!detection.complete);
            let farthest = found(&detection, TARGET)
                .iter()
                .map(|(_, pixel)| camera.unproject::<Camera>(*pixel).unwrap().angle_to_axis().deg())
                .fold(0.0, f64::max);
            assert!(farthest > 94.0, "farthest corner at {farthest}°");
        }
    }
}

#[test]
fn a_target_cut_by_the_image_is_placed_by_its_ends_and_colours() {
    // The sensor's left edge cuts columns off; the other three ends of the target are seen.
    let whole = fisheye(1280);
    let pose = Pose { theta_deg: 5.0, azimuth_deg: 0.0, roll_deg: 3.0, tilt_deg: 10.0, distance_mm: 250.0 };
    let image = photograph_target(TARGET, pose, &whole, &optics(0.5), 3);
    for cut in [590, 640] {
        let part = image::imageops::crop_imm(&image, cut, 0, 1280 - cut, 1280).to_image();
        let centre = Pixel { u: whole.centre().u - f64::from(cut), v: whole.centre().v };
        let size = ImageSize { width: 1280 - cut, height: 1280 };
        let camera = KannalaBrandt::new(whole.k(), whole.aspect(), centre, whole.theta_max(), size).unwrap();
        let detection = detect(&part, &spec(TARGET), None).unwrap();
        assert!(!detection.complete);
        assert_found(&detection, TARGET, pose, &camera, 0.95);
        assert_eq!(detection.placement, Placement::Unique);
    }
}

#[test]
fn a_target_cut_on_all_sides_has_relative_labels() {
    let target = Target { columns: 14, rows: 11, ..TARGET };
    let pose = Pose { theta_deg: 0.0, azimuth_deg: 0.0, roll_deg: 2.0, tilt_deg: 5.0, distance_mm: 300.0 };
    let image = photograph_target(target, pose, &fisheye(1280), &optics(0.5), 3);
    let part = image::imageops::crop_imm(&image, 500, 520, 280, 240).to_image();
    let detection = detect(&part, &spec(target), None).unwrap();
    assert_eq!(detection.placement, Placement::Shifted);
    let whole = fisheye(1280);
    let centre = Pixel { u: whole.centre().u - 500.0, v: whole.centre().v - 520.0 };
    let size = ImageSize { width: 280, height: 240 };
    let camera = KannalaBrandt::new(whole.k(), whole.aspect(), centre, whole.theta_max(), size).unwrap();
    assert_found(&detection, target, pose, &camera, 0.95);
}

#[test]
fn colours_tell_the_first_corner_where_columns_plus_rows_is_odd() {
    let camera = fisheye(960);
    for roll_deg in [0.0, 90.0, 180.0, 270.0] {
        let pose = Pose { theta_deg: 10.0, azimuth_deg: 30.0, roll_deg, tilt_deg: 10.0, distance_mm: 260.0 };
        for (target, placement) in [
            (TARGET, Placement::Unique),
            (Target { columns: 8, ..TARGET }, Placement::HalfTurn),
            (Target { columns: 6, ..TARGET }, Placement::HalfTurn),
        ] {
            let image = photograph_target(target, pose, &camera, &optics(0.5), 1);
            let detection = detect(&image, &spec(target), None).unwrap();
            assert_eq!(detection.placement, placement);
            assert!(detection.complete);
            if placement == Placement::Unique {
                assert_found(&detection, target, pose, &camera, 1.0);
            }
        }
    }
}

#[test]
fn an_ambiguous_target_is_labelled_upright() {
    // 8 × 6: a half turn changes no colour. Whichever way it is held, the x axis points right, or, near the vertical,
    // the y axis down.
    let target = Target { columns: 8, ..TARGET };
    let camera = fisheye(960);
    for roll_deg in [20.0, 200.0] {
        let pose = Pose { theta_deg: 0.0, azimuth_deg: 0.0, roll_deg, tilt_deg: 10.0, distance_mm: 260.0 };
        let image = photograph_target(target, pose, &camera, &optics(0.5), 1);
        let detection = detect(&image, &spec(target), None).unwrap();
        let [first, second] = [0, 1].map(|i| detection.corners[i].pixel);
        assert!(second.u > first.u);
    }
}

#[test]
fn a_painted_out_corner_is_no_good_corner() {
    let camera = fisheye(960);
    let pose = Pose { theta_deg: 10.0, azimuth_deg: 30.0, roll_deg: 12.0, tilt_deg: 10.0, distance_mm: 260.0 };
    let image = photograph_target(TARGET, pose, &camera, &optics(0.5), 1);
    let truth = truth(TARGET, pose, &camera, 0.0);
    let clean = detect(&image, &spec(TARGET), None).unwrap();
    assert!(clean.complete);
    for victim in [[4, 3], [0, 0], [8, 2]] {
        // A sticker that covers a corner, and one beside it that displaces what looks like a corner.
        for (dx, dy, radius) in [(0.0, 0.0, 6), (3.0, 1.0, 4)] {
            let at = truth[&victim];
            let mut spoilt = image.clone();
            for (x, y) in (-radius..=radius).flat_map(|y: i32| (-radius..=radius).map(move |x: i32| (x, y))) {
                let [u, v] = [at.u + dx + f64::from(x), at.v + dy + f64::from(y)].map(|c| c.round() as u32);
                spoilt.put_pixel(u, v, Luma([120]));
            }
            for hint in [None, Some(&camera)] {
                let detection = detect(&spoilt, &spec(TARGET), hint).unwrap();
                let index = victim[0] as u32 + victim[1] as u32 * TARGET.columns;
                let corner = detection.corners.iter().find(|corner| corner.index == index);
                // Without a camera model the corner of the target is predicted to a pixel or two only.
                let allowed = if hint.is_some() { 0.7 } else { 2.0 };
                let off = corner.map(|corner| (corner.quality, distance(corner.pixel, at)));
                assert!(
                    off.is_none_or(|(quality, off)| quality != CornerQuality::Good || off < allowed),
                    "{victim:?}: {off:?}"
                );
            }
        }
    }
}

#[test]
fn no_target_is_an_error() {
    let camera = fisheye(960);
    let studio = photograph(&Scene::studio(), &camera, &optics(0.5), 1);
    assert!(matches!(detect(&studio, &spec(TARGET), None), Err(DetectError::NoTarget { .. })));
    let room = photograph(&Scene::room(), &camera, &optics(0.5), 1);
    let refused = detect(&room, &spec(TARGET), None);
    assert!(matches!(refused, Err(DetectError::NoTarget { .. })));
    for (width, height) in [(0, 0), (1, 1), (3, 200), (64, 48)] {
        let blank = GrayImage::new(width, height);
        assert_eq!(detect(&blank, &spec(TARGET), None), Err(DetectError::NoTarget { found: 0 }));
    }
}

#[test]
fn a_target_of_another_size_is_an_error_that_names_both() {
    let camera = fisheye(960);
    let pose = Pose { theta_deg: 10.0, azimuth_deg: 30.0, roll_deg: 12.0, tilt_deg: 10.0, distance_mm: 260.0 };
    let image = photograph_target(TARGET, pose, &camera, &optics(0.5), 1);
    for (columns, rows) in [(8, 6), (9, 5), (7, 5), (10, 6), (9, 7), (11, 8), (6, 6)] {
        let wrong = TargetSpec { columns, rows, square: TARGET.square };
        let Err(DetectError::WrongSize { mut found, expected }) = detect(&image, &wrong, None) else {
            panic!("{columns} × {rows} was accepted");
        };
        found.sort_unstable();
        assert_eq!((found, expected), ([6, 9], [columns, rows]));
    }
    let transposed = TargetSpec { columns: 6, rows: 9, square: TARGET.square };
    assert!(detect(&image, &transposed, None).unwrap().complete);
    for (columns, rows) in [(0, 0), (1, 20), (3, 3), (300, 4), (u32::MAX, u32::MAX)] {
        let unusable = TargetSpec { columns, rows, square: TARGET.square };
        assert_eq!(detect(&image, &unusable, None), Err(DetectError::UnusableTarget { columns, rows }));
    }
}

#[test]
fn the_same_image_gives_the_same_detection() {
    let camera = fisheye(960);
    let pose = Pose { theta_deg: 60.0, azimuth_deg: 30.0, roll_deg: 12.0, tilt_deg: 10.0, distance_mm: 260.0 };
    let image = photograph_target(TARGET, pose, &camera, &optics(0.8), 1);
    let first = detect(&image, &spec(TARGET), None).unwrap();
    for _ in 0..5 {
        assert_eq!(detect(&image, &spec(TARGET), None).unwrap(), first);
    }
}
