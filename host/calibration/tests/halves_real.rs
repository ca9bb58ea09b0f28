//! The stated covariance of real lenses and pairs: random halves of the views of a set calibrate by themselves, and their difference
//! is compared with what both state. No truth is needed for that; what both halves have in common, such as an error of the model that
//! does not depend on the views, does not show. The data live outside the repository, see `tests/common/data.rs`.
#![allow(clippy::unwrap_used, clippy::print_stdout, reason = "a test may fail, and tells its figures")]

mod intrinsics_sets;
mod simulated;

use intrinsics_sets::{CornerSet, corner_sets, parameters};
use nalgebra::{DMatrix, DVector, Matrix2, Matrix3, Matrix3x2, Rotation3, Vector2, Vector3};
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64Mcg;
use rayon::prelude::*;
use simulated::band::nees_band;
use simulated::seeds;
use vergence_calibration::{
    ExtrinsicsCalibration, ExtrinsicsOptions, IntrinsicsCalibration, IntrinsicsOptions, LensKnowledge, RayUncertainty,
    StereoView, calibrate_extrinsics, calibrate_intrinsics,
};
use vergence_vision::{Camera, KannalaBrandt, LENS_PARAMETERS, UnitRay};

/// Both halves of `views` under the split `seed`.
fn halves<V: Clone>(views: &[V], seed: u64) -> [Vec<V>; 2] {
    let mut rng = Pcg64Mcg::seed_from_u64(seed);
    let mut views = views.to_vec();
    for index in (1..views.len()).rev() {
        views.swap(index, rng.random_range(0..=index));
    }
    let second = views.split_off(views.len() / 2);
    [views, second]
}

/// The square of `difference` in units of `covariance`, for each of its components.
fn chi_square(difference: &DVector<f64>, covariance: &DMatrix<f64>) -> f64 {
    let scale = DMatrix::from_diagonal(&covariance.diagonal().map(|variance| 1.0 / variance.sqrt()));
    let factor = (&scale * covariance * &scale).cholesky().unwrap();
    let scaled = &scale * difference;
    scaled.dot(&factor.solve(&scaled)) / difference.len() as f64
}

/// Mean χ² for each number, by noise alone and as stated.
#[derive(Clone, Copy, Default)]
struct Compared {
    noise: f64,
    stated: f64,
}

fn mean(of: &[Compared]) -> Compared {
    let count = of.len() as f64;
    let mean = |value: fn(&Compared) -> f64| of.iter().map(value).sum::<f64>() / count;
    Compared { noise: mean(|c| c.noise), stated: mean(|c| c.stated) }
}

fn of_lenses(a: &IntrinsicsCalibration, b: &IntrinsicsCalibration) -> Compared {
    let difference = DVector::from_row_slice(&parameters(&a.opencv)) - DVector::from_row_slice(&parameters(&b.opencv));
    let by = |covariance: nalgebra::SMatrix<f64, LENS_PARAMETERS, LENS_PARAMETERS>| {
        chi_square(&difference, &covariance.view((0, 0), (8, 8)).into_owned())
    };
    Compared { noise: by(a.noise_covariance + b.noise_covariance), stated: by(a.covariance + b.covariance) }
}

/// Of the rays over the field that both halves saw, the rotation common to all removed.
fn of_rays(a: &IntrinsicsCalibration, b: &IntrinsicsCalibration) -> Compared {
    const DIRECTIONS: u32 = 400;
    const GOLDEN: f64 = 2.399_963_229_728_653;
    let lowest = a.outermost.rad().min(b.outermost.rad()).cos();
    let by_noise = |found: &IntrinsicsCalibration| {
        RayUncertainty::of(&IntrinsicsCalibration { covariance: found.noise_covariance, ..found.clone() })
    };
    let [noise, stated] = [[by_noise(a), by_noise(b)], [RayUncertainty::of(a), RayUncertainty::of(b)]];
    let rays = (0..DIRECTIONS).filter_map(|index| {
        let z = 1.0 - (1.0 - lowest) * (f64::from(index) + 0.5) / f64::from(DIRECTIONS);
        let (sin, cos) = (GOLDEN * f64::from(index)).sin_cos();
        let across = (1.0 - z * z).sqrt();
        let ray = UnitRay::<Camera>::new(Vector3::new(across * cos, across * sin, z))?;
        let pixel = a.camera.project(&ray).ok().filter(|pixel| a.camera.on_sensor(*pixel))?;
        Some((pixel, ray.vector(), b.camera.unproject::<Camera>(pixel).ok()?.vector()))
    });
    let rays: Vec<_> = rays.collect();
    let correlation: Matrix3<f64> = rays.iter().map(|(_, a, b)| a * b.transpose()).sum();
    let turn = Rotation3::from_matrix_eps(&correlation, 1e-12, 100, Rotation3::identity());
    let compared: Vec<Compared> = rays
        .iter()
        .map(|(pixel, of_a, of_b)| {
            let square = |[a, b]: &[RayUncertainty; 2]| {
                let (a, b) = (a.at(*pixel).unwrap(), b.at(*pixel).unwrap());
                let off: Vector2<f64> = Matrix3x2::from_columns(&a.tangents).transpose() * (of_a - turn * of_b);
                let covariance: Matrix2<f64> = a.covariance + b.covariance;
                off.dot(&(covariance.try_inverse().unwrap() * off)) / 2.0
            };
            Compared { noise: square(&noise), stated: square(&stated) }
        })
        .collect();
    mean(&compared)
}

/// Lenses of each real set: eight parameters, and the rays over the field.
#[test]
fn halves_of_real_sets_differ_as_their_lenses_state() {
    let splits = seeds(20);
    let mut judged = Vec::new();
    for CornerSet { name, size, views } in corner_sets() {
        let of_split = |seed: u64| {
            let [a, b] = halves(&views, seed)
                .map(|half| calibrate_intrinsics(&half, size, &IntrinsicsOptions::central()).unwrap());
            (of_lenses(&a, &b), of_rays(&a, &b))
        };
        let found: Vec<(Compared, Compared)> = (0..splits).into_par_iter().map(of_split).collect();
        let (lenses, rays): (Vec<_>, Vec<_>) = found.into_iter().unzip();
        let (lens, ray) = (mean(&lenses), mean(&rays));
        println!(
            "{name}, {} views: parameters by noise {:.1}, as stated {:.2}; rays by noise {:.1}, as stated {:.2}",
            views.len(),
            lens.noise,
            lens.stated,
            ray.noise,
            ray.stated
        );
        judged.push((views.len(), lens, ray));
    }
    if judged.is_empty() {
        return;
    }
    // The splits of one set are no independent draws: its views have no more contrasts than their number less one.
    let contrasts: f64 = judged.iter().map(|(views, ..)| (*views as f64 - 1.0).min(splits as f64)).sum();
    let band = nees_band(8.0, contrasts);
    let band = band.start / 8.0..band.end / 8.0;
    let [lenses, rays]: [Vec<Compared>; 2] =
        [judged.iter().map(|(_, lens, _)| *lens).collect(), judged.iter().map(|(.., ray)| *ray).collect()];
    for (what, sets) in [("parameters", lenses), ("rays", rays)] {
        let all = mean(&sets);
        println!("all sets, {what}: by noise {:.1}, as stated {:.2}, band {band:.2?}", all.noise, all.stated);
        assert!(band.contains(&all.stated), "{what}: {:.2} is not in {band:.2?}", all.stated);
        assert!(all.noise > 2.0 * band.end, "{what}: noise alone would do, {:.2}", all.noise);
        assert!(sets.iter().all(|set| (0.45..1.65).contains(&set.stated)), "{what}");
    }
}

/// Lenses by their own calibration from all views, held or free: their common error does not tell in the difference.
#[test]
fn halves_of_real_pairs_differ_as_their_poses_state() {
    let splits = seeds(20);
    let sets = corner_sets();
    for name in ["sourishg_stereo", "opencv_pinhole_stereo"] {
        let side = |side: &str| sets.iter().find(|set| set.name == format!("{name} {side}"));
        let (Some(left), Some(right)) = (side("left"), side("right")) else { continue };
        let views = StereoView::pair(&left.views, &right.views).unwrap();
        let [left, right]: [KannalaBrandt; 2] = [left, right]
            .map(|set| calibrate_intrinsics(&set.views, set.size, &IntrinsicsOptions::central()).unwrap().camera);
        for (what, lenses) in [("lenses held", LensKnowledge::Exact), ("lenses free", LensKnowledge::Free)] {
            let options = ExtrinsicsOptions { lenses, robust: true };
            let of_split = |seed: u64| {
                let [a, b]: [ExtrinsicsCalibration; 2] =
                    halves(&views, seed).map(|half| calibrate_extrinsics(&left, &right, &half, &options).unwrap());
                let off = simulated::error(&a.joint.left_from_right, &b.joint.left_from_right);
                let off = DVector::from_column_slice(off.as_slice());
                let by = |covariance: nalgebra::Matrix6<f64>| {
                    chi_square(&off, &DMatrix::from_column_slice(6, 6, covariance.as_slice()))
                };
                Compared { noise: by(a.noise_covariance + b.noise_covariance), stated: by(a.covariance + b.covariance) }
            };
            let found: Vec<Compared> = (0..splits).into_par_iter().map(of_split).collect();
            let pose = mean(&found);
            println!("{name}, {what}: pose by noise {:.1}, as stated {:.2}", pose.noise, pose.stated);
            let band = nees_band(6.0, (views.len() as f64 - 1.0).min(splits as f64));
            let band = band.start / 6.0..band.end / 6.0;
            assert!(band.contains(&pose.stated), "{name}, {what}: {:.2} is not in {band:.2?}", pose.stated);
        }
    }
}
