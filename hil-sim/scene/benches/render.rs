//! Seconds a rendered view of a target takes on one thread.
#![allow(clippy::unwrap_used, missing_docs, reason = "a benchmark may fail, and criterion's macros write no docs")]

use criterion::{Criterion, criterion_group, criterion_main};
use nalgebra::{UnitQuaternion, Vector3};
use vergence_scene::{Optics, Scene, Target, View, render};
use vergence_vision::{Angle, Camera, ImageSize, KannalaBrandt, Length, Pixel, Transform, World};

fn targets(criterion: &mut Criterion) {
    let size = ImageSize { width: 2048, height: 2048 };
    let centre = Pixel { u: 1022.0, v: 1025.5 };
    let camera =
        KannalaBrandt::new([600.0, 6.0, -2.4, 0.6, -0.12], 1.0004, centre, Angle::from_deg(98.0), size).unwrap();
    let target = Target { columns: 9, rows: 6, square: Length::from_mm(25.0) };
    let rotation = UnitQuaternion::from_scaled_axis(Vector3::new(0.2, -0.3, 0.1));
    let middle = Vector3::new(120.0, 40.0, 380.0) - rotation * target.centre().mm();
    let place = Transform::<World, Target>::new(rotation, middle);
    let world_from_camera = Transform::<World, Camera>::new(UnitQuaternion::identity(), Vector3::zeros());
    let few = Optics { samples: 1, edge_samples: 100, ..Optics::default() };
    let many = Optics { samples: 6, ..few };
    let pool = rayon::ThreadPoolBuilder::new().num_threads(1).build().unwrap();
    for (name, scene, optics) in [
        ("target alone, one ray", Scene::target_alone(target, place), few),
        ("target in the studio, one ray", Scene::target_in_studio(target, place), few),
        ("target in the studio, six rays", Scene::target_in_studio(target, place), many),
    ] {
        let view = View { scene: &scene, camera: &camera, world_from_camera, optics: &optics };
        criterion.bench_function(name, |bencher| bencher.iter(|| pool.install(|| render(&view, 1))));
    }
}

criterion_group! {
    name = benches;
    config = Criterion::default().sample_size(10);
    targets = targets
}
criterion_main!(benches);
