//! Metric truth on real photographs: pairs of a chessboard calibrate by the command line, other pairs of the same board are measured
//! with the rig file, and its squares are known. The photographs live outside the repository; see `tests/common/data.rs`.
#![allow(
    clippy::expect_used,
    clippy::panic,
    clippy::print_stdout,
    reason = "a test fails loudly and shows its figures"
)]

mod common;

use std::path::{Path, PathBuf};

use common::{real_data, run_json};
use nalgebra::{RowSVector, Vector3};
use serde_json::Value;
use vergence_calibration::target_pose;
use vergence_rig::Rig;
use vergence_targets::{Corner, TargetSpec, TargetView, detect};
use vergence_vision::{
    KannalaBrandt, Kernel, Left, Length, PixelPair, Point, PointUncertainty, Right, SHARED_PARAMETERS,
    SharedCovariance, StereoPair, Transform,
};

/// The board: distance of neighbouring corners, and how many there are in a row and in a column.
const SQUARE_MM: f64 = 24.23;
const COLUMNS: usize = 9;
const ROWS: usize = 6;
/// The pairs that calibrate, and those that are measured.
const OF_CALIBRATION: std::ops::RangeInclusive<u32> = 1..=12;
const MEASURED: std::ops::RangeInclusive<u32> = 13..=19;

/// What the command line makes of the photographs that calibrate: the rig file, and the noise of a corner.
struct Calibrated {
    rig: Rig,
    sigma_px: f64,
}

fn photograph(set: &Path, side: &str, number: u32) -> PathBuf {
    set.join(format!("images/{side}{number}.jpg"))
}

fn calibrated(set: &Path, work: &Path) -> Calibrated {
    let file = |name: &str| work.join(name).to_string_lossy().into_owned();
    let square = format!("{SQUARE_MM}mm");
    let board = ["--corners", "9x6", "--square", &square];
    let photographs = |side: &str| -> Vec<String> {
        OF_CALIBRATION.map(|number| photograph(set, side, number).to_string_lossy().into_owned()).collect()
    };
    let corner_px = ["left", "right"].map(|side| {
        let (out, images) = (file(&format!("{side}.toml")), photographs(side));
        let images: Vec<&str> = images.iter().map(String::as_str).collect();
        let verb = ["calibrate", "intrinsics", "--json", "--out", &out, "--images"];
        let found = run_json(&[&verb[..], &images, &board].concat());
        found["pixel_sigma"].as_f64().expect("a number")
    });
    let [left, right] = ["left", "right"].map(photographs);
    let [left, right] = [&left, &right].map(|images| images.iter().map(String::as_str).collect::<Vec<_>>());
    let (left_lens, right_lens, out) = (file("left.toml"), file("right.toml"), file("rig.toml"));
    let lenses = ["--left", &left_lens, "--right", &right_lens, "--out", &out];
    let images = [&["--left-images"][..], &left, &["--right-images"], &right].concat();
    let found: Value = run_json(&[&["calibrate", "extrinsics", "--json"][..], &images, &board, &lenses].concat());
    println!("views scatter {:.2} times what noise explains", found["joint"]["view_scatter"].as_f64().unwrap_or(0.0));
    let rig = Rig::from_toml(&std::fs::read_to_string(&out).expect("a rig file")).expect("a rig");
    Calibrated { rig, sigma_px: (0.5 * (corner_px[0].powi(2) + corner_px[1].powi(2))).sqrt() }
}

/// The board as both cameras see it in a pair.
struct Board {
    number: u32,
    views: [TargetView; 2],
}

impl Board {
    /// As the detector sees it.
    fn seen(set: &Path, number: u32, rig: &Rig) -> Self {
        let square = Length::from_mm(SQUARE_MM);
        let spec = TargetSpec { columns: COLUMNS as u32, rows: ROWS as u32, square };
        let view = |side: &str, lens: &KannalaBrandt| {
            let file = photograph(set, side, number);
            let image = image::open(&file).expect("an image").into_luma8();
            detect(&image, &spec, Some(lens)).expect("a board").view(&file.to_string_lossy(), &spec)
        };
        Self { number, views: [view("left", &rig.left_camera), view("right", &rig.right_camera)] }
    }

    /// Each place of the board where both cameras have it.
    fn pixels(&self) -> Vec<Option<PixelPair>> {
        let at = |view: &TargetView, place: usize| {
            let mm = [place % COLUMNS, place / COLUMNS].map(|n| n as f64 * SQUARE_MM);
            let is_there = |corner: &&Corner| (corner.target_mm[0] - mm[0]).hypot(corner.target_mm[1] - mm[1]) < 1.0;
            view.corners.iter().find(is_there).map(|corner| corner.pixel)
        };
        let pair = |place| Some(PixelPair { left: at(&self.views[0], place)?, right: at(&self.views[1], place)? });
        (0..COLUMNS * ROWS).map(pair).collect()
    }

    /// How the right camera stands to the left one in this pair by its board alone.
    fn own_pose(&self, rig: &Rig) -> Transform<Left, Right> {
        let left = target_pose(&rig.left_camera, &self.views[0]).expect("a pose").camera_from_target;
        let right = target_pose(&rig.right_camera, &self.views[1]).expect("a pose").camera_from_target;
        (left * right.inverse()).renamed()
    }
}

/// A measured corner.
struct Measured {
    point: Vector3<f64>,
    uncertainty: PointUncertainty,
}

fn measured(kernel: &Kernel, pixels: &PixelPair, pair: &StereoPair<'_>, sigma_px: f64) -> Option<Measured> {
    let point: Point<Left> = kernel.triangulate(pixels, pair).ok()?.point;
    Some(Measured { point: point.mm(), uncertainty: PointUncertainty::by(kernel, &point, pair, sigma_px)? })
}

/// The error of a spacing in millimetres, and its variance.
fn spacing(a: &Measured, b: &Measured, shared: &SharedCovariance) -> (f64, f64) {
    let between = b.point - a.point;
    let along = between.normalize().transpose();
    let by_shared: RowSVector<f64, SHARED_PARAMETERS> = along * (b.uncertainty.by_shared - a.uncertainty.by_shared);
    let pixels = along * (a.uncertainty.from_pixels + b.uncertainty.from_pixels) * along.transpose();
    let variance = pixels[(0, 0)] + (by_shared * shared.matrix() * by_shared.transpose())[(0, 0)];
    (between.norm() - SQUARE_MM, variance)
}

/// The errors of all spacings of a board in millimetres, and their variances.
fn spacings(
    board: &Board,
    kernel: &Kernel,
    pair: &StereoPair<'_>,
    sigma_px: f64,
    shared: &SharedCovariance,
) -> Vec<(f64, f64)> {
    let points: Vec<_> =
        board.pixels().iter().map(|pixels| measured(kernel, pixels.as_ref()?, pair, sigma_px)).collect();
    let mut found = Vec::new();
    for place in 0..points.len() {
        let neighbours = [(place % COLUMNS + 1 < COLUMNS).then_some(place + 1), Some(place + COLUMNS)];
        for other in neighbours.into_iter().flatten() {
            if let (Some(a), Some(Some(b))) = (&points[place], points.get(other)) {
                found.push(spacing(a, b, shared));
            }
        }
    }
    found
}

fn mean<T>(found: &[T], of: impl Fn(&T) -> f64) -> f64 {
    found.iter().map(of).sum::<f64>() / found.len() as f64
}

/// Mean and root mean square of errors.
fn bias_and_rms(found: &[(f64, f64)]) -> (f64, f64) {
    (mean(found, |(error, _)| *error), mean(found, |(error, _)| error * error).sqrt())
}

#[test]
fn neighbouring_corners_of_a_real_board_are_as_far_apart_as_they_are() {
    let Some(set) = real_data("data/sourishg_stereo") else { return };
    let work = tempfile::tempdir().expect("a temporary folder");
    let Calibrated { rig, sigma_px } = calibrated(&set, work.path());
    let boards: Vec<Board> = MEASURED.map(|number| Board::seen(&set, number, &rig)).collect();
    by_the_pose_of_the_rig(&boards, &rig, sigma_px);
    by_the_poses_of_the_pairs(&boards, &rig, sigma_px);
}

/// What a user of the rig file measures, by each method.
fn by_the_pose_of_the_rig(boards: &[Board], rig: &Rig, sigma_px: f64) {
    let pose = rig.pose_read_at(&[]);
    let pair = StereoPair { left: &rig.left_camera, right: &rig.right_camera, left_from_right: pose.left_from_right };
    println!("corners good to {sigma_px:.3} px\n{:20} spacings   bias mm    rms mm   NEES", "method");
    for kernel in Kernel::ALL {
        let of = |board: &Board| spacings(board, &kernel, &pair, sigma_px, &pose.shared);
        let found: Vec<(f64, f64)> = boards.iter().flat_map(of).collect();
        let (bias, rms) = bias_and_rms(&found);
        let nees = mean(&found, |(error, variance)| error * error / variance);
        println!("{:20} {:8} {bias:9.3} {rms:9.3} {nees:6.2}", format!("{kernel:?}"), found.len());
        assert!(found.len() >= 550, "{kernel:?}: {} spacings", found.len());
        let [most_bias, most] = if kernel == Kernel::Rectified { [0.15, 0.6] } else { [0.1, 0.42] };
        assert!(rms < most && bias.abs() < most_bias, "{kernel:?}: bias {bias} mm, rms {rms} mm");
        // Of the other methods the covariance is that of the pseudo-intersection, to which they agree in the epipolar plane only.
        // It counts the whole residual of the lens fits as noise of single corners. Most of that residual is misfit, which
        // neighbours share, so that spacings are better than is stated.
        if kernel == Kernel::PseudoIntersection {
            assert!((0.2..1.0).contains(&nees), "NEES {nees:.2} of 1");
        }
    }
}

/// Hands held the cameras, and one photograph was taken after the other. What is left where each pair has the pose that its board
/// tells is the error of lenses and corners. That pose knows the size of the board, so the mean of these errors tells nothing.
fn by_the_poses_of_the_pairs(boards: &[Board], rig: &Rig, sigma_px: f64) {
    let pose = rig.pose_read_at(&[]);
    let (mut by_rig, mut by_pairs) = (Vec::new(), Vec::new());
    println!("pair  its pose is off by deg, mm   rms mm by the rig's pose   by its own");
    for board in boards {
        let own = board.own_pose(rig);
        let errors = |left_from_right| {
            let pair = StereoPair { left: &rig.left_camera, right: &rig.right_camera, left_from_right };
            spacings(board, &Kernel::PseudoIntersection, &pair, sigma_px, &pose.shared)
        };
        let turn = (own.rotation() * pose.left_from_right.rotation().inverse()).angle().to_degrees();
        let shift = (own.origin().mm() - pose.left_from_right.origin().mm()).norm();
        let (one, other) = (errors(pose.left_from_right), errors(own));
        let rms = [&one, &other].map(|found| bias_and_rms(found).1);
        println!("{:4} {turn:21.2} {shift:7.2} {:24.3} {:12.3}", board.number, rms[0], rms[1]);
        by_rig.extend(one);
        by_pairs.extend(other);
    }
    let [by_rig, by_pairs] = [by_rig, by_pairs].map(|found| bias_and_rms(&found).1);
    println!(" all {by_rig:54.3} {by_pairs:12.3}");
    assert!(by_pairs < 0.21, "{by_pairs:.3} mm rms by the poses of the pairs themselves");
    assert!(by_pairs < 0.6 * by_rig, "{by_pairs:.3} mm against {by_rig:.3} mm");
}
