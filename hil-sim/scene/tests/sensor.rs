//! Noise, vignette and exposure of the sensor are as stated.

#![allow(clippy::unwrap_used, reason = "a test fails by panicking")]

mod common;

use common::{fisheye, photograph, pose};
use nalgebra::{UnitQuaternion, Vector3};
use vergence_scene::{Optics, Scene, Target};
use vergence_vision::{Angle, ImageSize, KannalaBrandt, Length, Pixel, Transform};

/// Mean and variance of the green level of a telephoto view onto one white square, over many seeds.
fn flat_patch(optics: &Optics) -> (f64, f64) {
    const SIDE: u32 = 12;
    const SEEDS: u64 = 200;
    let target = Target { columns: 1, rows: 1, square: Length::from_mm(900.0) };
    // The square right of and above the corner is white.
    let world_from_target = Transform::new(UnitQuaternion::identity(), Vector3::new(-450.0, 450.0, 800.0));
    let scene = Scene::target_in_studio(target, world_from_target);
    let size = ImageSize { width: SIDE, height: SIDE };
    let k = [2000.0, 0.0, 0.0, 0.0, 0.0];
    let camera = KannalaBrandt::new(k, 1.0, Pixel { u: 5.5, v: 5.5 }, Angle::from_deg(40.0), size).unwrap();
    let mut levels = Vec::new();
    for seed in 0..SEEDS {
        let photo = photograph(&scene, &camera, pose([0.0; 3], 0.0), optics, seed);
        levels.extend(photo.image.pixels().map(|pixel| f64::from(pixel.0[1])));
    }
    let n = levels.len() as f64;
    let mean = levels.iter().sum::<f64>() / n;
    (mean, levels.iter().map(|level| (level - mean).powi(2)).sum::<f64>() / (n - 1.0))
}

#[test]
fn noise_has_the_stated_variance() {
    /// Variance of rounding to whole grey levels.
    const ROUNDING: f64 = 1.0 / 12.0;
    for (read_noise, shot_noise, gain) in [(2.0, 0.0, 0.4), (0.0, 3.0, 0.4), (1.5, 2.5, 0.1), (1.5, 2.5, 0.7)] {
        let optics = Optics { read_noise, shot_noise, gain, ..Optics::ideal() };
        let (mean, variance) = flat_patch(&optics);
        let stated = read_noise * read_noise + shot_noise * shot_noise * mean / 255.0 + ROUNDING;
        // 28 800 samples: the variance is known to 1 %.
        assert!((variance / stated - 1.0).abs() < 0.04, "variance {variance} where {stated} is stated, level {mean}");
    }
}

#[test]
fn a_quiet_sensor_shows_a_flat_patch_flat() {
    // Reflectance 0.82 in unit light is 0.916 of white in sRGB (IEC 61966-2-1).
    let (mean, variance) = flat_patch(&Optics::ideal());
    assert!((mean - 0.916 * 255.0).abs() < 1.0 && variance < 1e-9, "mean {mean}, variance {variance}");
}

#[test]
fn gain_brightens_and_the_vignette_darkens_towards_the_edge() {
    let (scene, camera) = (Scene::room(), fisheye(96));
    let level = |optics: &Optics| photograph(&scene, &camera, pose([0.0; 3], 0.0), optics, 4).image;
    let plain = level(&Optics::ideal());
    let vignetted = level(&Optics { vignette: 0.6, ..Optics::ideal() });
    let bright = level(&Optics { gain: 1.5, ..Optics::ideal() });
    assert!(plain.iter().zip(vignetted.iter()).all(|(a, b)| b <= a));
    assert!(plain.iter().zip(bright.iter()).all(|(a, b)| b >= a));
    let sum = |image: &image::RgbImage, inner: bool| {
        let near = |x: u32, y: u32| (f64::from(x) - 47.5).hypot(f64::from(y) - 47.5) < 20.0;
        image
            .enumerate_pixels()
            .filter(|(x, y, _)| near(*x, *y) == inner)
            .map(|(_, _, p)| f64::from(p.0[1]))
            .sum::<f64>()
    };
    let (centre, edge) = (sum(&vignetted, true) / sum(&plain, true), sum(&vignetted, false) / sum(&plain, false));
    assert!(centre > 0.92 && edge < 0.80, "centre {centre}, edge {edge}");
}

#[test]
fn more_blur_leaves_less_contrast_and_the_same_mean() {
    let (scene, camera) = (Scene::room(), fisheye(256));
    let view = |blur_px: f64| {
        let optics = Optics { blur_px, ..Optics::ideal() };
        photograph(&scene, &camera, pose([0.0; 3], 0.0), &optics, 4).image
    };
    let statistics = |image: &image::RgbImage| {
        let level = |x: u32, y: u32| f64::from(image.get_pixel(x, y).0[1]);
        let middle = || (80..176).flat_map(|y| (80..176).map(move |x| (x, y)));
        let roughness: f64 = middle().map(|(x, y)| (level(x + 1, y) - level(x, y)).powi(2)).sum();
        // Blur keeps the mean of the light, which the encoding is about the 2.2th root of.
        (middle().map(|(x, y)| (level(x, y) / 255.0).powf(2.2)).sum::<f64>() / 9216.0, roughness)
    };
    let (sharp, soft) = (statistics(&view(0.2)), statistics(&view(1.0)));
    assert!(soft.1 < 0.6 * sharp.1, "roughness {} and {}", sharp.1, soft.1);
    assert!((soft.0 / sharp.0 - 1.0).abs() < 0.01, "means {} and {}", sharp.0, soft.0);
}
