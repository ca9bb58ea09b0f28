//! Live simulated cameras are rendered with few rays. Corners are where the exact renderer shows them, to far less than the noise moves
//! them, and the noise is as stated.

#![allow(clippy::unwrap_used, reason = "a test fails by panicking")]
#![allow(clippy::print_stdout, reason = "measured figures are printed")]

mod simulated;

use image::{DynamicImage, RgbImage};
use nalgebra::{UnitQuaternion, Vector3};
use simulated::{COLUMNS, Dice, ROWS, SQUARE_MM, facing_target, seeds};
use vergence_scene::{Optics, RayTable, Scene, Target, View, render, render_quick};
use vergence_targets::{TargetSpec, TargetView, detect};
use vergence_vision::{Angle, Camera, ImageSize, KannalaBrandt, Length, Pixel, Transform, World};

const SPEC: TargetSpec = TargetSpec { columns: COLUMNS, rows: ROWS, square: Length::from_mm(SQUARE_MM) };

/// The middle of the image of a camera whose whole field is 640 pixels wide.
fn lens(side: u32) -> KannalaBrandt {
    let middle = 0.5 * f64::from(side);
    let centre = Pixel { u: middle + 0.3, v: middle - 1.1 };
    let size = ImageSize { width: side, height: side };
    KannalaBrandt::new([187.0, -3.0, 0.4, 0.0, 0.0], 1.001, centre, Angle::from_deg(98.0), size).unwrap()
}

fn corners(image: RgbImage, lens: &KannalaBrandt) -> Option<TargetView> {
    let grey = DynamicImage::from(image).to_luma8();
    Some(detect(&grey, &SPEC, Some(lens)).ok()?.view("", &SPEC))
}

/// Differences of the corners of both, in pixels.
fn differences(quick: &TargetView, exact: &TargetView) -> Vec<[f64; 2]> {
    let near = |a: [f64; 2], b: [f64; 2]| (a[0] - b[0]).hypot(a[1] - b[1]) < 1e-6;
    let found = exact.corners.iter().filter_map(|exact| {
        let quick = quick.corners.iter().find(|quick| near(quick.target_mm, exact.target_mm))?;
        Some([quick.pixel.u - exact.pixel.u, quick.pixel.v - exact.pixel.v])
    });
    found.collect()
}

/// Mean along u and v, and root mean square of one coordinate.
fn summary(differences: &[[f64; 2]]) -> ([f64; 2], f64) {
    let count = differences.len() as f64;
    let mean = [0, 1].map(|axis| differences.iter().map(|d| d[axis]).sum::<f64>() / count);
    (mean, (differences.iter().flatten().map(|d| d * d).sum::<f64>() / (2.0 * count)).sqrt())
}

/// A chessboard in the furnished room, at places all over the front of the field. `VERGENCE_SEEDS` gives the number of places.
#[test]
fn corners_are_where_the_exact_renderer_shows_them() {
    let places = seeds(3);
    let (camera, optics) = (lens(420), Optics::default());
    let table = RayTable::new(&camera, &optics);
    let here = Transform::<World, Camera>::new(UnitQuaternion::identity(), Vector3::zeros());
    let (room, mut dice) = (Scene::room(), Dice::new(5));
    let target = Target { columns: COLUMNS, rows: ROWS, square: SPEC.square };
    let (mut quick_exact, mut exact_exact) = (Vec::new(), Vec::new());
    for seed in 0..places {
        let [x, y] = [dice.between(-0.7, 0.7), dice.between(-0.7, 0.7)];
        let middle = Vector3::new(x, y, 1.0).normalize() * dice.between(200.0, 300.0);
        let board = Transform::<World, Target>::from_isometry(facing_target(&mut dice, middle, 15.0));
        let scene = room.clone().with_target(target, board);
        let view = View { scene: &scene, camera: &camera, world_from_camera: here, optics: &optics };
        let [exact, again] = [2 * seed, 2 * seed + 1].map(|seed| corners(render(&view, seed).image, &camera));
        let quick = corners(render_quick(&view, &table, seed, &|_| here), &camera);
        let (Some(exact), Some(again), Some(quick)) = (exact, again, quick) else { continue };
        quick_exact.extend(differences(&quick, &exact));
        exact_exact.extend(differences(&again, &exact));
    }
    let ([bias_u, bias_v], rms) = summary(&quick_exact);
    let (_, rms_of_exact) = summary(&exact_exact);
    let scatter = rms / (quick_exact.len() as f64).sqrt();
    println!(
        "{} corners: quick - exact {bias_u:.4}, {bias_v:.4} ± {scatter:.4} px, rms {rms:.4} px; exact - exact of other noise rms {rms_of_exact:.4} px",
        quick_exact.len()
    );
    assert!(quick_exact.len() as u64 > places * 20, "corners in too few pictures");
    assert!(bias_u.abs().max(bias_v.abs()) < 0.003 + 3.0 * scatter, "drawn by {bias_u}, {bias_v} ± {scatter} px");
    assert!(rms < 2.0 * rms_of_exact, "{rms} px beside {rms_of_exact} px of noise alone");
}

/// The variance of each grey level from picture to picture, by level, against that of the sensor.
#[test]
fn the_noise_is_as_stated() {
    let (camera, optics) = (lens(160), Optics { read_noise: 2.0, shot_noise: 3.0, ..Optics::default() });
    let table = RayTable::new(&camera, &optics);
    let here = Transform::<World, Camera>::new(UnitQuaternion::identity(), Vector3::zeros());
    // One colour, so that no edge is sampled anew.
    let board = Transform::<World, Target>::new(UnitQuaternion::identity(), Vector3::new(0.0, 0.0, -1e6));
    let target = Target { columns: COLUMNS, rows: ROWS, square: SPEC.square };
    let scene = Scene::target_alone(target, board);
    let view = View { scene: &scene, camera: &camera, world_from_camera: here, optics: &optics };
    let pictures: Vec<RgbImage> = (0..40).map(|seed| render_quick(&view, &table, seed, &|_| here)).collect();
    let (mut shares, mut count) = (0.0, 0.0);
    for index in (0..pictures[0].as_raw().len()).filter(|&index| pictures[0].as_raw()[index] > 40) {
        let levels = pictures.iter().map(|picture| f64::from(picture.as_raw()[index]));
        let (n, mean) = (pictures.len() as f64, levels.clone().sum::<f64>() / pictures.len() as f64);
        let variance = levels.map(|level| (level - mean).powi(2)).sum::<f64>() / (n - 1.0);
        // Rounding adds 1/12.
        shares += variance / (4.0 + 9.0 * mean / 255.0 + 1.0 / 12.0);
        count += 1.0;
    }
    println!("{count} pixels: variance {:.4} of the stated one", shares / count);
    assert!(count > 20_000.0 && (shares / count - 1.0).abs() < 0.01, "{} of {count}", shares / count);
}
