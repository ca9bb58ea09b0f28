//! Lenses that are computed by the camera models of other programs.
#![allow(
    clippy::expect_used,
    clippy::panic,
    clippy::print_stdout,
    reason = "a test fails loudly and shows its figures"
)]

mod foreign_models;

use std::collections::BTreeMap;
use std::sync::LazyLock;

use foreign_models::*;
use nalgebra::{UnitQuaternion, Vector2, Vector3};
use vergence_vision::{
    BatchLens, Camera, CameraModel, Gates, ImageSize, Instructions, InvalidLens, KannalaBrandt, Left, Pixel, PixelPair,
    Point, Right, SightRegion, StereoPair, Transform, cloud, fit_lens, model_of,
};

fn values(model: &dyn CameraModel) -> BTreeMap<String, f64> {
    model.parameters().into_iter().map(|parameter| (parameter.name, parameter.value)).collect()
}

fn remade(model: &dyn CameraModel) -> Box<dyn CameraModel> {
    model_of(model.name(), &values(model)).unwrap_or_else(|error| panic!("{}: {error}", model.name()))
}

/// A model that is no lens of this program.
struct Example {
    name: &'static str,
    model: Box<dyn CameraModel>,
    /// The lens computed by it.
    lens: KannalaBrandt,
    /// The polynomial that comes nearest.
    polynomial: KannalaBrandt,
}

static EXAMPLES: LazyLock<Vec<Example>> = LazyLock::new(|| {
    let example = |(name, model): (&'static str, Box<dyn CameraModel>)| {
        let size = if name == "OCam" { ImageSize { width: 1040, height: 1024 } } else { SIZE };
        let fit = fit_lens(model.as_ref(), SightRegion { size, outline: &[] });
        let polynomial = fit.unwrap_or_else(|error| panic!("{name}: {error}")).lens;
        Example { name, lens: polynomial.computed_by(remade(model.as_ref()), 1.0), model, polynomial }
    };
    models().into_iter().filter(|(_, model)| model.as_kannala_brandt().is_none()).map(example).collect()
});

fn apart(a: Pixel, b: Pixel) -> f64 {
    (a.u - b.u).hypot(a.v - b.v)
}

#[test]
fn every_model_is_made_again_of_its_name_and_parameters() {
    for Example { name, model, .. } in EXAMPLES.iter() {
        let again = remade(model.as_ref());
        assert_eq!(again.half_field(), model.half_field(), "{name}");
        for step in 0..50 {
            let sent = at(model.half_field().rad() * f64::from(step) / 50.0, 2.4 * f64::from(step));
            assert_eq!(again.project(&sent), model.project(&sent), "{name}");
        }
        let refused = |values: &BTreeMap<String, f64>| {
            model_of(model.name(), values).err() == Some(InvalidLens::ModelValues(model.name()))
        };
        let (all, mut more) = (values(model.as_ref()), values(model.as_ref()));
        more.insert("fz".to_owned(), 1.0);
        assert!(refused(&more) && refused(&BTreeMap::new()), "{name}");
        let (first, _) = all.first_key_value().expect("a parameter");
        let fewer = all.iter().filter(|(key, _)| *key != first).map(|(key, value)| (key.clone(), *value)).collect();
        assert!(model_of(model.name(), &fewer).is_err(), "{name} without {first}");
    }
    assert!(matches!(model_of("pinhole camera", &BTreeMap::new()), Err(InvalidLens::UnknownModel)));
}

#[test]
fn a_lens_of_another_model_is_that_model_and_no_polynomial() {
    for Example { name, model, lens, polynomial: nearest } in EXAMPLES.iter() {
        let field = lens.theta_max().rad().min(model.half_field().rad());
        let (mut seen, mut behind, mut worst, mut polynomial) = (0, 0, 0.0_f64, 0.0_f64);
        for step in 0..400 {
            let (theta, phi) = (field * (1.0 - 1e-9) * f64::from(step) / 399.0, 2.4 * f64::from(step));
            let sent = at(theta, phi);
            assert_eq!(lens.project(&sent), model.project(&sent), "{name} at {theta}");
            let Ok(pixel) = lens.project(&sent) else { continue };
            let Ok(back) = lens.unproject::<Camera>(pixel) else { panic!("{name}: no ray back at {theta}, {phi}") };
            worst = worst.max((back.vector() - sent.vector()).norm());
            polynomial = polynomial.max(nearest.project(&sent).map_or(0.0, |at| apart(at, pixel)));
            assert_eq!(lens.origin_of(&back).mm(), Vector3::zeros());
            seen += 1;
            behind += u32::from(sent.vector().z < 0.0);
        }
        println!(
            "{name}: {seen} rays, {behind} from behind, off by {worst:.1e} rad; its polynomial by {polynomial:.1e} px"
        );
        assert!(worst < 1e-9, "{name}: {worst}");
        assert!(seen > 300 && (behind > 0) == (field > 1.6), "{name}: {seen}, {behind}");
        // The case of a pinhole is nearly one of the polynomials too.
        assert!(polynomial > 1e-6, "{name}: {polynomial}");
        assert!(lens.project(&at(field + 1e-6, 0.3)).is_err() && !lens.fits_opencv(), "{name}");
    }
}

#[test]
fn derivatives_of_such_a_lens_are_those_of_its_pixels() {
    const STEP: f64 = 1e-5;
    for Example { name, lens, .. } in EXAMPLES.iter() {
        for share in [0.0, 0.1, 0.45, 0.8] {
            let sent = at(share * lens.theta_max().rad(), 0.8 + share);
            let (by_ray, by_pixel) = (lens.pixel_by_ray(&sent), lens.ray_by_pixel(&sent));
            let pixel = lens.project(&sent).expect("inside");
            for turn in [Vector3::x(), Vector3::y(), Vector3::z()].map(|axis| axis.cross(&sent.vector()) * STEP) {
                let [ahead, behind] = [1.0, -1.0].map(|sign| {
                    let at = lens.project(&ray((sent.vector() + turn * sign).into())).expect("near");
                    Vector2::new(at.u, at.v)
                });
                let expected = (ahead - behind) / 2.0;
                assert!((by_ray * turn - expected).norm() < 1e-5 * by_ray.norm() * STEP, "{name} at {share}");
            }
            for (du, dv) in [(0.01, 0.0), (0.0, 0.01)] {
                let [ahead, behind] = [1.0, -1.0].map(|sign| {
                    let moved = Pixel { u: pixel.u + sign * du, v: pixel.v + sign * dv };
                    lens.unproject::<Camera>(moved).expect("near").vector()
                });
                let off = (by_pixel * Vector2::new(du, dv) - (ahead - behind) / 2.0).norm();
                assert!(off < 1e-5 * 0.01 * by_pixel.norm(), "{name} at {share}: {off}");
            }
        }
    }
}

#[test]
fn batches_and_resampled_sensors_are_computed_by_the_model_too() {
    for Example { name, lens, .. } in EXAMPLES.iter() {
        let half = lens.resampled(lens.size().width / 2).expect("a sensor");
        let field = lens.theta_max().rad();
        let sent: Vec<_> = (0..100).map(|step| at(field * 1.05 * f64::from(step) / 100.0, f64::from(step))).collect();
        let points: Vec<[f64; 3]> = sent.iter().map(|ray| (ray.vector() * 300.0).into()).collect();
        let batch = BatchLens::new(lens);
        println!("{name}: {}", if batch.is_fitted() { "in lanes" } else { "one by one" });
        let (pixels, derived) = (batch.project(&points), batch.project_with_derivatives(&points));
        let rays = batch.unproject(&pixels);
        for (index, sent) in sent.iter().enumerate() {
            let Ok(pixel) = lens.project(sent) else {
                assert!(pixels[index][0].is_nan() && rays[index][0].is_nan(), "{name}, {index}");
                assert!(
                    derived.pixel(index).expect("a row").u.is_nan() && half.project(sent).is_err(),
                    "{name}, {index}"
                );
                continue;
            };
            let off = apart(Pixel { u: pixels[index][0], v: pixels[index][1] }, pixel);
            assert!(off < 1e-9 * lens.k()[0], "{name}, {index}: {off} px");
            assert!(apart(derived.pixel(index).expect("a row"), pixel) < 1e-9, "{name}, {index}");
            let off = derived.by_point(index).expect("a row") * 300.0 - lens.pixel_by_ray(sent);
            assert!(off.norm() < 1e-5 * lens.pixel_by_ray(sent).norm(), "{name}, {index}");
            let exact = lens.unproject::<Camera>(pixel);
            let off = exact.map_or(f64::NAN, |ray| (ray.vector() - Vector3::from(rays[index])).norm());
            // Where the image comes to a stand, a ray is known as badly as its pixel is rounded.
            assert!(off < 2e-9 || exact.is_err() && rays[index][0].is_nan(), "{name}, {index}: {off}");
            let small = half.project(sent).expect("the same field");
            let expected = Pixel { u: (pixel.u + 0.5) / 2.0 - 0.5, v: (pixel.v + 0.5) / 2.0 - 0.5 };
            assert!(apart(small, expected) < 1e-9, "{name}, {index}");
            let off = half.unproject::<Camera>(small).map(|back| (back.vector() - sent.vector()).norm());
            assert!(off.is_ok_and(|off| off < 1e-9), "{name}, {index}: {off:?} {exact:?} {}", sent.angle_to_axis());
        }
    }
}

/// What the polynomial would cost in millimetres: half a metre away, a pair of splined cameras.
#[test]
fn points_of_such_a_pair_are_where_they_are() {
    let Example { lens, polynomial, .. } =
        EXAMPLES.iter().find(|example| example.name == "splined, cubic").expect("an example");
    let left_from_right = Transform::<Left, Right>::new(
        UnitQuaternion::from_scaled_axis(Vector3::new(0.0, 0.4, 0.0)),
        Vector3::new(145.0, 0.0, 0.0),
    );
    let truth: Vec<Point<Left>> = (0..200)
        .map(|step| at(1.2 * f64::from(step) / 200.0, 2.4 * f64::from(step)).renamed::<Left>().at(500.0))
        .collect();
    let pixels = |point: &Point<Left>| {
        let right = lens.project_point(&(left_from_right.inverse() * *point)).ok()?;
        Some(PixelPair { left: lens.project_point(point).ok()?, right })
    };
    let seen: Vec<(Point<Left>, PixelPair)> = truth.iter().filter_map(|point| Some((*point, pixels(point)?))).collect();
    let matches: Vec<PixelPair> = seen.iter().map(|(_, pair)| *pair).collect();
    let worst = |lens: &KannalaBrandt| {
        let cloud = cloud(&matches, &StereoPair { left: lens, right: lens, left_from_right }, &Gates::default());
        let off = cloud.points.iter().map(|point| (point.point.mm() - seen[point.pair_index].0.mm()).norm());
        (cloud.points.len(), off.fold(0.0, f64::max))
    };
    let ((kept, off), (_, by_polynomial)) = (worst(lens), worst(polynomial));
    println!("{kept} points, off by {off:.1e} mm; by the polynomial {by_polynomial:.2} mm");
    assert!(kept > 150 && off < 1e-6, "{kept} points, {off} mm");
    assert!(by_polynomial > 0.1, "{by_polynomial} mm");
}

#[test]
fn arrays_of_every_model_are_computed_in_lanes_both_ways() {
    for Example { name, lens, .. } in EXAMPLES.iter() {
        let batch = BatchLens::new(lens);
        assert!(batch.projects_in_lanes() && batch.is_fitted(), "{name}");
    }
}

/// Pixels and rays of arrays are the model's, to a billionth of a radian.
#[test]
fn large_arrays_are_the_same_as_single_points() {
    const ROWS: u32 = 6000;
    for Example { name, lens, .. } in EXAMPLES.iter() {
        let half = lens.resampled(lens.size().width / 2).expect("a sensor");
        for (lens, instructions) in
            [(lens, Instructions::Best), (lens, Instructions::Baseline), (&half, Instructions::Best)]
        {
            let field = lens.theta_max().rad();
            let place = |row: u32| at(1.02 * field * (f64::from(row) / f64::from(ROWS)).sqrt(), 2.4 * f64::from(row));
            let sent: Vec<_> = (0..ROWS).map(place).chain([at(0.0, 0.0), at(1e-9, 1.0), at(field, 0.5)]).collect();
            let points: Vec<[f64; 3]> = sent.iter().map(|ray| (ray.vector() * 300.0).into()).collect();
            let batch = BatchLens::new(lens).with_instructions(instructions);
            let (pixels, mut worst) = (batch.project(&points), [0.0_f64; 2]);
            let rays = batch.unproject(&pixels);
            for ((sent, [u, v]), back) in sent.iter().zip(&pixels).zip(&rays) {
                let Ok(pixel) = lens.project(sent) else {
                    assert!(u.is_nan() && back[0].is_nan(), "{name}: {u} at {}", sent.angle_to_axis());
                    continue;
                };
                worst[0] = worst[0].max(apart(pixel, Pixel { u: *u, v: *v }) / lens.k()[0]);
                // Where the image comes to a stand, a ray is known as badly as its pixel is rounded.
                let single = lens.unproject::<Camera>(Pixel { u: *u, v: *v });
                worst[1] = worst[1].max(single.map_or(0.0, |ray| (ray.vector() - Vector3::from(*back)).norm()));
            }
            println!("{name}, {instructions:?}: off by {:.1e} and {:.1e} rad", worst[0], worst[1]);
            assert!(worst[0] < 1e-9 && worst[1] < 1e-9, "{name}, {instructions:?}: {worst:?} rad");
        }
    }
}
