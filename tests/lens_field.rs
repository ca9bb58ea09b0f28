//! `--field extrapolated`: points where the lenses were not measured, what their files state of them, and how they are told. Corners,
//! matches and benches are simulated; a real pair is used where it is there.
#![allow(
    clippy::expect_used,
    clippy::panic,
    clippy::print_stdout,
    reason = "a test fails loudly and shows its figures"
)]

mod common;

use std::path::Path;

use common::built_bench::{Dice, as_built, stand};
use common::cameras::camera_files;
use common::corner_files::{CORNER_PX, Lenses, Projection, calibrated, direction, noisy, projection};
use common::rendered::{band, seeds};
use common::{fails_with, real_data, run_json};
use image::RgbImage;
use nalgebra::Vector3;
use serde_json::Value;
use vergence_pipeline::{PairPose, cloud_of_pairs};
use vergence_reproduce::own_frame_by;
use vergence_rig::{LensField, Provenance, Rig, RigCalibration};
use vergence_vision::{KannalaBrandt, Kernel, Left, Pixel, PixelPair, Point};

const MATCH_PX: f64 = 0.03;
/// Angle to the axis to which the middle of a target is held, in radians: the lenses are measured to some 56°.
const REACH: f64 = 0.65;

/// Stage poses at which both cameras see a target where their lenses are measured.
const POSES: [[f64; 2]; 6] = [[60.0, 0.0], [220.0, 0.0], [60.0, 30.0], [220.0, 30.0], [140.0, 15.0], [145.0, 24.0]];

/// The pixel of a place in the frame of a camera, whose drawing this is.
type LensAt = fn(&KannalaBrandt, &Vector3<f64>) -> Option<Pixel>;

/// A bench, and what the command line made of corners in the middle of its lenses' fields.
struct Measured {
    rig: Rig,
    written: Rig,
    dice: Dice,
}

impl Measured {
    fn new(seed: u64, lens: LensAt) -> Self {
        let mut dice = Dice::new(seed);
        let rig = as_built(&mut dice);
        let work = tempfile::tempdir().expect("a temporary folder");
        let [left, right] = [&rig.left_camera, &rig.right_camera].map(|of| move |at: &Vector3<f64>| lens(of, at));
        let lenses = Lenses {
            left: &left,
            right: &right,
            reach: REACH,
            poses: POSES,
            spread: 0.3,
            own_views: 20,
            bow_mm: 0.0,
            corner_px: CORNER_PX,
        };
        let text = calibrated(&rig, lenses, work.path(), &mut dice);
        Self { written: Rig::from_toml(&text).expect("a rig"), rig, dice }
    }

    /// A point 350 mm away at `theta` from the left axis, above or below, as both lenses show it; what the encoders read, and the truth.
    fn show(&mut self, theta_deg: [f64; 2], lenses: [Projection<'_>; 2]) -> ([f64; 2], PixelPair, Point<Left>) {
        loop {
            let dice = &mut self.dice;
            let wished = [145.0 + 50.0 * dice.uniform(), (5.0 + 5.0 * dice.uniform()).to_radians()];
            let (read, pose) = stand(&self.rig, wished, dice);
            let [low, high] = theta_deg.map(f64::to_radians);
            let theta = low + (0.5 + 0.5 * dice.uniform()) * (high - low);
            let above = if dice.uniform() > 0.0 { 1.57 } else { -1.57 };
            let truth = Point::<Left>::from_mm(direction(theta, above + 0.8 * dice.uniform()) * 350.0);
            let in_right = pose.left_from_right.inverse() * truth;
            let [left, right] = lenses;
            if let (Some(left), Some(right)) = (left(&truth.mm()), right(&in_right.mm())) {
                let seen = PixelPair { left: noisy(left, MATCH_PX, dice), right: noisy(right, MATCH_PX, dice) };
                return (read, seen, truth);
            }
        }
    }
}

/// The lens as it is.
fn own(lens: &KannalaBrandt, at: &Vector3<f64>) -> Option<Pixel> {
    projection(lens)(at)
}

/// A lens that no polynomial of the model is: r = 2 f sin(θ / 2), and its elements are not centred (D. Brown, "Decentering distortion of
/// lenses", Photogrammetric Engineering 32, 1966), by a fraction of a pixel where it is measured.
fn decentred(lens: &KannalaBrandt, at: &Vector3<f64>) -> Option<Pixel> {
    const P: f64 = 4e-4;
    let (focal, theta, phi) = (lens.k()[0], at.xy().norm().atan2(at.z), at.y.atan2(at.x));
    let radius = 2.0 * (0.5 * theta).sin();
    let (x, y) = (radius * phi.cos(), radius * phi.sin());
    let (du, dv) = (P * (radius * radius + 2.0 * x * x), P * 2.0 * x * y);
    let pixel = Pixel { u: lens.centre().u + focal * (x + du), v: lens.centre().v + focal * (y + dv) };
    (theta < 1.7 && lens.on_sensor(pixel)).then_some(pixel)
}

/// The square of a point's error over its stated covariance, and whether it is marked; `None` where it is no point.
fn nees(file: &Rig, read: &[f64; 2], seen: &PixelPair, truth: &Vector3<f64>) -> Option<(f64, bool)> {
    let pose = PairPose::standing(file.pose_read_at(read));
    let cloud = cloud_of_pairs(&[(*seen, MATCH_PX)], &RgbImage::new(1, 1), file, &pose, Kernel::default());
    let point = cloud.expect("no axis moves").points.first()?.point;
    let error = point.point.mm() - truth;
    Some((error.dot(&point.covariance.cholesky()?.solve(&error)), point.extrapolated))
}

/// Mean squared error of the points of one bench in each ring of directions, and the share of them that are points.
fn trial<const N: usize>(seed: u64, lens: LensAt, rings: [[f64; 2]; N]) -> [[f64; 2]; N] {
    const POINTS: usize = 20;
    let mut bench = Measured::new(seed, lens);
    let wide = bench.written.clone().measuring_in(LensField::Extrapolated).expect("the file states its lenses' errors");
    let limit = bench.written.left_camera.theta_max().deg();
    assert!((50.0..72.0).contains(&limit), "the lens is measured to {limit} degrees");
    let [left, right] = [bench.rig.left_camera, bench.rig.right_camera];
    let (left, right) = (move |at: &Vector3<f64>| lens(&left, at), move |at: &Vector3<f64>| lens(&right, at));
    let turn = own_frame_by(&bench.written.left_camera, &left);
    rings.map(|ring| {
        let (mut sum, mut found) = (0.0, 0);
        for _ in 0..POINTS {
            let (read, seen, truth) = bench.show(ring, [&left, &right]);
            // In the frame of the left camera's rays.
            let truth = turn * truth.mm();
            let Some((square, marked)) = nees(&wide, &read, &seen, &truth) else { continue };
            (sum, found) = (sum + square, found + 1);
            if ring[0] > limit {
                assert!(marked, "a point at {ring:?} is not marked");
                assert_eq!(nees(&bench.written, &read, &seen, &truth), None, "it is beyond the measured field");
            }
        }
        [sum / f64::from(found.max(1)), f64::from(found) / POINTS as f64]
    })
}

#[test]
fn points_of_an_extrapolated_lens_are_as_far_off_as_stated() {
    const RINGS: [[f64; 2]; 3] = [[20.0, 45.0], [73.0, 82.0], [82.0, 92.0]];
    const OUTSIDE: &str = "outside it";
    let seeds = seeds(4);
    println!("mean NEES of 3 by angle from the axis, {seeds} seeds, and the share of matches that are points");
    let lenses: [(&str, LensAt); 2] = [("of the model's family", own), (OUTSIDE, decentred)];
    for (name, lens) in lenses {
        let trials: Vec<_> = (0..seeds).map(|seed| trial(seed, lens, RINGS)).collect();
        for (ring, [low, high]) in RINGS.iter().enumerate() {
            let mean = |of: usize| trials.iter().map(|trial| trial[ring][of]).sum::<f64>() / seeds as f64;
            println!("{name}: {low}° to {high}°: {:.2}, {:.0} %", mean(0), 100.0 * mean(1));
            // Of a lens outside the family nothing is promised where it was not measured.
            let [_, boldest] = band(seeds, 3.0, 1.96);
            assert!(name == OUTSIDE || mean(0) < boldest, "{name}: {low}° to {high}°: stated too boldly, {}", mean(0));
        }
    }
}

/// The same by the command line: points beyond the field are dropped, or marked in every file; without a covariance they are refused.
#[test]
fn extrapolated_points_are_marked_in_every_file() {
    let mut bench = Measured::new(1, own);
    let work = tempfile::tempdir().expect("a temporary folder");
    let file = |name: &str| work.path().join(name).to_string_lossy().into_owned();
    let write = |rig: &Rig, name: &str| {
        let provenance = Provenance { program: "a test".into(), inputs_sha256: String::new(), date: None };
        std::fs::write(file(name), rig.to_toml(&provenance).expect("TOML")).expect("written");
    };
    write(&bench.written, "rig.toml");
    write(&Rig { calibration: RigCalibration::exact(), ..bench.written.clone() }, "exact.toml");
    let (left, right) = (bench.rig.left_camera, bench.rig.right_camera);
    let lenses: [Projection<'_>; 2] = [&projection(&left), &projection(&right)];
    // Both at one pose, of which the encoders tell all.
    let (read, near, _) = bench.show([5.0, 20.0], lenses);
    let pose = bench.rig.pose_at_values(&read).left_from_right.inverse();
    let beyond = Point::<Left>::from_mm(direction(80f64.to_radians(), 1.57) * 350.0);
    let [left_lens, right_lens] = lenses;
    let (left_pixel, right_pixel) = (left_lens(&beyond.mm()), right_lens(&(pose * beyond).mm()));
    let far = PixelPair { left: left_pixel.expect("seen"), right: right_pixel.expect("seen") };
    let row = |PixelPair { left, right }: PixelPair| format!("{},{},{},{}\n", left.u, left.v, right.u, right.v);
    let rows = String::from("u_left,v_left,u_right,v_right\n") + &row(near) + &row(far);
    std::fs::write(file("pairs.csv"), rows).expect("written");
    RgbImage::new(1280, 1280).save(file("grey.png")).expect("written");
    let [rig, exact, pairs, grey, out] = ["rig.toml", "exact.toml", "pairs.csv", "grey.png", "cloud.ply"].map(file);
    let depth = ["depth", "--left", &grey, "--right", &grey, "--points", &pairs, "--out", &out, "--json", "--ascii"];
    let [baseline, separation] = [format!("{}mm", read[0]), format!("{}deg", read[1].to_degrees())];
    let at = ["--baseline", &baseline, "--separation", &separation, "--also", "csv,json"];
    let measure =
        |rig: &str, field: &str| -> Value { run_json(&[&depth[..], &at, &["--rig", rig, "--field", field]].concat()) };
    let measured = measure(&rig, "measured");
    assert!(measured["points"] == 1 && measured["extrapolated"] == 0, "{measured}");
    assert_eq!(measured["dropped"]["matches"]["outside_left_field"], 1);
    let all = measure(&rig, "extrapolated");
    assert!(all["points"] == 2 && all["extrapolated"] == 1, "{all}");
    let flags = |text: &str, separator: char| -> Vec<String> {
        text.lines().rev().take(2).filter_map(|line| line.rsplit(separator).nth(1)).map(str::to_owned).collect()
    };
    let read = |name: &str| std::fs::read_to_string(file(name)).expect("written");
    assert!(read("cloud.ply").contains("property uchar extrapolated\nproperty int track\nend_header"));
    assert_eq!(flags(&read("cloud.ply"), ' '), ["1", "0"]);
    assert_eq!(flags(&read("cloud.csv"), ','), ["1", "0"]);
    let table: Value = serde_json::from_str(&read("cloud.json")).expect("JSON");
    assert!(table["columns"][24] == "extrapolated" && table["rows"][1][24] == 1.0, "{table}");
    let refused = [&depth[..], &at, &["--rig", &exact, "--field", "extrapolated"]].concat();
    fails_with(&refused, 2, &["no covariance of its lenses", "measured field"]);
    fails_with(&[&depth[..], &at, &["--rig", &rig, "--field", "all"]].concat(), 2, &["measured or extrapolated"]);
}

/// A photographed pair whose lenses were calibrated with targets in the middle of the image.
#[test]
fn the_whole_field_of_a_real_pair_gives_points() {
    let Some(set) = real_data("data/sourishg_stereo") else { return };
    let work = tempfile::tempdir().expect("a temporary folder");
    let file = |name: &str| work.path().join(name).to_string_lossy().into_owned();
    let [left, right] = camera_files(&set, work.path());
    let (corners, rig) = (set.join("corners_opencv_classic.csv"), file("rig.toml"));
    let pair = ["calibrate", "extrinsics", "--csv", &corners.to_string_lossy(), "--left", &left, "--right", &right];
    run_json(&[&pair[..], &["--out", &rig, "--json"]].concat());
    let image = |name: &str| set.join("images").join(name).to_string_lossy().into_owned();
    let (left, right) = (image("left10.jpg"), image("right10.jpg"));
    let depth = |field: &str, more: &[&str]| {
        let out = file(&format!("{field}.ply"));
        let options = ["--rig", &rig, "depth", "--left", &left, "--right", &right, "--out", &out, "--field", field];
        run_json(&[&options[..], &["--json"], more].concat())
    };
    let number = |value: &Value, key: &str| value[key].as_f64().expect("a number");
    // A sparse search has the same number of keypoints for the whole field, so that fewer of them lie where this pair has the most partners.
    for (more, least) in [(&["--also", "csv"][..], -0.1), (&["--dense"], 0.015)] {
        let (measured, all) = (depth("measured", more), depth("extrapolated", more));
        let told =
            |cloud: &Value| ["points", "extrapolated", "measured_share"].map(|key| cloud[key].to_string()).join(", ");
        println!(
            "points, extrapolated, share of the pixels: {} by the measured field, {} by all",
            told(&measured),
            told(&all)
        );
        assert!(number(&measured, "extrapolated") < 0.5);
        let added = number(&all, "points") - number(&measured, "points");
        // The views of this set cannot tell the pupil, so that far from the axis little is certain.
        assert!(added > least * number(&measured, "points"), "{added} more points");
        assert!(number(&all, "extrapolated") > (0.2 * added).max(10.0));
    }
    let table = std::fs::read_to_string(Path::new(&file("extrapolated.csv"))).expect("a table");
    let (marked, others): (Vec<_>, Vec<_>) = table.lines().skip(1).partition(|line| line.ends_with(",1,-1"));
    let relative = |lines: &[&str]| {
        let mut values: Vec<f64> = lines
            .iter()
            .map(|line| {
                let n: Vec<f64> = line.split(',').map(|number| number.parse().expect("a number")).collect();
                n[10] / Vector3::new(n[0], n[1], n[2]).norm()
            })
            .collect();
        values.sort_by(f64::total_cmp);
        values[values.len() / 2]
    };
    // The medians are of points at other ranges, so that they need not be in order.
    println!("median relative sigma: measured {:.4}, extrapolated {:.4}", relative(&others), relative(&marked));
    assert!(relative(&marked) > 0.5 * relative(&others));
}
