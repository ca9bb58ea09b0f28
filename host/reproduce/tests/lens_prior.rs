//! What lenses have before any view: the prior of decentring and thin prism is as wide as badly mounted lenses make them.

#![allow(clippy::expect_used, clippy::print_stdout, reason = "a test fails loudly and shows its figures")]

use nalgebra::{Isometry3, Point3, Translation3, UnitQuaternion, Vector3};
use rayon::prelude::*;
use vergence_calibration::{IntrinsicsOptions, LensModel, calibrate_intrinsics};
use vergence_lens::{BuiltIn, Displacement, ImageScale, LensTable, Sensor, TracedLens};
use vergence_sim::Random;
use vergence_targets::{Corner, TargetView};
use vergence_vision::{Angle, ImageSize, Length, Pixel, Point};

const SIZE: ImageSize = ImageSize { width: 2048, height: 2048 };

/// 60 views of 9 x 6 corners without noise, 200 to 400 mm away, up to 85 degrees from the axis.
fn views(lens: &TracedLens, seed: u64) -> Vec<TargetView> {
    let mut random = Random::new(seed);
    let mut view = |index: usize| {
        let (theta, phi) = (1.48 * random.between(0.0, 1.0).sqrt(), random.between(-3.2, 3.2));
        let towards = Vector3::new(theta.sin() * phi.cos(), theta.sin() * phi.sin(), theta.cos());
        let mut angle = |most: f64| random.between(-most, most);
        let tilt = UnitQuaternion::from_euler_angles(angle(0.5), angle(0.5), angle(3.0));
        let facing = UnitQuaternion::rotation_between(&Vector3::z(), &towards).unwrap_or_default() * tilt;
        let pose = Isometry3::from_parts(Translation3::from(towards * random.between(200.0, 400.0)), facing);
        let corner = |i: u32| {
            let target_mm = [25.0 * f64::from(i % 9) - 100.0, 25.0 * f64::from(i / 9) - 62.5];
            let at = pose * Point3::new(target_mm[0], target_mm[1], 0.0);
            lens.project(&Point::from_mm(at.coords)).map(|pixel| Corner::new(target_mm, pixel))
        };
        TargetView { name: format!("view {index}"), corners: (0..54).filter_map(corner).collect() }
    };
    (0..60).map(&mut view).collect()
}

/// Root mean square of p, of s0 and s2, and of s1 and s3, of lenses with every element 10 µm off the axis and tilted by 0.05°, the sensor by 0.4°.
fn spread(design: BuiltIn, seeds: u64) -> [f64; 3] {
    let sensor = Sensor { size: SIZE, centre: Pixel { u: 1023.5, v: 1023.5 }, pixel: Length::from_mm(0.0024) };
    let table = LensTable::built_in(design).expect("a lens");
    let straight = TracedLens::new(table, ImageScale::OnAxis(599.0), sensor, Angle::from_deg(97.0));
    let asymmetry = |seed: u64| {
        let by = Displacement {
            decentre: Length::from_mm(0.01),
            tilt: Angle::from_deg(0.05),
            sensor_tilt: Angle::from_deg(0.4),
            seed,
        };
        let lens = straight.clone().displaced(&by).expect("light in the whole field");
        let options = IntrinsicsOptions { model: LensModel::Full, ..IntrinsicsOptions::default() };
        let found = calibrate_intrinsics(&views(&lens, seed), SIZE, &options).expect("a calibration");
        found.camera.asymmetry()
    };
    let found: Vec<_> = (0..seeds).into_par_iter().map(asymmetry).collect();
    let rms = |pair: &dyn Fn(&vergence_vision::Asymmetry) -> [f64; 2]| {
        let squares: f64 = found.iter().map(|lens| pair(lens).iter().map(|x| x * x).sum::<f64>()).sum();
        (squares / (2.0 * seeds as f64)).sqrt()
    };
    [rms(&|a| a.tangential), rms(&|a| [a.prism[0], a.prism[2]]), rms(&|a| [a.prism[1], a.prism[3]])]
}

/// A prior that is too narrow would make files certain of what they do not know, one that is far too wide would tell few views nothing.
#[test]
fn the_prior_of_an_asymmetry_is_that_of_badly_mounted_lenses() {
    let seeds = std::env::var("VERGENCE_SEEDS").ok().and_then(|text| text.parse().ok()).unwrap_or(12);
    let prior = [7e-4, 1.4e-3, 7e-4];
    for design in BuiltIn::ALL {
        let found = spread(design, seeds);
        println!(
            "{}, {seeds} lenses: p {:.1e}, s0 and s2 {:.1e}, s1 and s3 {:.1e}",
            design.name(),
            found[0],
            found[1],
            found[2]
        );
        for (found, prior) in found.iter().zip(prior) {
            assert!(*found < 1.3 * prior, "{}: {found} is beyond the prior {prior}", design.name());
            // The Nikkor's elements are larger.
            assert!(design != BuiltIn::Sigma8 || *found > 0.6 * prior, "{found} of the prior {prior}");
        }
    }
}
