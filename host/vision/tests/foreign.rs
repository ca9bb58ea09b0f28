//! The laws of the camera models of other programs, and their golden numbers.
#![allow(
    clippy::expect_used,
    clippy::panic,
    clippy::print_stdout,
    reason = "a test fails loudly and shows its figures"
)]

mod foreign_models;

use foreign_models::*;
use nalgebra::Vector3;
use vergence_vision::{
    CameraModel, Central, DoubleSphere, Eucm, Fisheye624, ImageSize, InvalidLens, Mei, OCam, Pinhole, Pixel, Pupil,
    Radtan, SightRegion, SplineGrid, SplinedStereographic, fit_lens,
};

#[test]
fn pixels_of_rays_lead_back_to_the_rays_in_the_whole_cone() {
    for (name, model) in models() {
        let field = model.half_field().rad();
        let (mut behind, mut seen, mut worst) = (0, 0, 0.0_f64);
        for step in 0..200 {
            // Angles up to the end of the cone, which the last one reaches.
            let (theta, phi) = (field * (1.0 - 1e-9) * f64::from(step) / 199.0, 2.4 * f64::from(step));
            let sent = at(theta, phi);
            // A splined model says nothing beyond its grid.
            let Ok(pixel) = model.project(&sent) else { continue };
            let back = model.unproject(pixel).unwrap_or_else(|_| panic!("{name}: no ray back at {theta}, {phi}"));
            let off = (back.ray.vector() - sent.vector()).norm();
            worst = worst.max(off);
            seen += 1;
            behind += u32::from(theta > 1.6);
        }
        println!(
            "{name}: {:.1} from the axis, {seen} rays, {behind} from behind, off by {worst:.1e} rad",
            model.half_field()
        );
        assert!(worst < 1e-8, "{name}: {worst}");
        let sees_behind = field > 1.7;
        assert!(seen > 130 && (behind > 0) == sees_behind, "{name}: {seen} rays, {behind} from behind");
    }
}

#[test]
fn what_is_outside_has_no_pixel_and_no_ray() {
    for (name, model) in models() {
        let field = model.half_field().rad();
        for phi in [0.0, 1.0, 2.5, 4.0, 5.5] {
            for beyond in [field + 1e-6, 0.5 * (field + std::f64::consts::PI), 3.13] {
                assert!(model.project(&at(beyond, phi)).is_err(), "{name}: {beyond} of {field}");
            }
        }
        for pixel in [[f64::NAN, 0.0], [f64::INFINITY, 3.0], [1e15, -1e15]] {
            assert!(model.unproject(Pixel { u: pixel[0], v: pixel[1] }).is_err(), "{name}: {pixel:?}");
        }
        assert!(model.pixel_by_ray(&at(field + 1e-6, 0.3)).is_err(), "{name}");
    }
}

#[test]
fn derivatives_are_those_of_finite_turns() {
    for (name, model) in models() {
        for (share, phi) in [(0.0, 0.0), (0.3, 0.4), (0.6, 2.0), (0.8, 4.0)] {
            let sent = at(share * model.half_field().rad(), phi);
            let derivative = model.pixel_by_ray(&sent).unwrap_or_else(|_| panic!("{name}: inside the cone"));
            let turn = Vector3::new(0.3, -0.5, 0.2).cross(&sent.vector()) * 1e-5;
            let [ahead, behind] = [1.0, -1.0].map(|sign| {
                let turned = ray((sent.vector() + turn * sign).into());
                let pixel = model.project(&turned).unwrap_or_else(|_| panic!("{name}: near"));
                nalgebra::Vector2::new(pixel.u, pixel.v)
            });
            let (expected, got) = ((ahead - behind) / 2.0, derivative * turn);
            let off = (got - expected).norm();
            assert!(off < 1e-4 * expected.norm(), "{name} at {share}: {got} instead of {expected}");
        }
    }
}

#[test]
fn a_point_is_seen_in_its_direction_unless_the_pupil_moves() {
    for (name, model) in models() {
        let direction = at(0.7 * model.half_field().rad(), 0.9);
        let [far, near] = [1e7, 100.0].map(|mm| model.project_point(&direction.at(mm)).expect("inside"));
        let along = model.project(&direction).expect("inside");
        let apart = |a: Pixel, b: Pixel| (a.u - b.u).hypot(a.v - b.v);
        assert!(apart(far, along) < 1e-3, "{name}");
        assert_eq!(apart(near, along) > 1.0, name.contains("pupil"), "{name}: {near:?} {along:?}");
        let origin = model.unproject(along).expect("inside").origin.mm();
        assert_eq!(origin.norm() > 0.0, name.contains("pupil"), "{name}: {origin}");
    }
}

#[test]
fn parameters_have_names_of_their_own() {
    for (name, model) in models() {
        let parameters = model.parameters();
        let mut names: Vec<_> = parameters.iter().map(|parameter| &parameter.name).collect();
        names.sort_unstable();
        names.dedup();
        assert_eq!(names.len(), parameters.len(), "{name}");
        assert!(parameters.len() >= 8 || name != "Kannala-Brandt", "{name}: {parameters:?}");
    }
}

#[test]
fn parameters_of_no_camera_are_refused() {
    let refused = |result: Result<(), InvalidLens>, expected: &str| {
        let said = result.expect_err(expected).to_string();
        assert!(said.contains(expected), "'{said}' should say '{expected}'");
    };
    let ds = |pinhole, xi, alpha| Central::new(DoubleSphere { pinhole, xi, alpha }).map(drop);
    let eucm = |alpha, beta| Central::new(Eucm { pinhole: PINHOLE, alpha, beta }).map(drop);
    refused(ds([-600.0, 600.0, 0.0, 0.0], 0.0, 0.5), "focal lengths");
    refused(ds([f64::NAN, 600.0, 0.0, 0.0], 0.0, 0.5), "finite");
    refused(ds(PINHOLE, -1.2, 0.5), "xi is -1.2, it must lie between -1 and 1");
    refused(ds(PINHOLE, 0.0, 1.5), "alpha is 1.5");
    refused(eucm(-0.1, 1.0), "alpha");
    refused(eucm(0.5, 0.0), "beta");
    refused(Central::new(mei(-0.1)).map(drop), "xi");
    refused(Central::new(Fisheye624 { tangential: [f64::INFINITY, 0.0], ..fisheye624() }).map(drop), "finite");
    refused(OCam::new(&[320.0, 0.0, 8e-4], [0.0; 2], [1.0, 0.0, 0.0]).map(drop), "focal");
    refused(OCam::new(&[-320.0, 0.0, 8e-4], [0.0; 2], [-1.0, 0.0, 0.0]).map(drop), "c - d e");
    let grid = |order, columns, field_deg| SplineGrid { order, columns, rows: 11, field_deg };
    let spline = |grid| Central::new(SplinedStereographic { grid, ..splined(3) }).map(drop);
    refused(spline(grid(4, 14, 200.0)), "order");
    refused(spline(grid(3, 3, 200.0)), "Nx");
    refused(spline(grid(3, 14, 400.0)), "fov_x_deg");
    refused(spline(grid(3, 13, 200.0)), "control points");
    assert!(Radtan::new(&[0.1, 0.2, 0.3]).is_none() && Radtan::new(&[0.0; 15]).is_none());
    // A radial part that shrinks from the axis on: no pixel beside the axis has one ray.
    let folded = Fisheye624 { radial: [-1e9, 0.0, 0.0, 0.0, 0.0, 0.0], ..fisheye624() };
    refused(Central::new(folded).map(drop), "folds over");
}

/// Numbers of `shared/design/lens-models.md` §7, computed there from the published formulas.
#[test]
fn golden_pixels() {
    let rays = [[0.3, -0.2, 0.9], [-0.7, 0.4, -0.1]];
    let cases = [
        (
            central(DoubleSphere { pinhole: PINHOLE, xi: -0.2, alpha: 0.6 }),
            [[1_261.426_159_289, 863.452_086_964], [-16.288_498_838, 1_617.441_321_716]],
        ),
        (
            central(Eucm { pinhole: PINHOLE, alpha: 0.65, beta: 1.1 }),
            [[1_213.565_239_668, 895.412_545_510], [213.900_851_740, 1_485.685_322_004]],
        ),
        (central(mei(1.5)), [[1_214.841_775_702, 894.710_800_675], [105.530_642_710, 1_547.746_470_314]]),
        (central(fisheye624()), [[1_213.947_358_211, 895.420_190_998], [184.906_396_393, 1_502.216_843_003]]),
    ];
    for (model, pixels) in cases {
        for (direction, [u, v]) in rays.into_iter().zip(pixels) {
            let pixel = model.project(&ray(direction)).expect("inside the cone");
            assert!((pixel.u - u).hypot(pixel.v - v) < 1e-8, "{}: {pixel:?}, not {u} {v}", model.name());
        }
    }
}

/// The cones of the unified models in closed form, against their papers' conditions.
#[test]
fn cones_end_where_the_models_end() {
    let field = |model: Box<dyn CameraModel>| model.half_field().deg() / 0.99;
    assert!((field(central(Eucm { pinhole: PINHOLE, alpha: 0.5, beta: 1.0 })) - 180.0).abs() < 0.3);
    assert!((field(central(Eucm { pinhole: PINHOLE, alpha: 0.0, beta: 1.0 })) - 90.0).abs() < 0.3);
    // Mei with ξ = 2: s_z > -1/2.
    let plain = Mei { distortion: radtan(&[]), ..mei(2.0) };
    assert!((field(central(plain)) - 120.0).abs() < 0.3);
    // α = 0.6, ξ = 0: the unified model, z > -(1 - α)/α d.
    let expected = (-(0.4_f64 / 0.6)).acos().to_degrees();
    assert!((field(central(DoubleSphere { pinhole: PINHOLE, xi: 0.0, alpha: 0.6 })) - expected).abs() < 0.3);
    // A radial polynomial 1 - 0.28 r² turns over at r² = 1 / (3 · 0.28).
    let turning = Pinhole { pinhole: PINHOLE, distortion: radtan(&[-0.28, 0.0, 0.0, 0.0]) };
    let expected = (1.0_f64 / 0.84).sqrt().atan().to_degrees();
    assert!((field(central(turning)) - expected).abs() < 0.3);
}

#[test]
fn a_lens_is_fitted_and_says_how_far_it_is_off() {
    // Sizes and limits of how well a lens with five radial coefficients comes near each model over a sensor that it fills.
    let limits =
        [("FISHEYE624", 9.0), ("double sphere", 1.0), ("EUCM", 1.0), ("UCM", 1.0), ("Mei", 12.0), ("OCam", 1.5)];
    for (name, model) in models() {
        let Some((_, limit)) = limits.iter().find(|(limited, _)| *limited == name) else { continue };
        let size = if name == "OCam" { ImageSize { width: 1040, height: 1024 } } else { SIZE };
        let region = SightRegion { size, outline: &[] };
        let fit = fit_lens(model.as_ref(), region).unwrap_or_else(|error| panic!("{name}: {error}"));
        println!("{name}: {:.3} px rms, {:.3} px at {:.1}", fit.rms_px, fit.largest_px, fit.largest_at);
        assert!(fit.rms_px > 0.0 && fit.rms_px <= fit.largest_px && fit.largest_px < *limit, "{name}: {fit:?}");
        // What is stated is what is so, elsewhere too.
        for (theta, phi) in [(0.2, 0.1), (0.5, 3.3), (0.9, 5.0)] {
            let sent = at(theta, phi);
            let (ours, theirs) = (fit.lens.project(&sent).expect("inside"), model.project(&sent).expect("inside"));
            let off = (ours.u - theirs.u).hypot(ours.v - theirs.v);
            assert!(off < 1.1 * fit.largest_px, "{name} at {theta}: {off} px");
        }
    }
}

#[test]
fn a_lens_of_our_own_stays_what_it_is() {
    let lens = kannala_brandt().with_pupil(Pupil::from_mm([2.0, 0.1])).expect("a lens");
    let fit = fit_lens(&lens, SightRegion { size: SIZE, outline: &[] }).expect("a fit");
    assert_eq!((fit.lens, fit.rms_px, fit.largest_px), (lens, 0.0, 0.0));
}

#[test]
fn tangential_and_prism_terms_are_fitted_where_there_are_some() {
    let region = SightRegion { size: SIZE, outline: &[] };
    let distortion = radtan(&[-0.05, 0.01, 2e-3, -1e-3]);
    let cases = [
        ("FISHEYE624", central(fisheye624()), 0.3),
        ("Mei", central(Mei { pinhole: [1500.0, 1501.0, 1024.0, 1022.0], skew: 0.0, xi: 1.5, distortion }), 1.0),
        ("radtan", central(Pinhole { pinhole: [900.0, 900.0, 1020.0, 1025.0], distortion }), 0.3),
    ];
    for (name, model, limit) in cases {
        let fit = fit_lens(model.as_ref(), region).expect("a fit");
        println!("{name}: {:.4} px rms, {:.3} px at {:.1}", fit.rms_px, fit.largest_px, fit.largest_at);
        assert!(!fit.lens.is_symmetric() && fit.rms_px < limit, "{name}: {fit:?}");
    }
    let symmetric = central(DoubleSphere { pinhole: PINHOLE, xi: -0.2, alpha: 0.6 });
    assert!(fit_lens(symmetric.as_ref(), region).expect("a fit").lens.is_symmetric());
}

#[test]
fn a_fit_keeps_to_the_measured_part_of_the_image() {
    // Outside of the outline, a wild spline; inside, a lens.
    let grid = SplineGrid { order: 3, columns: 20, rows: 20, field_deg: 190.0 };
    let wild =
        |index: usize| if (6..14).contains(&(index / 20)) && (6..14).contains(&(index % 20)) { 0.0 } else { 0.1 };
    let control = (0..400).map(|index| [wild(index) * (index as f64).sin(), 0.0]).collect();
    let model = Central::new(SplinedStereographic { pinhole: PINHOLE, grid, control }).expect("a camera");
    let corner = |u: f64, v: f64| Pixel { u: 1024.0 + u, v: 1022.0 + v };
    let outline = [corner(-200.0, -200.0), corner(200.0, -200.0), corner(200.0, 200.0), corner(-200.0, 200.0)];
    let whole = fit_lens(&model, SightRegion { size: SIZE, outline: &[] }).expect("a fit");
    let part = fit_lens(&model, SightRegion { size: SIZE, outline: &outline }).expect("a fit");
    assert!(whole.largest_px > 10.0 && part.largest_px < 0.1, "{} px, {} px", whole.largest_px, part.largest_px);
    // A camera of 50° whose principal point is far outside of the image.
    let narrow = Pinhole { pinhole: [600.0, 600.0, 9e3, 9e3], distortion: radtan(&[-0.28, 0.0, 0.0, 0.0]) };
    let narrow = Central::new(narrow).expect("a camera");
    assert!(fit_lens(&narrow, SightRegion { size: SIZE, outline: &[] }).is_err(), "a wrong size is told");
}
