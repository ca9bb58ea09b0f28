//! Laws for every ray, pixel and seed.

#![allow(clippy::unwrap_used, reason = "a test fails by panicking")]

mod common;

use std::sync::LazyLock;

use common::{fisheye, photograph, pose};
use nalgebra::Vector3;
use proptest::prelude::*;
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64Mcg;
use vergence_scene::{Lens, LensChoice, Optics, Scene, TrueLens, View, render, render_rolling};
use vergence_vision::{Angle, Camera, Length, Pixel, Point, UnitRay, World};

static ROOM: LazyLock<Scene> = LazyLock::new(Scene::room);

fn point(mm: [f64; 3]) -> Point<World> {
    Point::from_mm(Vector3::from(mm))
}

/// A rig file may hold a lens whose pupil moves: its simulated cameras must see as that lens does, in whole pictures and in parts of them.
#[test]
fn a_pupil_of_the_rig_file_is_rendered() {
    let camera = fisheye(128).with_pupil(Length::from_mm(2.8)).unwrap();
    let world_from_camera = pose([-72.0, 0.0, 0.0], 20.0);
    let photo = render(&View { scene: &ROOM, camera: &camera, world_from_camera, optics: &Optics::default() }, 1);
    let mut farthest = 0.0_f64;
    for (x, y) in pixels(128) {
        let pixel = Pixel { u: f64::from(x), v: f64::from(y) };
        let Ok(ray) = camera.unproject::<Camera>(pixel) else { continue };
        let cast = |start| ROOM.cast(&start, &(world_from_camera * ray)).unwrap().range.mm();
        let expected = cast(world_from_camera * camera.origin_of(&ray));
        assert!((photo.range.at(x, y).unwrap().mm() - expected).abs() < 1e-3, "at {x}, {y}");
        farthest = farthest.max((cast(world_from_camera.origin()) - expected).abs());
    }
    assert!(farthest > 1.0, "{farthest} mm");
    let TrueLens::Ideal(part) = camera.before_part([20, 30], camera.size()).unwrap() else { panic!("another lens") };
    assert_eq!(part.pupil(), camera.pupil());
}

/// Clouds are judged from the camera's origin, while the light of a pixel starts from a pupil before it: the place at the true range is where the
/// lens images it, and where the renderer met it.
#[test]
fn a_true_range_counts_from_the_origin_to_the_place_that_the_pixel_shows() {
    let ideal = fisheye(128);
    let pupil = ideal.with_pupil(Length::from_mm(2.8)).unwrap();
    let traced = "sigma8_f18".parse::<LensChoice>().unwrap().in_place_of(&ideal).unwrap();
    let world_from_camera = pose([-72.0, 0.0, 0.0], 20.0);
    // The pupil is e(θ) before the origin, which makes e(θ) cos θ of the range: at most 0.3 mm, near 60 degrees.
    let cameras: [(&dyn Lens, f64); 3] = [(&ideal, 0.0), (&pupil, 0.2), (&traced, 0.2)];
    for (camera, differs) in cameras {
        let view = View { scene: &ROOM, camera, world_from_camera, optics: &Optics::default() };
        let photo = render(&view, 1);
        let (mut farthest, mut seen) = (0.0_f64, 0);
        for (x, y) in pixels(128) {
            let pixel = Pixel { u: f64::from(x), v: f64::from(y) };
            let (Some((start, ray)), Some(along)) = (camera.light_of(pixel), photo.range.at(x, y)) else { continue };
            let place = Point::<Camera>::from_mm(start.mm() + ray.vector() * along.mm());
            let range = view.true_range(pixel).unwrap().mm();
            assert!((range - place.mm().norm()).abs() < 1e-3, "{range} mm at {x}, {y}");
            let Pixel { u, v } = camera.image_of(&place).unwrap();
            assert!((u - pixel.u).hypot(v - pixel.v) < 1e-5, "{u}, {v} at {x}, {y}");
            farthest = farthest.max((range - along.mm()).abs());
            seen += 1;
        }
        assert!(seen > 1000 && (differs == 0.0 || farthest > differs), "{} pixels, {farthest} mm", seen);
    }
}

proptest! {
    #[test]
    fn every_ray_in_the_room_hits_something(
        origin in prop::array::uniform3(-450.0..450.0_f64),
        direction in prop::array::uniform3(-1.0..1.0_f64),
    ) {
        let Some(ray) = UnitRay::new(Vector3::from(direction)) else { return Ok(()) };
        let hit = ROOM.cast(&point(origin), &ray);
        prop_assert!(hit.is_some());
        let (range, colour) = hit.map(|hit| (hit.range.mm(), hit.colour)).unwrap();
        prop_assert!((1e-3..6000.0).contains(&range));
        prop_assert!(colour.iter().all(|c| (0.0..4.0).contains(c)));
    }

    #[test]
    fn rays_along_axes_and_into_edges_of_the_room_do_not_escape(signs in prop::array::uniform3(-1_i8..=1)) {
        // The room's corners as seen from the origin, and its walls head-on.
        let corner = Vector3::new(
            2000.0 * f64::from(signs[0]),
            if signs[1] < 0 { -1400.0 } else { 1200.0 * f64::from(signs[1]) },
            2500.0 * f64::from(signs[2]),
        );
        let Some(ray) = UnitRay::new(corner) else { return Ok(()) };
        let hit = ROOM.cast(&point([0.0; 3]), &ray);
        prop_assert!(hit.is_some_and(|hit| hit.range.mm() <= corner.norm() + 1e-6));
    }

    #[test]
    fn the_vignette_darkens_monotonically(loss in 0.0..1.0_f64, a in 0.0..98.0_f64, b in 0.0..98.0_f64) {
        let optics = Optics { vignette: loss, ..Optics::ideal() };
        let falloff = |deg: f64| optics.falloff(Angle::from_deg(deg), Angle::from_deg(98.0));
        prop_assert!(falloff(a.min(b)) >= falloff(a.max(b)));
        prop_assert!((falloff(0.0) - 1.0).abs() < 1e-12 && (falloff(98.0) - (1.0 - loss)).abs() < 1e-12);
    }
}

/// Each row of a rolling shutter equals that of a camera at rest in the pose of that row.
#[test]
fn a_rolling_shutter_sees_each_row_from_its_own_place() {
    let camera = fisheye(48);
    let at = |row: u32| pose([10.0 * f64::from(row), 0.0, 0.0], 0.5 * f64::from(row));
    let optics = Optics { blur_px: 0.0, edge_samples: 6, ..Optics::default() };
    let view = |row| View { scene: &ROOM, camera: &camera, world_from_camera: at(row), optics: &optics };
    let moving = render_rolling(&view(0), 5, &at);
    for row in [3, 24, 40] {
        let standing = render(&view(row), 5);
        let difference = |x: u32| {
            let [a, b] = [&moving, &standing].map(|photograph| photograph.image.get_pixel(x, row).0.map(i32::from));
            a.iter().zip(b).map(|(a, b)| (a - b).abs()).max().unwrap_or(0)
        };
        // More rays are cast where the rows beside show something else.
        let same = (0..48).filter(|&x| difference(x) <= 8).count();
        assert!(same >= 44, "row {row}: {same}");
    }
    assert_eq!(render_rolling(&view(7), 5, &|_| at(7)), render(&view(7), 5));
}

#[test]
fn ranges_reach_the_plane_of_the_wall() {
    let (camera, world_from_camera) = (fisheye(96), pose([310.0, -120.0, 45.0], 33.0));
    let photo = photograph(&Scene::studio(), &camera, world_from_camera, &Optics::ideal(), 1);
    let mut seen = 0;
    for (x, y) in pixels(96) {
        let ray = camera.unproject::<Camera>(Pixel { u: f64::from(x), v: f64::from(y) });
        assert_eq!(ray.is_ok(), photo.range.at(x, y).is_some(), "the range is defined in the field only");
        let (Ok(ray), Some(range)) = (ray, photo.range.at(x, y)) else { continue };
        // The studio is a cube of 6 m about the world's origin.
        let place = (world_from_camera * ray.at(range.mm())).mm();
        assert!((place.amax() - 3000.0).abs() < 1e-3, "({x}, {y}) is at {place}");
        seen += 1;
    }
    assert!(seen > 5000, "only {seen} pixels");
}

#[test]
fn ranges_agree_with_casting_the_ray_again() {
    let (camera, world_from_camera) = (fisheye(128), pose([-72.0, 0.0, 0.0], 0.0));
    let photo = photograph(&ROOM, &camera, world_from_camera, &Optics::default(), 1);
    for (x, y) in pixels(128) {
        let Ok(ray) = camera.unproject::<Camera>(Pixel { u: f64::from(x), v: f64::from(y) }) else { continue };
        let hit = ROOM.cast(&world_from_camera.origin(), &(world_from_camera * ray)).unwrap();
        assert!((photo.range.at(x, y).unwrap().mm() - hit.range.mm()).abs() < 1e-3);
    }
}

/// The room and its ranges by a traced lens: every ray starts where it crosses the axis, which is millimetres from one angle to the next.
#[test]
fn ranges_through_a_traced_lens_agree_with_casting_its_rays() {
    let world_from_camera = pose([-72.0, 0.0, 0.0], 20.0);
    for choice in LensChoice::ALL {
        let TrueLens::Traced(camera) = choice.in_place_of(&fisheye(128)).unwrap() else { continue };
        let view = View { scene: &ROOM, camera: &camera, world_from_camera, optics: &Optics::default() };
        let photo = render(&view, 1);
        let (mut seen, mut farthest) = (0, 0.0_f64);
        for (x, y) in pixels(128) {
            let Some(ray) = camera.ray(Pixel { u: f64::from(x), v: f64::from(y) }) else { continue };
            let start = world_from_camera * ray.origin;
            let hit = ROOM.cast(&start, &(world_from_camera * ray.direction)).unwrap();
            let by_centre = ROOM.cast(&world_from_camera.origin(), &(world_from_camera * ray.direction)).unwrap();
            assert!((photo.range.at(x, y).unwrap().mm() - hit.range.mm()).abs() < 1e-3, "{choice} at {x}, {y}");
            farthest = farthest.max((by_centre.range.mm() - hit.range.mm()).abs());
            seen += 1;
        }
        assert!(seen > 5000 && farthest > 1.0, "{choice}: {seen} pixels, {farthest} mm");
    }
}

#[test]
fn two_cameras_see_the_same_place_alike() {
    let mut random = Pcg64Mcg::seed_from_u64(9);
    let (left, right) = (point([-72.0, 0.0, 0.0]), point([72.0, 5.0, -3.0]));
    let (mut shared, mut hidden) = (0, 0);
    for _ in 0..4000 {
        let direction = Vector3::from_fn(|_, _| random.random_range(-1.0..1.0));
        let Some(ray) = UnitRay::<World>::new(direction) else { continue };
        let from_left = ROOM.cast(&left, &ray).unwrap();
        let place = left.mm() + ray.at(from_left.range.mm()).mm();
        let offset = place - right.mm();
        let from_right = ROOM.cast(&right, &UnitRay::new(offset).unwrap()).unwrap();
        assert!(from_right.range.mm() <= offset.norm() + 1e-6, "a ray passed through a surface");
        if from_right.range.mm() < offset.norm() - 1e-6 {
            hidden += 1;
            continue;
        }
        shared += 1;
        assert_eq!(from_left.surface, from_right.surface);
        for (a, b) in from_left.colour.iter().zip(from_right.colour) {
            assert!((a - b).abs() < 1e-4, "{from_left:?} and {from_right:?}");
        }
    }
    assert!(shared > 3000 && hidden > 100, "{shared} shared, {hidden} hidden by occlusion");
}

#[test]
fn the_bytes_depend_on_the_seed_and_not_on_the_threads() {
    let with_threads = |threads: usize, seed: u64| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| photograph(&ROOM, &fisheye(96), pose([0.0; 3], 60.0), &Optics::default(), seed))
    };
    let one = with_threads(1, 7);
    assert_eq!(one, with_threads(2, 7));
    assert_eq!(one, with_threads(5, 7));
    let other = with_threads(2, 8);
    assert_ne!(one.image, other.image);
    assert_eq!(one.range, other.range);
}

#[test]
fn outside_the_field_is_black() {
    let camera = fisheye(96);
    let photo = photograph(&ROOM, &camera, pose([0.0; 3], 0.0), &Optics::default(), 1);
    let corner = photo.image.get_pixel(0, 0);
    assert_eq!(corner.0, [0, 0, 0]);
    assert!(photo.range.at(0, 0).is_none() && photo.range.at(96, 0).is_none());
}

fn pixels(side: u32) -> impl Iterator<Item = (u32, u32)> {
    (0..side).flat_map(move |y| (0..side).map(move |x| (x, y)))
}
