//! Corners of a rendered target are where they are projected.

#![allow(clippy::unwrap_used, reason = "a test fails by panicking")]

mod common;

use std::sync::LazyLock;

use common::{fisheye, photograph, pose};
use image::RgbImage;
use nalgebra::{Matrix2, UnitQuaternion, Vector2, Vector3};
use vergence_scene::{Optics, Scene, Target};
use vergence_vision::{Angle, ImageSize, KannalaBrandt, Length, Pixel, Transform, World};

const TARGET: Target = Target { columns: 7, rows: 5, square: Length::from_mm(30.0) };

/// The default lens and sensor, with edges sampled so finely that the sensor's noise prevails.
static FINE: LazyLock<Optics> = LazyLock::new(|| Optics { edge_samples: 200, ..Optics::default() });

/// A target facing the origin, `distance` mm away at the angle `theta` to the right of forward, turned by `roll`.
fn facing(theta: Angle, distance: f64, roll: Angle) -> Transform<World, Target> {
    let direction = Vector3::new(theta.rad().sin(), 0.1, theta.rad().cos()).normalize();
    let rotation = UnitQuaternion::face_towards(&direction, &Vector3::y())
        * UnitQuaternion::from_axis_angle(&Vector3::z_axis(), roll.rad());
    Transform::new(rotation, direction * distance - rotation * TARGET.centre().mm())
}

/// The point to which all grey-level gradients about `start` are square, by least squares (W. Förstner and E. Gülch,
/// "A fast operator for detection and precise location of distinct points", ISPRS 1987).
fn corner_near(image: &RgbImage, start: Pixel) -> Pixel {
    const RADIUS: i32 = 8;
    const SIGMA: f64 = 3.0;
    let grey = |x: i32, y: i32| f64::from(image.get_pixel(x.cast_unsigned(), y.cast_unsigned()).0[1]);
    let (column, row) = (start.u.round() as i32, start.v.round() as i32);
    let mut corner = Vector2::new(f64::from(column), f64::from(row));
    for _ in 0..30 {
        let (mut squares, mut moments) = (Matrix2::zeros(), Vector2::zeros());
        for (x, y) in
            (row - RADIUS..=row + RADIUS).flat_map(|y| (column - RADIUS..=column + RADIUS).map(move |x| (x, y)))
        {
            let place = Vector2::new(f64::from(x), f64::from(y));
            let weight = (-0.5 * (place - corner).norm_squared() / (SIGMA * SIGMA)).exp();
            let gradient = Vector2::new(grey(x + 1, y) - grey(x - 1, y), grey(x, y + 1) - grey(x, y - 1));
            let square = gradient * gradient.transpose() * weight;
            squares += square;
            moments += square * place;
        }
        corner = squares.try_inverse().unwrap() * moments;
    }
    Pixel { u: corner.x, v: corner.y }
}

/// The part of `camera`'s image of `side` pixels about the middle of the target.
fn window(camera: &KannalaBrandt, middle: Pixel, side: u32) -> KannalaBrandt {
    let start = |x: f64| x.round() - f64::from(side / 2);
    let centre = Pixel { u: camera.centre().u - start(middle.u), v: camera.centre().v - start(middle.v) };
    let size = ImageSize { width: side, height: side };
    KannalaBrandt::new(camera.k(), camera.aspect(), centre, camera.theta_max(), size).unwrap()
}

/// Errors in pixels of the corners found that lie between two angles to the axis.
fn errors(optics: &Optics, world_from_target: Transform<World, Target>, between: [f64; 2]) -> Vec<Vector2<f64>> {
    let world_from_camera = pose([12.0, -7.0, 3.0], 2.0);
    let camera_from_target = world_from_camera.inverse() * world_from_target;
    let whole = fisheye(1280);
    let middle = whole.project_point(&(camera_from_target * TARGET.centre())).unwrap();
    let camera = window(&whole, middle, 200);
    let scene = Scene::target_in_studio(TARGET, world_from_target);
    let photo = photograph(&scene, &camera, world_from_camera, optics, 5);
    let corners = (0..TARGET.rows).flat_map(|j| (0..TARGET.columns).map(move |i| TARGET.corner(i, j)));
    corners
        .map(|corner| camera_from_target * corner)
        .filter(|corner| {
            let theta = corner.mm().xy().norm().atan2(corner.mm().z).to_degrees();
            (between[0]..between[1]).contains(&theta)
        })
        .map(|corner| {
            let truth = camera.project_point(&corner).unwrap();
            let found = corner_near(&photo.image, truth);
            Vector2::new(found.u - truth.u, found.v - truth.v)
        })
        .collect()
}

fn assert_unbiased(errors: &[Vector2<f64>], least: usize) {
    assert!(errors.len() >= least, "only {} corners in sight", errors.len());
    let worst = errors.iter().map(|e| e.norm()).fold(0.0, f64::max);
    let mean = errors.iter().sum::<Vector2<f64>>() / errors.len() as f64;
    assert!(worst < 0.1, "worst {worst} px");
    // The edges are curved in the image, which draws corners near the rim of the field inwards by 0.02 px.
    assert!(mean.norm() < 0.04, "mean {mean} px");
}

#[test]
fn corners_in_front_lie_where_they_are_projected() {
    let target = facing(Angle::from_deg(8.0), 520.0, Angle::from_deg(0.0));
    assert_unbiased(&errors(&FINE, target, [0.0, 60.0]), 35);
}

#[test]
fn corners_of_a_turned_target_lie_where_they_are_projected() {
    let target = facing(Angle::from_deg(-48.0), 480.0, Angle::from_deg(24.0));
    assert_unbiased(&errors(&Optics { blur_px: 0.6, ..*FINE }, target, [0.0, 90.0]), 35);
}

#[test]
fn corners_behind_the_image_plane_lie_where_they_are_projected() {
    let target = facing(Angle::from_deg(91.0), 560.0, Angle::from_deg(10.0));
    assert_unbiased(&errors(&FINE, target, [90.0, 96.5]), 8);
}

#[test]
fn a_target_hangs_in_the_room_too() {
    let target = facing(Angle::from_deg(0.0), 400.0, Angle::from_deg(0.0));
    let room = Scene::room().with_target(TARGET, target);
    for i in 0..TARGET.columns {
        let corner = target * TARGET.corner(i, 2);
        let hit = room.cast(&vergence_vision::Point::from_mm(Vector3::zeros()), &corner.direction().unwrap()).unwrap();
        assert!((hit.range.mm() - corner.mm().norm()).abs() < 1e-9);
    }
}
