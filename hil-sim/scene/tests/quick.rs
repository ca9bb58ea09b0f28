//! Images in real time show what exact ones do, up to the rim of the field.

#![allow(clippy::unwrap_used, reason = "a test fails by panicking")]

#[allow(dead_code, reason = "other tests take exact images by a function")]
mod common;

use common::{fisheye, pose};
use image::RgbImage;
use vergence_scene::{Lens, LensChoice, Optics, RayTable, Scene, View, render, render_quick};

const SIDE: u32 = 200;
/// A lens without noise.
const STILL: Optics =
    Optics { samples: 12, edge_samples: 36, blur_px: 0.5, read_noise: 0.0, shot_noise: 0.0, vignette: 0.4, gain: 1.0 };

fn lenses() -> impl Iterator<Item = (String, Box<dyn Lens>)> {
    LensChoice::ALL.into_iter().map(|choice| {
        let lens: Box<dyn Lens> = Box::new(choice.in_place_of(&fisheye(SIDE)).unwrap());
        (choice.to_string(), lens)
    })
}

fn quick(scene: &Scene, lens: &dyn Lens, table: &RayTable, yaw_deg: f64, seed: u64) -> RgbImage {
    let here = pose([-72.5, 0.0, 0.0], yaw_deg);
    let view = View { scene, camera: lens, world_from_camera: here, optics: &STILL };
    render_quick(&view, table, seed, &|_| here)
}

/// Mean and root mean square of the differences in grey levels.
fn difference(a: &RgbImage, b: &RgbImage, counts: impl Fn(u32, u32) -> bool) -> (f64, f64) {
    let pairs = a.enumerate_pixels().zip(b.pixels()).filter(|((x, y, _), _)| counts(*x, *y));
    let differences: Vec<f64> = pairs
        .flat_map(|((.., a), b)| [0, 1, 2].map(|channel| f64::from(a.0[channel]) - f64::from(b.0[channel])))
        .collect();
    let mean_of = |value: &dyn Fn(f64) -> f64| {
        differences.iter().map(|difference| value(*difference)).sum::<f64>() / differences.len() as f64
    };
    (mean_of(&|d| d), mean_of(&|d| d * d).sqrt())
}

/// Within the field, and in its outermost pixels alone.
#[test]
fn quick_images_show_what_exact_ones_do() {
    let room = Scene::room();
    for (name, lens) in lenses() {
        let table = RayTable::new(&*lens, &STILL);
        for yaw_deg in [30.0, 200.0] {
            let view = View {
                scene: &room,
                camera: &*lens,
                world_from_camera: pose([-72.5, 0.0, 0.0], yaw_deg),
                optics: &STILL,
            };
            let (exact, quick) = (render(&view, 3).image, quick(&room, &*lens, &table, yaw_deg, 3));
            let (mean, rms) = difference(&quick, &exact, |_, _| true);
            assert!(mean.abs() < 0.4 && rms < 6.0, "{name} at {yaw_deg}: mean {mean}, rms {rms}");
            let is_seen = |x: u32, y: u32| exact.get_pixel(x, y).0 != [0; 3];
            let at_rim = |x: u32, y: u32| {
                let beside = [(x.wrapping_sub(3), y), (x + 3, y), (x, y.wrapping_sub(3)), (x, y + 3)];
                is_seen(x, y) && beside.into_iter().any(|(x, y)| x < SIDE && y < SIDE && !is_seen(x, y))
            };
            let (mean, rms) = difference(&quick, &exact, at_rim);
            assert!(mean.abs() < 2.0 && rms < 12.0, "{name} at {yaw_deg}: mean {mean}, rms {rms} at the rim");
        }
    }
}

/// An image does not depend on those that were made with the table before.
#[test]
fn an_image_is_the_same_after_others() {
    let room = Scene::room();
    for (name, lens) in lenses() {
        let table = RayTable::new(&*lens, &STILL);
        let first = quick(&room, &*lens, &table, 30.0, 3);
        assert!(first != quick(&room, &*lens, &table, 200.0, 3), "{name}: another view looks the same");
        assert!(first == quick(&room, &*lens, &table, 30.0, 3), "{name}");
    }
}

/// What is kept while nothing moves is not shown where something has: each image is the one that a new table makes.
#[test]
fn what_is_kept_is_of_this_scene_and_pose() {
    let scenes = [Scene::room(), Scene::corridor()];
    for (name, lens) in lenses() {
        let table = RayTable::new(&*lens, &STILL);
        for (number, yaw_deg, seed) in
            [(0, 30.0, 3), (0, 30.0, 4), (1, 30.0, 4), (1, 31.0, 4), (1, 31.0, 3), (0, 30.0, 4)]
        {
            let scene = &scenes[number];
            let image = quick(scene, &*lens, &table, yaw_deg, seed);
            let alone = quick(scene, &*lens, &RayTable::new(&*lens, &STILL), yaw_deg, seed);
            assert!(image == alone, "{name}: scene {number} at {yaw_deg}, seed {seed}");
        }
    }
}
