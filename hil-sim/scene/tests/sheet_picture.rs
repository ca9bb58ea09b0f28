//! The quick picture of a sheet is the picture that the renderer makes of it.

#![allow(clippy::unwrap_used, clippy::print_stdout, reason = "a test fails by panicking, and shows its figures")]

use image::GrayImage;
use image::imageops::grayscale;
use nalgebra::{UnitQuaternion, Vector3};
use vergence_lens::BuiltIn;
use vergence_scene::{Lens, LensChoice, Optics, Scene, SheetView, Target, TrueLens, View, photograph_sheet, render};
use vergence_vision::{Angle, Camera, ImageSize, KannalaBrandt, Length, Pixel, Point, Transform};

const TARGET: Target = Target { columns: 7, rows: 5, square: Length::from_mm(30.0) };
/// Without noise, so that pictures can be compared.
const OPTICS: Optics = Optics { samples: 1, edge_samples: 200, blur_px: 0.8, vignette: 0.4, ..Optics::ideal() };

fn lens() -> KannalaBrandt {
    let size = ImageSize { width: 640, height: 640 };
    let centre = Pixel { u: 321.3, v: 318.2 };
    KannalaBrandt::new([187.0, -3.0, 0.4, 0.0, 0.0], 1.002, centre, Angle::from_deg(98.0), size).unwrap()
}

/// A target seen at `theta` from the axis, tilted.
fn place(theta: f64, distance: f64, tilt: [f64; 3]) -> Transform<Camera, Target> {
    let direction = Vector3::new(theta.to_radians().sin(), 0.1, theta.to_radians().cos()).normalize();
    let turn = UnitQuaternion::rotation_between(&Vector3::z(), &direction).unwrap();
    TARGET.placed(turn * UnitQuaternion::from_euler_angles(tilt[0], tilt[1], tilt[2]), direction * distance)
}

/// The traced lenses, and the ideal one in whose place they are.
fn lenses() -> [TrueLens; 3] {
    LensChoice::ALL.map(|choice| choice.in_place_of(&lens()).unwrap())
}

fn quick(place: Transform<Camera, Target>, camera: &dyn Lens, optics: &Optics, seed: u64) -> GrayImage {
    photograph_sheet(&SheetView { sheet: TARGET.into(), camera_from_sheet: place, camera, optics }, seed)
}

/// Before the camera, at its side, beyond 90°, at the edge of the field, and from behind.
#[test]
fn it_is_that_of_the_renderer() {
    let tilts = [[0.3, -0.4, 0.2], [0.5, 0.2, -0.7], [-0.3, 0.6, 0.1], [0.1, 0.1, 0.4], [0.2, 3.0, 0.1]];
    let places = [5.0, 60.0, 88.0, 96.0, 30.0].into_iter().zip(tilts);
    for ((theta, tilt), camera) in places.flat_map(|place| lenses().map(|camera| (place, camera))) {
        let place = place(theta, 320.0, tilt);
        let scene = Scene::target_alone(TARGET, place.renamed());
        let world_from_camera = Transform::new(UnitQuaternion::identity(), Vector3::zeros());
        let whole = render(&View { scene: &scene, camera: &camera, world_from_camera, optics: &OPTICS }, 1).image;
        let (whole, quick) = (grayscale(&whole), quick(place, &camera, &OPTICS, 1));
        // Of linear light: near black a level of the picture is a thousandth of white, and luma is not quite the level of the luminance.
        let linear = |level: u8| (f64::from(level) / 255.0).powf(2.2);
        let pairs = whole.pixels().zip(quick.pixels());
        let differences: Vec<f64> = pairs.map(|(a, b)| (linear(a.0[0]) - linear(b.0[0])).abs()).collect();
        let largest = differences.iter().copied().fold(0.0, f64::max);
        let mean = differences.iter().sum::<f64>() / differences.len() as f64;
        println!("{} at {theta}°: {largest:.4} of white at most, {mean:.5} on average", camera.describe());
        // Edges are sampled by other rays, and the renderer casts a single one where an edge crosses only the corner of a pixel.
        assert!(largest <= 0.2 && mean < 0.0005, "at {theta}°: {largest} of white, {mean} on average");
        let dark = quick.pixels().filter(|level| (1..90).contains(&level.0[0])).count();
        assert!(dark > 200 || (theta - 30.0).abs() < 0.5, "at {theta}°: {dark} dark pixels");
    }
}

#[test]
fn noise_has_the_stated_size_and_differs_by_seed() {
    let optics = Optics { read_noise: 5.0, shot_noise: 0.0, ..OPTICS };
    let place = place(10.0, 320.0, [0.1, 0.2, 0.3]);
    let [plain, noisy, other] =
        [(OPTICS, 1), (optics, 1), (optics, 2)].map(|(optics, seed)| quick(place, &lens(), &optics, seed));
    let of = |a: &GrayImage, b: &GrayImage, lag: usize| {
        let noise: Vec<f64> = a.pixels().zip(b.pixels()).map(|(a, b)| f64::from(a.0[0]) - f64::from(b.0[0])).collect();
        let count = (noise.len() - lag) as f64;
        noise.iter().zip(&noise[lag..]).map(|(a, b)| a * b).sum::<f64>() / count
    };
    // Black outside the field has no noise: 187 px/rad times 98° fill most of the picture. Rounding adds 1/12.
    let inside =
        plain.pixels().filter(|level| level.0[0] > 0).count() as f64 / f64::from(plain.width() * plain.height());
    let variance = of(&noisy, &plain, 0) / inside;
    assert!((variance / 25.1 - 1.0).abs() < 0.02, "{variance}");
    assert!(of(&noisy, &plain, 1).abs() < 0.2 && of(&noisy, &plain, 640).abs() < 0.2);
    assert!((of(&noisy, &other, 0) / inside / 50.0 - 1.0).abs() < 0.02);
}

/// Pictures through a traced lens show corners where its own table projects them: up to 5 pixels of 2048 from where they would be if its pupil stood
/// still.
#[test]
fn a_corner_is_where_the_traced_lens_projects_it() {
    for design in BuiltIn::ALL {
        let camera = LensChoice::Traced(design).in_place_of(&lens()).unwrap();
        for (theta, distance) in [(20.0, 300.0), (70.0, 300.0), (70.0, 900.0), (90.0, 200.0)] {
            let place = place(theta, distance, [0.0; 3]);
            let at: Point<Camera> = place * TARGET.corner(3, 2);
            let expected = camera.image_of(&at).unwrap();
            let far = camera.image_of(&Point::from_mm(at.mm() * 1e6)).unwrap();
            let off = saddle(&quick(place, &camera, &OPTICS, 3), &expected);
            let scene = Scene::target_alone(TARGET, place.renamed());
            let world_from_camera = Transform::new(UnitQuaternion::identity(), Vector3::zeros());
            let whole = render(&View { scene: &scene, camera: &camera, world_from_camera, optics: &OPTICS }, 3).image;
            let off_whole = saddle(&grayscale(&whole), &expected);
            let moved = (far.u - expected.u).hypot(far.v - expected.v);
            println!("{design:?} at {theta}°, {distance} mm: {off:.3} and {off_whole:.3} px; moved by {moved:.2} px");
            assert!(off < 0.08 && off_whole < 0.08, "at {theta}°, {distance} mm: {off} and {off_whole} px");
            assert!(theta < 60.0 || distance > 400.0 || moved > 0.3, "the pupil moves what is near: {moved} px");
        }
    }
}

/// How far the corner by its gradients (W. Förstner and E. Gülch, 1987) lies from `expected`.
fn saddle(image: &GrayImage, expected: &Pixel) -> f64 {
    let grey = |x: i32, y: i32| f64::from(image.get_pixel(x.cast_unsigned(), y.cast_unsigned()).0[0]);
    let (column, row) = (expected.u.round() as i32, expected.v.round() as i32);
    let (mut squares, mut moments) = (nalgebra::Matrix2::zeros(), nalgebra::Vector2::zeros());
    for (x, y) in (row - 4..=row + 4).flat_map(|y| (column - 4..=column + 4).map(move |x| (x, y))) {
        let place = nalgebra::Vector2::new(f64::from(x) - expected.u, f64::from(y) - expected.v);
        let weight = (-0.25 * place.norm_squared()).exp();
        let gradient = nalgebra::Vector2::new(grey(x + 1, y) - grey(x - 1, y), grey(x, y + 1) - grey(x, y - 1));
        let square = gradient * gradient.transpose() * weight;
        squares += square;
        moments += square * place;
    }
    (squares.try_inverse().unwrap() * moments).norm()
}
