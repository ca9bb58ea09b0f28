//! The relative pose of a pair in herbivore pose, from rendered photographs alone: the lenses from their own
//! calibration on rendered targets, the corners from our detector. Nothing but the renderer knows the truth.
//!
//! Only the part of each 2048 x 2048 picture that shows the target is rendered, by the same lens with its centre moved.
#![allow(clippy::unwrap_used, clippy::print_stdout, reason = "a test may fail, and tells its figures")]

mod simulated;

use image::GrayImage;
use nalgebra::{Isometry3, SVector, UnitQuaternion, Vector3};
use rayon::prelude::*;
use simulated::{
    COLUMNS, Dice, Pair, ROWS, SQUARE_MM, apart, error, facing_target, first_seed, lens, median, other_lens, pair_pose,
    photograph, seeds,
};
use vergence_calibration::{
    ExtrinsicsOptions, IntrinsicsCalibration, IntrinsicsOptions, LensKnowledge, StereoView, calibrate_extrinsics,
    calibrate_intrinsics,
};
use vergence_scene::{Optics, SheetView, Target, photograph_sheet};
use vergence_targets::{Corner, TargetSpec, TargetView, detect};
use vergence_vision::{ImageSize, KannalaBrandt, Length, OpenCvFisheye, Pixel, Transform};

const SPEC: TargetSpec = TargetSpec { columns: COLUMNS, rows: ROWS, square: Length::from_mm(SQUARE_MM) };
const SHARED_VIEWS: usize = 12;
const OWN_VIEWS: usize = 30;
/// Around the corners of a target: its outer squares and the paper about them.
const MARGIN_PX: f64 = 90.0;

/// A target before one camera.
#[derive(Clone)]
struct Shot {
    camera: KannalaBrandt,
    camera_from_target: Isometry3<f64>,
    /// The corners as they truly are.
    truth: TargetView,
    seed: u64,
}

impl Shot {
    fn new(camera: &KannalaBrandt, camera_from_target: Isometry3<f64>, dice: &mut Dice) -> Self {
        let truth = photograph(camera, &camera_from_target, 0.0, dice);
        Self { camera: *camera, camera_from_target, truth, seed: dice.between(0.0, 1e15) as u64 }
    }

    fn is_whole(&self) -> bool {
        self.truth.corners.len() == (COLUMNS * ROWS) as usize
    }

    fn photo(self) -> Photo {
        let window = self.window();
        Photo { image: self.picture(window), window, shot: self }
    }

    /// Left, top, width and height.
    fn window(&self) -> [u32; 4] {
        let extent = |value: fn(Pixel) -> f64, size: u32| {
            let values = self.truth.corners.iter().map(|corner| value(corner.pixel));
            let (low, high) = values.fold((f64::INFINITY, 0.0f64), |(low, high), x| (low.min(x), high.max(x)));
            let low = (low - MARGIN_PX).max(0.0) as u32;
            (low, ((high + MARGIN_PX) as u32).min(size) - low)
        };
        let size = self.camera.size();
        let ((left, width), (top, height)) = (extent(|p| p.u, size.width), extent(|p| p.v, size.height));
        [left, top, width, height]
    }

    fn picture(&self, [left, top, width, height]: [u32; 4]) -> GrayImage {
        let camera = cut(&self.camera, [left, top, width, height]);
        let sheet = Target { columns: COLUMNS, rows: ROWS, square: SPEC.square }.into();
        let camera_from_sheet = Transform::from_isometry(self.camera_from_target);
        // A noisy sensor: corners are then known to about 0.1 px.
        let optics = Optics {
            samples: 1,
            edge_samples: 24,
            blur_px: 0.8,
            read_noise: 9.0,
            shot_noise: 9.0,
            ..Optics::default()
        };
        photograph_sheet(&SheetView { sheet, camera_from_sheet, camera: &camera, optics: &optics }, self.seed)
    }
}

/// `camera` with only the part of its sensor in the window: left, top, width and height.
fn cut(camera: &KannalaBrandt, [left, top, width, height]: [u32; 4]) -> KannalaBrandt {
    let mut lens = camera.to_opencv();
    (lens.cx, lens.cy) = (lens.cx - f64::from(left), lens.cy - f64::from(top));
    KannalaBrandt::from_opencv(lens, camera.theta_max(), ImageSize { width, height }).unwrap()
}

/// The part of a picture that shows the target.
struct Photo {
    shot: Shot,
    window: [u32; 4],
    image: GrayImage,
}

impl Photo {
    /// Corners that our detector finds in it, given what is known of the lens.
    fn detected(&self, lens: Option<&KannalaBrandt>) -> Option<TargetView> {
        let hint = lens.map(|lens| cut(lens, self.window));
        let mut view = detect(&self.image, &SPEC, hint.as_ref()).ok()?.view("", &SPEC);
        for Corner { pixel, .. } in &mut view.corners {
            *pixel = Pixel { u: pixel.u + f64::from(self.window[0]), v: pixel.v + f64::from(self.window[1]) };
        }
        Some(view)
    }

    /// Errors of the corners in u and v, in pixels.
    fn errors(&self, found: &TargetView) -> Vec<f64> {
        let of = |corner: &Corner| {
            let near = |a: [f64; 2], b: [f64; 2]| (a[0] - b[0]).hypot(a[1] - b[1]) < 1e-6;
            let truth = self.shot.truth.corners.iter().find(|truth| near(truth.target_mm, corner.target_mm))?;
            Some([corner.pixel.u - truth.pixel.u, corner.pixel.v - truth.pixel.v])
        };
        found.corners.iter().filter_map(of).flatten().collect()
    }
}

/// Targets that both cameras see whole.
fn shared_shots(pair: &Pair, dice: &mut Dice) -> Vec<[Shot; 2]> {
    let forward = pair.left_from_right.rotation().powf(0.5) * Vector3::z();
    let middle = pair.left_from_right.origin().mm() * 0.5;
    let mut shots = Vec::new();
    while shots.len() < SHARED_VIEWS + 4 {
        let direction = UnitQuaternion::from_scaled_axis(dice.cube(0.6)) * forward;
        let centre = middle + direction * dice.between(320.0, 650.0);
        let target = facing_target(dice, centre, 40.0);
        let left = Shot::new(&pair.left, target, dice);
        let right = Shot::new(&pair.right, pair.left_from_right.inverse().isometry() * target, dice);
        if left.is_whole() && right.is_whole() {
            shots.push([left, right]);
        }
    }
    shots
}

fn shared_views(
    pair: &Pair,
    [left_lens, right_lens]: [&KannalaBrandt; 2],
    dice: &mut Dice,
    errors: &mut Vec<f64>,
) -> Vec<StereoView> {
    let photos: Vec<[Photo; 2]> =
        shared_shots(pair, dice).into_par_iter().map(|shots| shots.map(Shot::photo)).collect();
    let see = |[left, right]: &[Photo; 2]| Some([left.detected(Some(left_lens))?, right.detected(Some(right_lens))?]);
    let seen: Vec<_> = photos.par_iter().map(see).collect();
    let mut views = Vec::new();
    for ([left_photo, right_photo], seen) in photos.iter().zip(seen) {
        let Some([left, right]) = seen.filter(|_| views.len() < SHARED_VIEWS) else { continue };
        errors.extend(left_photo.errors(&left));
        errors.extend(right_photo.errors(&right));
        views.push(StereoView { name: format!("view {}", views.len() + 1), left, right });
    }
    views
}

/// Targets all over the field, as for the lens's own calibration.
fn own_shots(camera: &KannalaBrandt, dice: &mut Dice) -> Vec<Shot> {
    let mut shots: Vec<Shot> = Vec::new();
    while shots.len() < OWN_VIEWS {
        let (theta, phi) = (dice.between(0.0, 92.0).to_radians(), dice.between(0.0, std::f64::consts::TAU));
        let direction = Vector3::new(theta.sin() * phi.cos(), theta.sin() * phi.sin(), theta.cos());
        let range = dice.between(180.0, 400.0);
        let target = facing_target(dice, direction * range, 45.0);
        let shot = Shot::new(camera, target, dice);
        if shot.truth.corners.len() >= 20 {
            shots.push(shot);
        }
    }
    shots
}

/// A lens from photographs alone: calibrated roughly, then again from corners found with what is known by then. It is known to be central and
/// symmetric: `extrinsics_accuracy` says what not knowing it costs.
fn own_calibration(camera: &KannalaBrandt, dice: &mut Dice) -> IntrinsicsCalibration {
    let photos: Vec<Photo> = own_shots(camera, dice).into_par_iter().map(Shot::photo).collect();
    let calibrated = |lens: Option<&KannalaBrandt>| {
        let views: Vec<_> = photos.par_iter().filter_map(|photo| photo.detected(lens)).collect();
        calibrate_intrinsics(&views, camera.size(), &IntrinsicsOptions::central()).unwrap()
    };
    calibrated(Some(&calibrated(None).camera))
}

/// Squared distance of the lens from the truth in its covariance; χ² of 8 where that is right.
fn lens_nees(found: &IntrinsicsCalibration, truth: &KannalaBrandt) -> f64 {
    let numbers = |lens: OpenCvFisheye| {
        SVector::from([lens.fx, lens.fy, lens.cx, lens.cy, lens.k[0], lens.k[1], lens.k[2], lens.k[3]])
    };
    let off = numbers(found.opencv) - numbers(truth.to_opencv());
    let covariance = found.covariance.fixed_view::<8, 8>(0, 0).into_owned();
    (off.transpose() * covariance.try_inverse().unwrap() * off)[(0, 0)]
}

/// Mean NEES of χ² variables with 6 degrees of freedom: the band that holds 99 % of all cases (E. Wilson and M.
/// Hilferty, "The distribution of chi-square", PNAS 17, 1931: its cube root is nearly normal).
fn nees_band(seeds: usize) -> std::ops::Range<f64> {
    let variance = 2.0 / (9.0 * 6.0 * seeds as f64);
    let quantile = |z: f64| 6.0 * (1.0 - variance + z * variance.sqrt()).powi(3);
    quantile(-2.576)..quantile(2.576)
}

#[test]
fn herbivore_pose_from_photographs_alone() {
    let seeds = first_seed()..first_seed() + seeds(1);
    let (mut apart_of_seeds, mut nees, mut errors) = (Vec::new(), Vec::new(), Vec::new());
    for seed in seeds {
        let mut dice = Dice::new(9000 + seed);
        let pair = Pair { left: lens(), right: other_lens(), left_from_right: pair_pose(120.0), noise_px: 0.0 };
        let [left, right] = [&pair.left, &pair.right].map(|camera| own_calibration(camera, &mut dice));
        let views = shared_views(&pair, [&left.camera, &right.camera], &mut dice, &mut errors);
        let pose = |left: &KannalaBrandt, right: &KannalaBrandt, lenses| {
            let found = calibrate_extrinsics(left, right, &views, &ExtrinsicsOptions { lenses, robust: true }).unwrap();
            let off = error(&found.joint.left_from_right, &pair.left_from_right);
            let square = (off.transpose() * found.covariance.try_inverse().unwrap() * off)[(0, 0)];
            (found, square)
        };
        let (_, with_exact_lenses) = pose(&pair.left, &pair.right, LensKnowledge::Exact);
        let (found, square) =
            pose(&left.camera, &right.camera, LensKnowledge::within(left.covariance, right.covariance));
        let (turn, shift) = apart(&found.joint.left_from_right, &pair.left_from_right);
        println!(
            "seed {seed}: {} views, joint {:.3} px: {turn:.4}° {shift:.4} mm, NEES {square:.2}, with exact lenses \
             {with_exact_lenses:.2}, of the lenses {:.2} {:.2}",
            views.len(),
            found.rms_inlier_px,
            lens_nees(&left, &pair.left),
            lens_nees(&right, &pair.right),
        );
        apart_of_seeds.push((turn, shift));
        nees.push(square);
    }
    let corner = (errors.iter().map(|e| e * e).sum::<f64>() / errors.len() as f64).sqrt();
    let count = nees.len();
    let nees = nees.iter().sum::<f64>() / count as f64;
    let turn = median(apart_of_seeds.iter().map(|e| e.0).collect());
    let shift = median(apart_of_seeds.iter().map(|e| e.1).collect());
    println!("{count} seeds: median {turn:.4}° {shift:.4} mm, NEES {nees:.2}, corners off by {corner:.3} px per axis");
    assert!(turn <= 0.02 && shift <= 0.12);
    assert!(nees_band(count).contains(&nees), "{nees}: {:?}", nees_band(count));
}

/// The part of the picture that is rendered is where it is said to be.
#[test]
fn renders_show_the_corners_where_the_lens_puts_them() {
    let mut dice = Dice::new(1);
    for centre in [Vector3::new(20.0, -30.0, 300.0), Vector3::new(-280.0, 60.0, 20.0)] {
        let target = facing_target(&mut dice, centre, 30.0);
        let photo = Shot::new(&lens(), target, &mut dice).photo();
        let errors = photo.errors(&photo.detected(Some(&lens())).unwrap());
        assert!(errors.len() >= 60 && errors.iter().all(|error| error.abs() < 0.8), "{errors:?}");
    }
}
