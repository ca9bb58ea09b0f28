//! How long the solvers and the detector take, on simulated corners and a rendered target.
//!
//! `cargo bench -p vergence-calibration`
#![allow(
    clippy::unwrap_used,
    missing_docs,
    reason = "a bench may fail; criterion's macros make items without comments"
)]

#[path = "../tests/simulated/mod.rs"]
mod simulated;

use std::hint::black_box;

use criterion::{Criterion, criterion_group, criterion_main};
use image::{DynamicImage, GrayImage};
use nalgebra::{UnitQuaternion, Vector3};
use simulated::stage::{Bench, SIX_POSES};
use simulated::{Dice, Pair, lens, other_lens, own_views, pair_pose};
use vergence_calibration::{
    ExtrinsicsOptions, IntrinsicsOptions, StageOptions, calibrate_extrinsics, calibrate_intrinsics, calibrate_stage,
};
use vergence_scene::{Optics, Scene, Target, View, render};
use vergence_targets::{TargetSpec, detect};
use vergence_vision::{Angle, Camera, ImageSize, KannalaBrandt, Length, Pixel, Transform, World};

fn solvers(criterion: &mut Criterion) {
    let views = own_views(&lens(), 30, 0.1, &mut Dice::new(1));
    let intrinsics = IntrinsicsOptions::default();
    criterion.bench_function("intrinsics, 30 views", |bencher| {
        bencher.iter(|| calibrate_intrinsics(black_box(&views), lens().size(), &intrinsics).unwrap());
    });
    let pair = Pair { left: lens(), right: other_lens(), left_from_right: pair_pose(120.0), noise_px: 0.1 };
    let shared = pair.views(12, &mut Dice::new(2));
    let extrinsics = ExtrinsicsOptions::default();
    criterion.bench_function("extrinsics, 12 views", |bencher| {
        bencher.iter(|| calibrate_extrinsics(&pair.left, &pair.right, black_box(&shared), &extrinsics).unwrap());
    });
    let mut dice = Dice::new(3);
    let bench = Bench::built(&mut dice);
    let poses: Vec<_> = SIX_POSES.iter().map(|&at| bench.pose(at, 12, 0.1, &mut dice)).collect();
    let stage = StageOptions::default();
    criterion.bench_function("stage, 6 poses of 12 views", |bencher| {
        bencher.iter(|| calibrate_stage(&bench.drawn, black_box(&poses), &stage).unwrap());
    });
}

/// A target of 9 x 6 corners, tilted, in a picture of 1280 x 1280.
fn photograph() -> GrayImage {
    let size = ImageSize { width: 1280, height: 1280 };
    let centre = Pixel { u: 639.8, v: 639.3 };
    let camera = KannalaBrandt::new([374.0, -6.0, 0.5, 0.0, 0.0], 1.001, centre, Angle::from_deg(98.0), size).unwrap();
    let target = Target { columns: 9, rows: 6, square: Length::from_mm(24.0) };
    let rotation = UnitQuaternion::from_scaled_axis(Vector3::new(0.4, -0.3, 0.2));
    let place =
        Transform::<World, Target>::new(rotation, Vector3::new(60.0, -20.0, 260.0) - rotation * target.centre().mm());
    let world_from_camera = Transform::<World, Camera>::new(UnitQuaternion::identity(), Vector3::zeros());
    let (scene, optics) = (Scene::target_in_studio(target, place), Optics { edge_samples: 60, ..Optics::default() });
    let view = View { scene: &scene, camera: &camera, world_from_camera, optics: &optics };
    DynamicImage::from(render(&view, 1).image).to_luma8()
}

fn detection(criterion: &mut Criterion) {
    let (picture, target) = (photograph(), TargetSpec { columns: 9, rows: 6, square: Length::from_mm(24.0) });
    assert!(detect(&picture, &target, None).unwrap().complete);
    criterion.bench_function("detection, 1280 x 1280", |bencher| {
        bencher.iter(|| detect(black_box(&picture), &target, None).unwrap());
    });
}

criterion_group! {
    name = benches;
    config = Criterion::default().sample_size(20);
    targets = solvers, detection
}
criterion_main!(benches);
