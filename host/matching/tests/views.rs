//! Laws of the shared axes and of views.
#![allow(clippy::unwrap_used, reason = "a test that cannot be set up fails")]

use image::GrayImage;
use nalgebra::{UnitQuaternion, Vector3};
use proptest::prelude::*;
use vergence_matching::{Grid, SharedFrame, View, ViewPixel};
use vergence_vision::{Angle, ImageSize, KannalaBrandt, Left, Pixel, Point, Right, Transform, UnitRay};

fn lens() -> KannalaBrandt {
    let size = ImageSize { width: 320, height: 320 };
    let centre = Pixel { u: 158.3, v: 161.9 };
    KannalaBrandt::new([92.0, 1.5, -0.9, 0.2, -0.03], 1.01, centre, Angle::from_deg(98.0), size).unwrap()
}

/// Cameras about 145 mm apart in any direction, turned in any way that keeps much of the field shared.
fn poses() -> impl Strategy<Value = Transform<Left, Right>> {
    let turn = prop::array::uniform3(-0.9..0.9_f64);
    let place = prop::array::uniform3(-100.0..100.0_f64).prop_filter("apart", |p| Vector3::from(*p).norm() > 20.0);
    (turn, place).prop_map(|(turn, place)| {
        Transform::new(UnitQuaternion::from_scaled_axis(Vector3::from(turn)), Vector3::from(place))
    })
}

proptest! {
    #[test]
    fn rows_are_epipolar_curves(
        pose in poses(), direction in prop::array::uniform3(-1.0..1.0_f64), near in 200.0..900.0_f64, far in 1e3..1e6_f64,
    ) {
        let frame = SharedFrame::new(&pose).unwrap();
        let grid = Grid::covering(&frame, &lens(), &lens(), 1.0).unwrap();
        let Some(ray) = UnitRay::<Left>::new(Vector3::from(direction)) else { return Ok(()) };
        let left = frame.shared_from_left() * ray;
        // On the baseline itself a row has no meaning.
        prop_assume!(left.vector().x.abs() < 0.99);
        let row = grid.position(&left).y;
        for range in [near, far] {
            let point: Point<Right> = pose.inverse() * ray.at(range);
            let right = frame.shared_from_right() * point.direction().unwrap();
            let difference = (grid.position(&right).y - row).abs();
            let turn = std::f64::consts::TAU * grid.pixels_per_radian();
            prop_assert!(difference.min((turn - difference).abs()) < 1e-9 * grid.pixels_per_radian(), "{difference}");
            let disparity = grid.position(&left).x - grid.position(&right).x;
            prop_assert!(disparity >= -1e-9, "{disparity}");
        }
    }

    #[test]
    fn positions_of_a_view_map_to_pixels_and_back(pose in poses(), x in 0.0..1.0_f64, y in 0.0..1.0_f64) {
        let frame = SharedFrame::new(&pose).unwrap();
        let grid = Grid::covering(&frame, &lens(), &lens(), 1.0).unwrap();
        let image = GrayImage::new(320, 320);
        let view: View<Right> = View::new(&image, &lens(), frame.shared_from_right(), grid);
        let (width, height) = grid.size();
        let at = ViewPixel { x: x * width as f64, y: y * height as f64 };
        if let Ok(original) = view.original(at) {
            let back = view.position(original).unwrap();
            prop_assert!((back.x - at.x).hypot(back.y - at.y) < 1e-6, "{at:?} {back:?}");
            // The pixel is where the lens shows the bearing of the position.
            let ray = frame.shared_from_right().inverse() * grid.bearing(at).unwrap();
            let projected = lens().project(&ray).unwrap();
            prop_assert!((projected.u - original.u).hypot(projected.v - original.v) < 1e-9);
        } else {
            prop_assert!(!view.sees(at));
        }
    }

    #[test]
    fn bearings_and_positions_are_inverse(pose in poses(), x in 0.0..1.0_f64, y in 0.0..1.0_f64) {
        let frame = SharedFrame::new(&pose).unwrap();
        let grid = Grid::covering(&frame, &lens(), &lens(), 1.3).unwrap();
        let (width, height) = grid.size();
        let at = ViewPixel { x: x * width as f64, y: y * height as f64 };
        let back = grid.position(&grid.bearing(at).unwrap());
        prop_assert!((back.x - at.x).hypot(back.y - at.y) < 1e-9);
    }
}

#[test]
fn x_is_the_baseline_and_z_the_mean_axis() {
    let half = Angle::from_deg(40.0).rad();
    let yaw = |angle: f64| UnitQuaternion::from_axis_angle(&Vector3::y_axis(), angle);
    let left_from_right = Transform::new(yaw(half) * yaw(half), yaw(half) * Vector3::new(145.0, 0.0, 0.0));
    let frame = SharedFrame::new(&left_from_right).unwrap();
    assert!((frame.baseline().mm() - 145.0).abs() < 1e-9);
    let expected = UnitRay::<Left>::new(Vector3::new(-half.sin(), 0.0, half.cos())).unwrap();
    let axis = frame.shared_from_left() * UnitRay::<Left>::new(Vector3::z()).unwrap();
    assert!((axis.vector() - expected.vector()).norm() < 1e-12, "the left axis is 40° left of z: {axis:?}");
}

#[test]
fn optical_axes_along_the_baseline_have_shared_axes() {
    for turn in [UnitQuaternion::identity(), UnitQuaternion::from_axis_angle(&Vector3::y_axis(), std::f64::consts::PI)]
    {
        let one_behind_the_other = Transform::new(turn, Vector3::new(0.0, 0.0, 145.0));
        let frame = SharedFrame::new(&one_behind_the_other).unwrap();
        let forward = frame.shared_from_left() * UnitRay::<Left>::new(Vector3::z()).unwrap();
        assert!((forward.vector() - Vector3::x()).norm() < 1e-12);
    }
}

#[test]
fn without_a_baseline_there_are_no_shared_axes() {
    let turn = UnitQuaternion::identity();
    for place in [Vector3::zeros(), Vector3::new(f64::NAN, 0.0, 0.0), Vector3::new(f64::INFINITY, 0.0, 0.0)] {
        assert_eq!(SharedFrame::new(&Transform::new(turn, place)), None);
    }
}

#[test]
fn a_view_of_a_uniform_image_is_uniform_where_the_camera_sees() {
    let left_from_right = Transform::new(UnitQuaternion::identity(), Vector3::new(145.0, 0.0, 0.0));
    let frame = SharedFrame::new(&left_from_right).unwrap();
    let grid = Grid::covering(&frame, &lens(), &lens(), 1.0).unwrap();
    let image = GrayImage::from_pixel(320, 320, image::Luma([77]));
    let view: View<Left> = View::new(&image, &lens(), frame.shared_from_left(), grid);
    let (width, height) = grid.size();
    assert_eq!(view.brightness().len(), width * height);
    let mut seen = 0;
    for (i, value) in view.brightness().iter().enumerate() {
        let sees = view.sees(ViewPixel { x: (i % width) as f64, y: (i / width) as f64 });
        assert!((value - if sees { 77.0 } else { 0.0 }).abs() < 1e-3);
        seen += usize::from(sees);
    }
    assert!(seen * 10 > width * height * 8, "parallel cameras share most of the view: {seen}");
}

#[test]
fn an_image_smaller_than_its_camera_shows_nothing_beyond_its_border() {
    const WIDTH: u32 = 250;
    let left_from_right = Transform::new(UnitQuaternion::identity(), Vector3::new(145.0, 0.0, 0.0));
    let frame = SharedFrame::new(&left_from_right).unwrap();
    let grid = Grid::covering(&frame, &lens(), &lens(), 1.0).unwrap();
    let image = GrayImage::from_pixel(WIDTH, 320, image::Luma([77]));
    let view: View<Left> = View::new(&image, &lens(), frame.shared_from_left(), grid);
    let (width, height) = grid.size();
    let places = (0..width * height).map(|i| ViewPixel { x: (i % width) as f64, y: (i / width) as f64 });
    let (mut seen, mut beyond) = (0, 0);
    for at in places {
        let Ok(original) = view.original(at) else { continue };
        let shown = original.u < f64::from(WIDTH - 2);
        seen += usize::from(view.sees(at));
        beyond += usize::from(!shown);
        assert!(shown || !view.sees(at), "{original:?}");
    }
    assert!(seen > 1000 && beyond > 1000, "{seen} {beyond}");
}
