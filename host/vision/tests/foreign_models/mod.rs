//! Examples of the camera models of other programs.
#![allow(dead_code, reason = "each test file uses its share")]

use nalgebra::Vector3;
use vergence_vision::{
    Angle, Camera, CameraModel, Central, DoubleSphere, Eucm, Fisheye624, Formula, ImageSize, KannalaBrandt, Mei, OCam,
    Pinhole, Pixel, Pupil, Radtan, SplineGrid, SplinedStereographic, UnitRay,
};

pub const PINHOLE: [f64; 4] = [600.0, 601.0, 1024.0, 1022.0];
pub const SIZE: ImageSize = ImageSize { width: 2048, height: 2044 };

pub fn radtan(coefficients: &[f64]) -> Radtan {
    Radtan::new(coefficients).expect("a number of coefficients that OpenCV knows")
}

pub fn central(formula: impl Formula + 'static) -> Box<dyn CameraModel> {
    Box::new(Central::new(formula).expect("a camera"))
}

pub fn kannala_brandt() -> KannalaBrandt {
    let k = [599.1, -31.1532, 2.45631, -1.13829, 0.11982];
    let centre = Pixel { u: 1024.0, v: 1024.0 };
    KannalaBrandt::new(k, 1.01, centre, Angle::from_deg(98.0), SIZE).expect("a lens")
}

pub fn fisheye624() -> Fisheye624 {
    Fisheye624 {
        pinhole: [600.0, 600.0, 1024.0, 1022.0],
        radial: [-0.02, 0.003, -0.001, 0.0002, -1e-5, 1e-6],
        tangential: [1e-3, -5e-4],
        prism: [2e-4, -1e-4, 3e-4, 5e-5],
    }
}

pub fn mei(xi: f64) -> Mei {
    let distortion = radtan(&[-0.05, 0.01, 1e-3, -5e-4]);
    Mei { pinhole: [1500.0, 1501.0, 1024.0, 1022.0], skew: 0.0, xi, distortion }
}

/// The polynomial of the data set that comes with OCamCalib has such numbers, scaled.
pub fn ocam() -> OCam {
    OCam::new(&[-320.0, 0.0, 8.2e-4, -6e-8, 5e-10], [511.0, 519.5], [0.9998, 3e-4, -2e-4]).expect("a camera")
}

pub fn splined(order: usize) -> SplinedStereographic {
    let grid = SplineGrid { order, columns: 14, rows: 11, field_deg: 200.0 };
    let wave = |index: usize| 0.02 * (0.7 * index as f64).sin();
    let control = (0..14 * 11).map(|index| [wave(index), wave(2 * index + 1)]).collect();
    SplinedStereographic { pinhole: PINHOLE, grid, control }
}

/// An example of every model, by name.
pub fn models() -> Vec<(&'static str, Box<dyn CameraModel>)> {
    let ds = |xi, alpha| central(DoubleSphere { pinhole: PINHOLE, xi, alpha });
    let eucm = |alpha, beta| central(Eucm { pinhole: PINHOLE, alpha, beta });
    let pinhole = |coefficients: &[f64]| central(Pinhole { pinhole: PINHOLE, distortion: radtan(coefficients) });
    let rational = [0.2, -0.1, 1e-3, -5e-4, 0.02, 0.5, 0.1, 0.01];
    let tilted = [&rational[..], &[1e-3, -1e-3, 5e-4, 2e-4, 0.02, -0.01]].concat();
    vec![
        ("Kannala-Brandt", Box::new(kannala_brandt()) as Box<dyn CameraModel>),
        (
            "Kannala-Brandt with a pupil",
            Box::new(kannala_brandt().with_pupil(Pupil::from_mm([2.77, 0.0])).expect("a lens")),
        ),
        ("double sphere", ds(-0.2, 0.6)),
        ("double sphere, near a pinhole", ds(0.1, 0.2)),
        ("EUCM", eucm(0.65, 1.1)),
        ("UCM", eucm(0.55, 1.0)),
        ("EUCM, a pinhole", eucm(0.0, 1.0)),
        ("Mei", central(mei(1.5))),
        ("Mei, nearer than the sphere", central(mei(0.8))),
        ("FISHEYE624", central(fisheye624())),
        ("OCam", central(ocam())),
        ("pinhole", pinhole(&[])),
        ("radtan", pinhole(&[-0.28, 0.07, 2e-4, 2e-5])),
        ("rational", pinhole(&rational)),
        ("rational, thin prism, tilted", pinhole(&tilted)),
        ("splined, cubic", central(splined(3))),
        ("splined, quadratic", central(splined(2))),
    ]
}

pub fn ray(vector: [f64; 3]) -> UnitRay<Camera> {
    UnitRay::new(Vector3::from(vector)).expect("a direction")
}

pub fn at(theta: f64, phi: f64) -> UnitRay<Camera> {
    ray([theta.sin() * phi.cos(), theta.sin() * phi.sin(), theta.cos()])
}
