//! Camera files of our own: every parameter of a lens survives, older files are read, and a covariance that is none is refused.
#![allow(clippy::expect_used, reason = "a test fails loudly")]

use nalgebra::{SMatrix, Vector3};
use vergence_rig::{BENCH_TOML, CalibrationTable, CameraDocument, CameraTable, Rig};
use vergence_vision::{
    Angle, Asymmetry, Camera, CameraModel, Central, DoubleSphere, Fisheye624, ImageSize, KannalaBrandt,
    LENS_PARAMETER_NAMES, LENS_PARAMETERS, OpenCvFisheye, Pupil, SplineGrid, SplinedStereographic, UnitRay,
};

type Covariance = SMatrix<f64, LENS_PARAMETERS, LENS_PARAMETERS>;

fn lens() -> KannalaBrandt {
    let k = [0.0265, -0.0294, 0.0269, -0.0096];
    let opencv = OpenCvFisheye { fx: 227.64, fy: 226.81, cx: 471.41, cy: 305.55, k };
    let size = ImageSize { width: 960, height: 600 };
    let central = KannalaBrandt::from_opencv(opencv, Angle::from_deg(85.0), size).expect("a lens");
    let moving = central.with_pupil(Pupil::from_mm([2.77, 0.3])).expect("a pupil");
    let asymmetry = Asymmetry { tangential: [4e-4, -3e-4], prism: [5e-4, -1e-4, -4e-4, 2e-4], growth: [1e-4, -5e-5] };
    let longer = moving.with_further_terms([1e-4 / 3.0, -2e-6]).expect("small coefficients");
    longer.with_asymmetry(asymmetry).expect("small coefficients")
}

/// A document whose covariance is known of the first `count` parameters.
fn document(count: usize) -> CameraDocument {
    let covariance =
        Covariance::from_fn(|i, k| if i.max(k) < count { f64::from(u8::from(i == k)) + 1e-3 } else { 0.0 });
    let calibration = CalibrationTable { rms_inlier_px: 0.1, corners: 1000, views: 20, covariance };
    CameraDocument { camera: CameraTable::of(&lens()), calibration: Some(calibration), provenance: None }
}

#[test]
fn every_parameter_survives_with_its_covariance() {
    for count in [8, 9, 10, 16, LENS_PARAMETERS] {
        let text = toml::to_string(&document(count)).expect("TOML");
        let read: CameraDocument = toml::from_str(&text).expect("what we wrote");
        assert_eq!(read, document(count));
        assert_eq!(read.camera.camera(), Ok(lens()));
        for name in LENS_PARAMETER_NAMES {
            assert!(text.contains(&format!("\n{name} = ")), "{name} is missing in {text}");
        }
    }
}

/// As they were before lenses had more than e0.
#[test]
fn files_without_the_new_keys_are_read() {
    let shorter = lens().with_further_terms([0.0; 2]).expect("no coefficients");
    let symmetric = shorter.with_asymmetry(Asymmetry::default()).expect("no coefficients");
    let camera = CameraTable::of(&symmetric.with_pupil(Pupil::default()).expect("no pupil"));
    let text = toml::to_string(&camera).expect("TOML");
    assert!(
        !text.contains("pupil") && !text.contains("tangential") && !text.contains("prism") && !text.contains("radial"),
        "{text}"
    );
    let read: CameraTable = toml::from_str(&(text + "pupil_e0_mm = 2.77\n")).expect("an older file");
    assert_eq!(read.camera().expect("a lens").pupil(), Pupil::from_mm([2.77, 0.0]));
    assert!(read.camera().expect("a lens").is_symmetric());
}

/// Double sphere, FISHEYE624 and a spline: numbers that no decimal fraction is, and a table of hundreds.
#[test]
fn a_camera_of_another_model_is_read_as_it_was_written() {
    let pinhole = [227.64, 226.81, 471.41, 305.55].map(|value: f64| value * (1.0 + 1e-15));
    let grid = SplineGrid { order: 3, columns: 12, rows: 9, field_deg: 170.0 };
    let control = (0..108).map(|index| [0.01 * f64::from(index).sin(), 0.01 * f64::from(index).cos()]).collect();
    let fisheye = Fisheye624 { pinhole, radial: [0.1 / 3.0; 6], tangential: [1e-3 / 3.0; 2], prism: [1e-4 / 3.0; 4] };
    let models: [Box<dyn CameraModel>; 3] = [
        Box::new(Central::new(DoubleSphere { pinhole, xi: -0.2 / 3.0, alpha: 1.7 / 3.0 }).expect("a camera")),
        Box::new(Central::new(fisheye).expect("a camera")),
        Box::new(Central::new(SplinedStereographic { pinhole, grid, control }).expect("a camera")),
    ];
    for model in models {
        let name = model.name();
        let lens = lens().with_pupil(Pupil::default()).expect("no pupil").computed_by(model, 1.0);
        let text = toml::to_string(&CameraTable::of(&lens)).expect("TOML");
        assert!(text.contains(&format!("[model]\nname = \"{name}\"\n\n[model.values]\n")), "{text}");
        let read = toml::from_str::<CameraTable>(&text).expect("what we wrote");
        let back = read.camera().expect("a lens");
        assert_eq!((back.foreign_model(), &read), (lens.foreign_model(), &CameraTable::of(&lens)), "{name}");
        for step in 0..100 {
            let (theta, phi) = (0.8 * f64::from(step) / 100.0, 2.4 * f64::from(step));
            let ray = Vector3::new(theta.sin() * phi.cos(), theta.sin() * phi.sin(), theta.cos());
            let ray = UnitRay::<Camera>::new(ray).expect("a direction");
            assert_eq!(back.project(&ray), lens.project(&ray), "{name}");
        }
        let refused = |text: String, words: &str| {
            let error = toml::from_str::<CameraTable>(&text).expect("TOML").camera().expect_err(words).to_string();
            assert!(error.contains(words), "{error}");
        };
        let (camera, values) = text.split_once("[model.values]").expect("values");
        refused(
            camera.to_owned() + "[model.values]" + &values.replace("\ncx = ", "\ncxx = "),
            &format!("'{name}' are not its parameters"),
        );
        refused(text.replace(name, "triple sphere"), "double sphere, enhanced unified");
        refused(text.replace("[model.values]", "scale = 0.0\n[model.values]"), "scale is 0");
    }
}

#[test]
fn a_covariance_that_is_none_is_refused() {
    let whole = toml::to_string(&document(LENS_PARAMETERS)).expect("TOML");
    let refused = |text: &str, word: &str| {
        let error = toml::from_str::<CameraDocument>(text).expect_err("no covariance").to_string();
        assert!(error.contains(word), "{error}");
    };
    refused(&whole.replacen("1.001", "-1.001", 1), "negative variance");
    refused(&whole.replacen("1.001", "nan", 1), "no number");
    let seven = format!("covariance = [{}]", vec![format!("[{}]", ["0.0"; 7].join(", ")); 7].join(", "));
    let head = whole.split("covariance").next().expect("a head");
    refused(&format!("{head}{seven}\n"), "8 rows of 8 values");
}

#[test]
fn coefficients_that_fold_the_image_are_refused() {
    let table = CameraTable { tangential_p1: 0.9, ..CameraTable::of(&lens()) };
    assert!(table.camera().expect_err("two rays for a pixel").to_string().contains("fold"));
}

/// The rig file holds the same table.
#[test]
fn a_rig_keeps_its_lenses() {
    let bench = Rig::from_toml(BENCH_TOML).expect("the bench");
    let moved = |drawn: KannalaBrandt| {
        let moving = drawn.with_pupil(Pupil::from_mm([2.77, 0.3])).expect("a pupil");
        let longer = moving.with_further_terms([-1e-6, 1e-7]).expect("small coefficients");
        longer.with_asymmetry(lens().asymmetry()).expect("small coefficients")
    };
    let rig = Rig { left_camera: moved(bench.left_camera), right_camera: moved(bench.right_camera), ..bench };
    let provenance = vergence_rig::Provenance { program: "a test".into(), inputs_sha256: "00".into(), date: None };
    let read = Rig::from_toml(&rig.to_toml(&provenance).expect("TOML")).expect("what we wrote");
    for (read, written) in [(read.left_camera, rig.left_camera), (read.right_camera, rig.right_camera)] {
        let of = |lens: KannalaBrandt| (lens.pupil(), lens.asymmetry(), lens.further_terms());
        assert!(of(read) == of(written) && read.has_further_terms());
    }
}
