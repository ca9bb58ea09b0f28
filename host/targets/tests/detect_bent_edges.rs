//! Edges bend in a fisheye image. A corner taken as the meeting of straight edges is then drawn outward by a hundredth
//! of a pixel: little, but common to all corners, so that it shows in every calibration from many of them.

#![allow(clippy::unwrap_used, reason = "a test fails by panicking")]
#![allow(clippy::print_stdout, reason = "measured figures are printed")]

mod simulated;

use image::{DynamicImage, GrayImage};
use nalgebra::{Isometry3, UnitQuaternion, Vector3};
use simulated::{COLUMNS, Dice, ROWS, SQUARE_MM, facing_target, photograph};
use vergence_scene::{Optics, Scene, Target, View, render};
use vergence_targets::{TargetSpec, TargetView, detect};
use vergence_vision::{Angle, Camera, ImageSize, KannalaBrandt, Length, Pixel, Transform, World};

const SPEC: TargetSpec = TargetSpec { columns: COLUMNS, rows: ROWS, square: Length::from_mm(SQUARE_MM) };
const TARGETS: usize = 4;
const SIDE: u32 = 700;

/// A part of a lens's field of 196°, so that edges bend much and little is rendered. The image is to the right of the
/// lens's centre; `scale` makes it another lens.
fn lens(scale: f64) -> KannalaBrandt {
    let centre = Pixel { u: -40.0, v: 0.5 * f64::from(SIDE) };
    let size = ImageSize { width: SIDE, height: SIDE };
    KannalaBrandt::new([374.0 * scale, -6.0, 0.5, 0.0, 0.0], 1.001, centre, Angle::from_deg(98.0), size).unwrap()
}

fn picture(camera_from_target: Isometry3<f64>, seed: u64) -> GrayImage {
    let target = Target { columns: COLUMNS, rows: ROWS, square: SPEC.square };
    let scene = Scene::target_alone(target, Transform::<World, Target>::from_isometry(camera_from_target));
    let world_from_camera = Transform::<World, Camera>::new(UnitQuaternion::identity(), Vector3::zeros());
    let optics = Optics { samples: 1, edge_samples: 60, blur_px: 0.6, read_noise: 0.5, ..Optics::default() };
    let camera = lens(1.0);
    DynamicImage::from(render(&View { scene: &scene, camera: &camera, world_from_camera, optics: &optics }, seed).image)
        .to_luma8()
}

/// How far outward of the truth each corner was found, in pixels.
fn outward(found: &TargetView, truth: &TargetView) -> Vec<f64> {
    let centre = lens(1.0).centre();
    let near = |a: [f64; 2], b: [f64; 2]| (a[0] - b[0]).hypot(a[1] - b[1]) < 1e-6;
    let of = |truth: &vergence_targets::Corner| {
        let found = found.corners.iter().find(|found| near(found.target_mm, truth.target_mm))?;
        let [u, v] = [truth.pixel.u - centre.u, truth.pixel.v - centre.v];
        Some(((found.pixel.u - truth.pixel.u) * u + (found.pixel.v - truth.pixel.v) * v) / u.hypot(v))
    };
    truth.corners.iter().filter_map(of).collect()
}

#[test]
fn corners_of_bent_edges_are_not_drawn_outward() {
    let mut dice = Dice::new(1);
    // A lens that is as right as a first calibration makes it.
    let rough = lens(1.01);
    let (mut plain, mut straightened) = (Vec::new(), Vec::new());
    for seed in 0..TARGETS {
        let theta = dice.between(40.0, 60.0).to_radians();
        let target = facing_target(&mut dice, Vector3::new(theta.sin(), 0.0, theta.cos()) * 300.0, 15.0);
        let truth = photograph(&lens(1.0), &target, 0.0, &mut dice);
        let image = picture(target, seed as u64);
        for (hint, errors) in [(None, &mut plain), (Some(&rough), &mut straightened)] {
            errors.extend(outward(&detect(&image, &SPEC, hint).unwrap().view("", &SPEC), &truth));
        }
    }
    let mean = |errors: &[f64]| errors.iter().sum::<f64>() / errors.len() as f64;
    let [plain, straightened] = [plain, straightened].map(|errors| {
        let scatter = (errors.iter().map(|error| error * error).sum::<f64>()).sqrt() / errors.len() as f64;
        println!("{} corners, drawn outward by {:.4} ± {scatter:.4} px", errors.len(), mean(&errors));
        mean(&errors)
    });
    assert!(plain > 0.006, "these targets do not show the bias: {plain}");
    assert!(straightened.abs() < 0.003, "{straightened}");
}
