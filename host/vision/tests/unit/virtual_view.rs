//! Tests of `src/virtual_view.rs`, of what is private there.
#![allow(clippy::expect_used, reason = "a test may fail")]

use super::*;

fn view(face: Face) -> VirtualView {
    VirtualView::new(face.camera_from_view(), Angle::from_deg(90.0), 100).expect("a view")
}

#[test]
fn each_face_looks_where_its_name_says_and_stands_upright() {
    let axes = [(Face::Front, Vector3::z()), (Face::Left, -Vector3::x()), (Face::Right, Vector3::x())];
    for (face, axis) in axes.into_iter().chain([(Face::Up, -Vector3::y()), (Face::Down, Vector3::y())]) {
        let view = view(face);
        let ray = view.ray(view.centre()).expect("a ray").vector();
        assert!((ray - axis).norm() < 1e-12, "{face:?}: {ray:?}");
    }
    // What is below the horizon is in the lower half of the views around it.
    let low = Vector3::new(0.0, 300.0, 0.0);
    for (face, axis) in axes {
        let (pixel, depth) = view(face).project(&Point::from_mm(axis * 1000.0 + low)).expect("in front");
        assert!((pixel.v - 64.5).abs() < 1e-9 && (pixel.u - 49.5).abs() < 1e-9 && (depth - 1000.0).abs() < 1e-9);
    }
}

#[test]
fn pixels_and_rays_are_inverse_and_k_and_r_say_the_same() {
    for face in Face::ALL {
        let view = view(face);
        let at = Pixel { u: -0.5, v: 70.25 };
        let point = view.ray(at).expect("a ray").at(2000.0);
        let (pixel, _) = view.project(&point).expect("in front");
        assert!((pixel.u - at.u).hypot(pixel.v - at.v) < 1e-9);
        let [k, r] = [view.camera_matrix(), view.view_from_camera()].map(|rows| Matrix3::from_row_slice(&rows));
        let image = k * r * point.mm();
        assert!((image.x / image.z - at.u).hypot(image.y / image.z - at.v) < 1e-9);
    }
    // The edge of a view of 90° is 45° off its axis.
    let edge = view(Face::Front).ray(Pixel { u: -0.5, v: 49.5 }).expect("a ray");
    assert!((edge.angle_to_axis().deg() - 45.0).abs() < 1e-9);
}

#[test]
fn views_that_a_pinhole_cannot_have_are_refused() {
    for (field, pixels) in [(180.0, 100), (f64::NAN, 100), (90.0, 0)] {
        let made = VirtualView::new(Face::Front.camera_from_view(), Angle::from_deg(field), pixels);
        assert!(made.is_err_and(|error| error.to_string().contains("choose")));
    }
    assert_eq!("up".parse(), Ok(Face::Up));
    assert!("back".parse::<Face>().is_err_and(|error| error.to_string().contains("front, left")));
}
