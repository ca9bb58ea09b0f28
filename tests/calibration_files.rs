//! What the files of a calibration state of clouds, against the truth: corners go through the command line to camera files and a rig
//! file, and points at new stage poses are measured with that file. Corners, their noise and the bench's build are simulated.
#![allow(
    clippy::expect_used,
    clippy::panic,
    clippy::print_stdout,
    reason = "a test fails loudly and shows its figures"
)]

mod common;

use std::fmt::Write;
use std::path::Path;

use common::run_json;
use image::RgbImage;
use nalgebra::{Isometry3, Point3, UnitQuaternion, Vector3};
use vergence_pipeline::{PairPose, cloud_of_pairs};
use vergence_rig::{BENCH_TOML, Rig, RigCalibration};
use vergence_vision::{Angle, KannalaBrandt, Kernel, Left, OpenCvFisheye, Pixel, PixelPair, Point};

/// Standard deviation of the corners that calibrate.
const CORNER_PX: f64 = 0.1;
/// Standard deviation of matched pixels: small, so that the error of the calibration is not hidden by theirs.
const MATCH_PX: f64 = 0.03;
/// Baseline in millimetres and separation in degrees of the stage poses that calibrate.
const POSES: [[f64; 2]; 6] = [[60.0, 0.0], [220.0, 0.0], [60.0, 126.0], [220.0, 126.0], [140.0, 63.0], [145.0, 115.0]];

/// Numbers from -1 to 1, evenly and about normally distributed.
struct Dice(u64);

impl Dice {
    fn new(seed: u64) -> Self {
        let mut dice = Self(seed.wrapping_mul(0x9e37_79b9_7f4a_7c15) ^ 0xca1b);
        (0..8).for_each(|_| _ = dice.uniform());
        dice
    }

    fn uniform(&mut self) -> f64 {
        self.0 = self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (self.0 >> 11) as f64 / (1u64 << 52) as f64 - 1.0
    }

    fn normal(&mut self) -> f64 {
        (0..12).map(|_| 0.5 * self.uniform()).sum()
    }

    fn vector(&mut self) -> Vector3<f64> {
        Vector3::new(self.normal(), self.normal(), self.normal())
    }
}

/// The bench as a workshop leaves it: lenses, screws, scales and mounts off the drawing.
fn as_built(dice: &mut Dice) -> Rig {
    let mut line = |mm: f64| {
        let at = mm * dice.vector();
        format!("through = [\"{}mm\", \"{}mm\", \"{}mm\"]", at.x, at.y, at.z)
    };
    let (left, right) = (line(2.0), line(2.0));
    let through = "through = [\"0mm\", \"0mm\", \"0mm\"]";
    let mut tilted = |x: f64, y: f64, z: f64| {
        let off = 0.008 * dice.vector();
        format!("[{}, {}, {}]", x + off.x, y + off.y, z + off.z)
    };
    let text = BENCH_TOML
        .replace("slide_along = [1.0, 0.0, 0.0]", &format!("slide_along = {}", tilted(1.0, 0.0, 0.0)))
        .replacen("turn_about = [0.0, 1.0, 0.0]", &format!("turn_about = {}", tilted(0.0, 1.0, 0.0)), 1)
        .replacen(through, &left, 1)
        .replacen(through, &right, 1)
        .replace("share = 1.0", &format!("share = {}", 1.0 + 0.002 * dice.normal()));
    let (origin, turn) = (1.5 * dice.vector(), 0.008 * dice.vector());
    let at_zero = format!(
        "[right.at_zero]\norigin = [\"{}mm\", \"{}mm\", \"{}mm\"]\nrotation_vector = [\"{}rad\", \"{}rad\", \"{}rad\"]\n",
        origin.x, origin.y, origin.z, turn.x, turn.y, turn.z
    );
    let rig = Rig::from_toml(&(text + &at_zero)).expect("a rig");
    let (left_camera, right_camera) = (lens(&rig.left_camera, dice), lens(&rig.right_camera, dice));
    Rig { left_camera, right_camera, ..rig }
}

fn lens(drawn: &KannalaBrandt, dice: &mut Dice) -> KannalaBrandt {
    let OpenCvFisheye { fx, cx, cy, k, .. } = drawn.to_opencv();
    let fx = fx * (1.0 + 0.005 * dice.normal());
    let off = [2e-3, 1e-3, 3e-4, 5e-5].map(|sigma| sigma * dice.normal());
    let k = std::array::from_fn(|index| k[index] + off[index]);
    let lens = OpenCvFisheye { fx, fy: fx, cx: cx + 3.0 * dice.normal(), cy: cy + 3.0 * dice.normal(), k };
    KannalaBrandt::from_opencv(lens, Angle::from_deg(97.0), drawn.size()).expect("a lens")
}

/// The pixel of every corner with its noise; `None` where one is not seen.
fn seen(
    lens: &KannalaBrandt,
    camera_from_left: &Isometry3<f64>,
    target: &[Vector3<f64>],
    dice: &mut Dice,
) -> Option<Vec<Pixel>> {
    let corner = |at: &Vector3<f64>| {
        let point = camera_from_left * Point3::from(*at);
        let exact = lens.project_point(&Point::<Left>::from_mm(point.coords)).ok().filter(|p| lens.on_sensor(*p))?;
        Some(noisy(exact, CORNER_PX, dice))
    };
    target.iter().map(corner).collect()
}

fn noisy(pixel: Pixel, sigma: f64, dice: &mut Dice) -> Pixel {
    Pixel { u: pixel.u + sigma * dice.normal(), v: pixel.v + sigma * dice.normal() }
}

/// A target of 9 x 6 corners at `mm` in the direction `towards`, which it faces within some 30 degrees.
fn target(towards: &Vector3<f64>, mm: f64, dice: &mut Dice) -> Vec<Vector3<f64>> {
    let tilt = UnitQuaternion::from_euler_angles(0.5 * dice.uniform(), 0.5 * dice.uniform(), 3.0 * dice.uniform());
    let facing = UnitQuaternion::rotation_between(&Vector3::z(), towards).unwrap_or_default() * tilt;
    let corner = |i: u32| Vector3::new(20.0 * f64::from(i % 9) - 80.0, 20.0 * f64::from(i / 9) - 50.0, 0.0);
    (0..54).map(|i| towards * mm + facing * corner(i)).collect()
}

/// The direction at `theta` radians from the axis, `phi` around it.
fn direction(theta: f64, phi: f64) -> Vector3<f64> {
    Vector3::new(theta.sin() * phi.cos(), theta.sin() * phi.sin(), theta.cos())
}

fn rows(text: &mut String, (camera, frame): (&str, usize), pixels: &[Pixel], readings: &str) {
    for (index, pixel) in pixels.iter().enumerate() {
        let (x, y) = (20 * (index % 9), 20 * (index / 9));
        writeln!(text, "{camera},f{frame}.png,{frame},{index},{},{},{x},{y}{readings}", pixel.u, pixel.v)
            .expect("text");
    }
}

/// Corners of 20 targets all over the field of one lens.
fn own_corners(lens: &KannalaBrandt, dice: &mut Dice) -> String {
    let mut text = String::from("camera,file,frame,idx,x,y,bx_mm,by_mm\n");
    let mut frame = 0;
    while frame < 20 {
        let towards = direction(1.45 * (0.5 + 0.5 * dice.uniform()).sqrt(), 3.2 * dice.uniform());
        let target = target(&towards, 260.0 + 80.0 * dice.uniform(), dice);
        let Some(pixels) = seen(lens, &Isometry3::identity(), &target, dice) else { continue };
        rows(&mut text, ("own", frame), &pixels, "");
        frame += 1;
    }
    text
}

/// Corners of targets between the optical axes at each stage pose, beside what the encoders read.
fn shared_corners(rig: &Rig, dice: &mut Dice) -> String {
    let mut text = String::from("camera,file,frame,idx,x,y,bx_mm,by_mm,baseline_mm,separation_deg\n");
    let mut frame = 0;
    for [baseline, separation] in POSES {
        let (read, left_from_right) = stand(rig, [baseline, separation.to_radians()], dice);
        let middle = (Vector3::z() + left_from_right.rotation() * Vector3::z()).normalize();
        let mut taken = 0;
        while taken < 4 {
            let towards = (middle + 0.5 * dice.vector()).normalize();
            let target = target(&towards, 330.0 + 100.0 * dice.uniform(), dice);
            let left = seen(&rig.left_camera, &Isometry3::identity(), &target, dice);
            let right = seen(&rig.right_camera, left_from_right.inverse().isometry(), &target, dice);
            let (Some(left), Some(right)) = (left, right) else { continue };
            let readings = format!(",{},{}", read[0], read[1].to_degrees());
            rows(&mut text, ("left", frame), &left, &readings);
            rows(&mut text, ("right", frame), &right, &readings);
            (taken, frame) = (taken + 1, frame + 1);
        }
    }
    text
}

/// What the encoders read, in millimetres and radians, near a wished pose, and the true relative pose there: within a count.
fn stand(
    rig: &Rig,
    wished: [f64; 2],
    dice: &mut Dice,
) -> ([f64; 2], vergence_vision::Transform<Left, vergence_vision::Right>) {
    let mut read = [0.0; 2];
    let mut truth = [0.0; 2];
    for (index, axis) in rig.axes.iter().enumerate() {
        let counts = axis.counts_at(wished[index]).round();
        read[index] = axis.value_at(counts);
        truth[index] = read[index] + 0.5 * axis.value_per_count() * dice.uniform();
    }
    (read, rig.pose_at_values(&truth).left_from_right)
}

/// Calibrates by the command line; returns the text of the rig file.
fn calibrated(rig: &Rig, work: &Path, dice: &mut Dice) -> String {
    let file = |name: &str| work.join(name).to_string_lossy().into_owned();
    for (name, lens) in [("left", &rig.left_camera), ("right", &rig.right_camera)] {
        let (corners, out) = (file(&format!("{name}.csv")), file(&format!("{name}.toml")));
        std::fs::write(&corners, own_corners(lens, dice)).expect("written");
        run_json(&["calibrate", "intrinsics", "--json", "--csv", &corners, "--size", "1280x1280", "--out", &out]);
    }
    let (corners, out) = (file("corners.csv"), file("rig.toml"));
    std::fs::write(&corners, shared_corners(rig, dice)).expect("written");
    let lenses = ["--left", &file("left.toml"), "--right", &file("right.toml")];
    let command = ["calibrate", "stage", "--json", "--csv", &corners, "--out", &out];
    run_json(&[&command[..], &lenses].concat());
    std::fs::read_to_string(&out).expect("a rig file")
}

/// The square of a point's error in units of its stated covariance, by one file; `None` where both cameras do not see it.
fn nees(file: &Rig, read: &[f64; 2], seen: &PixelPair, truth: &Point<Left>) -> Option<f64> {
    let pose = PairPose::standing(file.pose_read_at(read));
    let image = RgbImage::new(1, 1);
    let cloud = cloud_of_pairs(&[(*seen, MATCH_PX)], &image, file, &pose, Kernel::default()).expect("no axis moves");
    let found = cloud.points.first()?.point;
    let error = found.point.mm() - truth.mm();
    Some(error.dot(&found.covariance.cholesky()?.solve(&error)))
}

/// Means over points at unseen poses by the file as written, by one that knows of no lens, and by one without its covariance.
fn trial(seed: u64, separations: [f64; 2]) -> [f64; 3] {
    const POINTS: usize = 30;
    let mut dice = Dice::new(seed);
    let rig = as_built(&mut dice);
    let work = tempfile::tempdir().expect("a temporary folder");
    let written = Rig::from_toml(&calibrated(&rig, work.path(), &mut dice)).expect("a rig");
    assert!(matches!(written.calibration, RigCalibration::Covariance(_)), "the file holds a covariance");
    let unknown = Rig { calibration: RigCalibration::Unknown, ..written.clone() };
    let mut sums = [0.0; 3];
    let mut points = 0;
    while points < POINTS {
        let share = 0.5 + 0.5 * dice.uniform();
        let wished =
            [145.0 + 50.0 * dice.uniform(), (separations[0] + share * (separations[1] - separations[0])).to_radians()];
        let (read, left_from_right) = stand(&rig, wished, &mut dice);
        let middle = (Vector3::z() + left_from_right.rotation() * Vector3::z()).normalize();
        let truth = Point::<Left>::from_mm((middle + 0.4 * dice.vector()).normalize() * 350.0);
        let in_right = left_from_right.inverse() * truth;
        let (Ok(left), Ok(right)) = (rig.left_camera.project_point(&truth), rig.right_camera.project_point(&in_right))
        else {
            continue;
        };
        let seen = PixelPair { left: noisy(left, MATCH_PX, &mut dice), right: noisy(right, MATCH_PX, &mut dice) };
        let Some(stated) = nees(&written, &read, &seen, &truth) else { continue };
        // Its gates may refuse what it takes for impossible; that counts as far off.
        let blind = nees(&unknown, &read, &seen, &truth).unwrap_or(100.0);
        sums[0] += stated;
        sums[1] += without_lenses(&written, &read, &seen, &truth).unwrap_or(100.0);
        sums[2] += blind;
        points += 1;
    }
    sums.map(|sum| sum / POINTS as f64)
}

/// [`nees`] with the covariance of the pose alone.
fn without_lenses(file: &Rig, read: &[f64; 2], seen: &PixelPair, truth: &Point<Left>) -> Option<f64> {
    let mut pose = file.pose_read_at(read);
    pose.shared = vergence_vision::SharedCovariance::exact().with_pose(&pose.covariance());
    let cloud =
        cloud_of_pairs(&[(*seen, MATCH_PX)], &RgbImage::new(1, 1), file, &PairPose::standing(pose), Kernel::default());
    let found = cloud.expect("no axis moves").points.first()?.point;
    let error = found.point.mm() - truth.mm();
    Some(error.dot(&found.covariance.cholesky()?.solve(&error)))
}

fn seeds(few: u64) -> u64 {
    std::env::var("VERGENCE_SEEDS").ok().and_then(|text| text.parse().ok()).unwrap_or(few)
}

/// Points of one seed share its calibration, so a seed counts as one draw: of a mean of that many draws of chi-squared with three
/// degrees of freedom, 95 of 100 lie in this band (E. Wilson and M. Hilferty, PNAS 17, 1931).
fn band(seeds: u64) -> [f64; 2] {
    let share = 2.0 / (9.0 * 3.0 * seeds as f64);
    [-1.96, 1.96].map(|quantile| 3.0 * (1.0 - share + quantile * share.sqrt()).powi(3))
}

#[test]
fn clouds_are_as_far_off_as_the_rig_file_states() {
    let seeds = seeds(6);
    println!(
        "mean NEES of 3 at 30 unseen poses, {seeds} seeds: as written; without the lenses' part; without covariance"
    );
    for (name, separations) in [("human", [0.0, 10.0]), ("herbivore", [110.0, 125.0])] {
        let trials: Vec<[f64; 3]> = (0..seeds).map(|seed| trial(seed, separations)).collect();
        let mean = |which: usize| trials.iter().map(|trial| trial[which]).sum::<f64>() / seeds as f64;
        let (stated, lensless, blind) = (mean(0), mean(1), mean(2));
        println!("{name}: {stated:.2}; {lensless:.2}; {blind:.2}");
        let [low, high] = band(seeds);
        assert!((low..high).contains(&stated), "{name}: {stated} is not within {low} to {high}");
        assert!(blind > 2.0 * stated && blind > high, "{name}: without its covariance a file is as good: {blind}");
    }
}
