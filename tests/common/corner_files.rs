//! Corners of targets before a bench as built, written to files, and the calibration of them by the command line.

use std::fmt::Write;
use std::path::Path;

use nalgebra::{Isometry3, Point3, UnitQuaternion, Vector3};
use vergence_rig::Rig;
use vergence_vision::{KannalaBrandt, Left, Pixel, Point};

use super::built_bench::{Dice, stand};
use super::run_json;

/// Usual standard deviation of the corners that calibrate.
pub const CORNER_PX: f64 = 0.1;

/// A lens as it truly is: the pixel of a place in the frame of its camera, where it shows it.
pub type Projection<'a> = &'a dyn Fn(&Vector3<f64>) -> Option<Pixel>;

/// The cameras as they truly are, and the angle to the axis to which the middle of a target is held, in radians.
#[derive(Clone, Copy)]
pub struct Lenses<'a> {
    pub left: Projection<'a>,
    pub right: Projection<'a>,
    pub reach: f64,
    /// Baseline in millimetres and separation in degrees of the stage poses that calibrate.
    pub poses: [[f64; 2]; 6],
    /// How far from the middle between the axes a target is held for both cameras, one standard deviation of the sine.
    pub spread: f64,
    /// Number of targets held before each camera alone.
    pub own_views: usize,
    /// How far the middle of the target stands out over its left and right edges, in millimetres.
    pub bow_mm: f64,
    /// Standard deviation of the corners.
    pub corner_px: f64,
}

/// The projection of a lens of the model's family onto its sensor.
pub fn projection(lens: &KannalaBrandt) -> impl Fn(&Vector3<f64>) -> Option<Pixel> {
    move |at| lens.project_point(&Point::<Left>::from_mm(*at)).ok().filter(|pixel| lens.on_sensor(*pixel))
}

/// The pixel of every corner with its noise; `None` where one is not seen.
fn seen(
    lens: Projection<'_>,
    camera_from_left: &Isometry3<f64>,
    target: &[Vector3<f64>],
    corner_px: f64,
    dice: &mut Dice,
) -> Option<Vec<Pixel>> {
    let corner = |at: &Vector3<f64>| {
        let point = camera_from_left * Point3::from(*at);
        Some(noisy(lens(&point.coords)?, corner_px, dice))
    };
    target.iter().map(corner).collect()
}

pub fn noisy(pixel: Pixel, sigma: f64, dice: &mut Dice) -> Pixel {
    Pixel { u: pixel.u + sigma * dice.normal(), v: pixel.v + sigma * dice.normal() }
}

/// A target of 9 x 6 corners at `mm` in the direction `towards`, which it faces within some 30 degrees.
fn target(towards: &Vector3<f64>, mm: f64, bow_mm: f64, dice: &mut Dice) -> Vec<Vector3<f64>> {
    let tilt = UnitQuaternion::from_euler_angles(0.5 * dice.uniform(), 0.5 * dice.uniform(), 3.0 * dice.uniform());
    let facing = UnitQuaternion::rotation_between(&Vector3::z(), towards).unwrap_or_default() * tilt;
    let corner = |i: u32| {
        let (x, y) = (20.0 * f64::from(i % 9) - 80.0, 20.0 * f64::from(i / 9) - 50.0);
        Vector3::new(x, y, bow_mm * (1.0 - (x / 80.0).powi(2)))
    };
    (0..54).map(|i| towards * mm + facing * corner(i)).collect()
}

/// The direction at `theta` radians from the axis, `phi` around it.
pub fn direction(theta: f64, phi: f64) -> Vector3<f64> {
    Vector3::new(theta.sin() * phi.cos(), theta.sin() * phi.sin(), theta.cos())
}

fn rows(text: &mut String, (camera, frame): (&str, usize), pixels: &[Pixel], readings: &str) {
    for (index, pixel) in pixels.iter().enumerate() {
        let (x, y) = (20 * (index % 9), 20 * (index / 9));
        writeln!(text, "{camera},f{frame}.png,{frame},{index},{},{},{x},{y}{readings}", pixel.u, pixel.v)
            .expect("text");
    }
}

/// Corners of `views` targets all over the field of one lens, or that part of it.
fn own_corners(
    lens: Projection<'_>,
    Lenses { reach, own_views, bow_mm, corner_px, .. }: Lenses<'_>,
    dice: &mut Dice,
) -> String {
    let mut text = String::from("camera,file,frame,idx,x,y,bx_mm,by_mm\n");
    let mut frame = 0;
    while frame < own_views {
        let towards = direction(reach * (0.5 + 0.5 * dice.uniform()).sqrt(), 3.2 * dice.uniform());
        let target = target(&towards, 260.0 + 80.0 * dice.uniform(), bow_mm, dice);
        let Some(pixels) = seen(lens, &Isometry3::identity(), &target, corner_px, dice) else { continue };
        rows(&mut text, ("own", frame), &pixels, "");
        frame += 1;
    }
    text
}

/// Corners of targets between the optical axes at each stage pose, beside what the encoders read.
fn shared_corners(rig: &Rig, lenses: Lenses<'_>, dice: &mut Dice) -> String {
    let mut text = String::from("camera,file,frame,idx,x,y,bx_mm,by_mm,baseline_mm,separation_deg\n");
    let mut frame = 0;
    for [baseline, separation] in lenses.poses {
        let (read, pose) = stand(rig, [baseline, separation.to_radians()], dice);
        let left_from_right = pose.left_from_right;
        let middle = (Vector3::z() + left_from_right.rotation() * Vector3::z()).normalize();
        let mut taken = 0;
        while taken < 4 {
            let towards = (middle + lenses.spread * dice.vector()).normalize();
            let target = target(&towards, 330.0 + 100.0 * dice.uniform(), lenses.bow_mm, dice);
            let left = seen(lenses.left, &Isometry3::identity(), &target, lenses.corner_px, dice);
            let right = seen(lenses.right, left_from_right.inverse().isometry(), &target, lenses.corner_px, dice);
            let (Some(left), Some(right)) = (left, right) else { continue };
            let readings = format!(",{},{}", read[0], read[1].to_degrees());
            rows(&mut text, ("left", frame), &left, &readings);
            rows(&mut text, ("right", frame), &right, &readings);
            (taken, frame) = (taken + 1, frame + 1);
        }
    }
    text
}

/// Calibrates by the command line; returns the text of the rig file.
pub fn calibrated(rig: &Rig, lenses: Lenses<'_>, work: &Path, dice: &mut Dice) -> String {
    calibrated_as(rig, lenses, work, &[], dice)
}

/// As [`calibrated`], with more options for the calibration of the lenses.
pub fn calibrated_as(rig: &Rig, lenses: Lenses<'_>, work: &Path, options: &[&str], dice: &mut Dice) -> String {
    calibrated_by("stage", rig, lenses, work, options, dice)
}

/// The same for the pair alone, whose stage poses are all one: the text of a rig file without axes.
pub fn pair_calibrated_as(rig: &Rig, lenses: Lenses<'_>, work: &Path, options: &[&str], dice: &mut Dice) -> String {
    calibrated_by("extrinsics", rig, lenses, work, options, dice)
}

fn calibrated_by(verb: &str, rig: &Rig, lenses: Lenses<'_>, work: &Path, options: &[&str], dice: &mut Dice) -> String {
    let file = |name: &str| work.join(name).to_string_lossy().into_owned();
    let size = rig.left_camera.size();
    let size = format!("{}x{}", size.width, size.height);
    for (name, lens) in [("left", lenses.left), ("right", lenses.right)] {
        let (corners, out) = (file(&format!("{name}.csv")), file(&format!("{name}.toml")));
        std::fs::write(&corners, own_corners(lens, lenses, dice)).expect("written");
        let command = ["calibrate", "intrinsics", "--json", "--csv", &corners, "--size", &size, "--out", &out];
        run_json(&[&command[..], options].concat());
    }
    let (corners, out) = (file("corners.csv"), file("rig.toml"));
    std::fs::write(&corners, shared_corners(rig, lenses, dice)).expect("written");
    let lenses = ["--left", &file("left.toml"), "--right", &file("right.toml")];
    let command = ["calibrate", verb, "--json", "--csv", &corners, "--out", &out];
    run_json(&[&command[..], &lenses].concat());
    std::fs::read_to_string(&out).expect("a rig file")
}
