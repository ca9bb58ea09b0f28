//! Metric truth on real photographs: pairs of a chessboard calibrate by the command line, other pairs of the same board are measured
//! with the rig file, and its squares are known. The photographs live outside the repository; see `tests/common/data.rs`.
#![allow(
    clippy::expect_used,
    clippy::panic,
    clippy::print_stdout,
    reason = "a test fails loudly and shows its figures"
)]

mod common;

use std::ops::Range;
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

fn calibrated(set: &Path, work: &Path, model: &str) -> Calibrated {
    let file = |name: &str| work.join(name).to_string_lossy().into_owned();
    let square = format!("{SQUARE_MM}mm");
    let board = ["--corners", "9x6", "--square", &square];
    let photographs = |side: &str| -> Vec<String> {
        OF_CALIBRATION.map(|number| photograph(set, side, number).to_string_lossy().into_owned()).collect()
    };
    let corner_px = ["left", "right"].map(|side| {
        let (out, images) = (file(&format!("{side}.toml")), photographs(side));
        let images: Vec<&str> = images.iter().map(String::as_str).collect();
        let verb = ["calibrate", "intrinsics", "--json", "--lens-model", model, "--out", &out, "--images"];
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

    /// How the right camera stands to the left one in this pair by these columns of its board alone.
    fn own_pose(&self, rig: &Rig, columns: &Range<usize>) -> Transform<Left, Right> {
        let in_columns = |view: &TargetView| TargetView {
            name: view.name.clone(),
            corners: view.corners.iter().filter(|corner| columns.contains(&column(corner))).copied().collect(),
        };
        let [left, right] = [(&rig.left_camera, 0), (&rig.right_camera, 1)]
            .map(|(lens, side)| target_pose(lens, &in_columns(&self.views[side])).expect("a pose").camera_from_target);
        (left * right.inverse()).renamed()
    }
}

/// The column of the board in which a corner lies.
fn column(corner: &Corner) -> usize {
    (corner.target_mm[0] / SQUARE_MM).round() as usize
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

/// How spacings are measured: by which method, with which pose, and what is known about them.
struct Measurement<'a> {
    kernel: Kernel,
    pair: StereoPair<'a>,
    sigma_px: f64,
    shared: &'a SharedCovariance,
}

impl Measurement<'_> {
    /// The errors of all spacings between these columns of a board in millimetres, and their variances.
    fn spacings(&self, board: &Board, columns: &Range<usize>) -> Vec<(f64, f64)> {
        let points: Vec<_> = board
            .pixels()
            .iter()
            .map(|pixels| measured(&self.kernel, pixels.as_ref()?, &self.pair, self.sigma_px))
            .collect();
        let mut found = Vec::new();
        for place in (0..points.len()).filter(|place| columns.contains(&(place % COLUMNS))) {
            let neighbours = [columns.contains(&(place % COLUMNS + 1)).then_some(place + 1), Some(place + COLUMNS)];
            for other in neighbours.into_iter().flatten() {
                if let (Some(a), Some(Some(b))) = (&points[place], points.get(other)) {
                    found.push(spacing(a, b, self.shared));
                }
            }
        }
        found
    }
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
    println!("lenses known to be central");
    let Calibrated { rig, sigma_px } = calibrated(&set, work.path(), "central");
    let boards: Vec<Board> = MEASURED.map(|number| Board::seen(&set, number, &rig)).collect();
    println!("corners good to {sigma_px:.3} px");
    println!("method               pose of          spacings   bias mm    rms mm   NEES");
    for kernel in Kernel::ALL {
        let [by_rig, by_pairs, by_halves] = POSES.map(|(pose, name)| {
            let found = pose.spacings(&boards, kernel, &rig, sigma_px);
            let (bias, rms) = bias_and_rms(&found);
            let nees = mean(&found, |(error, variance)| error * error / variance);
            println!("{:20} {name:15} {:9} {bias:9.3} {rms:9.3} {nees:6.2}", format!("{kernel:?}"), found.len());
            Row { count: found.len(), bias, rms, nees }
        });
        by_rig.check(kernel);
        // What is left where nothing moves between the photographs is the error of lenses and corners.
        let [most_by_pairs, most_by_halves] = MOST_WITHOUT_MOTION;
        assert!(by_pairs.rms < most_by_pairs, "{kernel:?}: {} mm rms by the pairs' own poses", by_pairs.rms);
        assert!(by_halves.rms < most_by_halves, "{kernel:?}: {} mm rms by poses from the other half", by_halves.rms);
    }
    by_pairs(&boards, &rig, sigma_px);

    // What a dozen views leave open of decentring and thin prism takes up some of the motion between the photographs of a pair.
    println!("lenses by evidence, as is the default");
    let Calibrated { rig, sigma_px } = calibrated(&set, work.path(), "by-evidence");
    let found = PoseOf::Rig.spacings(&boards, Kernel::PseudoIntersection, &rig, sigma_px);
    let ((bias, rms), nees) = (bias_and_rms(&found), mean(&found, |(error, variance)| error * error / variance));
    println!("{} spacings, bias {bias:.3} mm, rms {rms:.3} mm, NEES {nees:.2}", found.len());
    assert!(bias.abs() < 0.1 && rms < 0.52 && (0.2..1.0).contains(&nees), "bias {bias} mm, rms {rms} mm, NEES {nees}");
}

/// Whose pose of the right camera measures.
#[derive(Clone, Copy)]
enum PoseOf {
    /// That of the rig file: what a user measures.
    Rig,
    /// That which the board of each pair tells: hands held the cameras, and one photograph was taken after the other. It knows the size of
    /// the board, so the mean of these errors tells nothing.
    Pair,
    /// The same from one half of the board, for the spacings of the other half, which had no part in it.
    OtherHalf,
}

const POSES: [(PoseOf, &str); 3] =
    [(PoseOf::Rig, "the rig"), (PoseOf::Pair, "each pair"), (PoseOf::OtherHalf, "the other half")];
/// Each half of the board, by columns: the one that tells the pose, and the one that is measured.
const HALVES: [[Range<usize>; 2]; 2] = [[0..5, 5..COLUMNS], [4..COLUMNS, 0..4]];

impl PoseOf {
    /// The errors of the spacings of all boards, and their variances.
    fn spacings(self, boards: &[Board], kernel: Kernel, rig: &Rig, sigma_px: f64) -> Vec<(f64, f64)> {
        boards.iter().flat_map(|board| self.spacings_of(board, kernel, rig, sigma_px)).collect()
    }

    fn spacings_of(self, board: &Board, kernel: Kernel, rig: &Rig, sigma_px: f64) -> Vec<(f64, f64)> {
        let stated = rig.pose_read_at(&[]);
        let by = |left_from_right, columns: &Range<usize>| {
            let pair = StereoPair { left: &rig.left_camera, right: &rig.right_camera, left_from_right };
            Measurement { kernel, pair, sigma_px, shared: &stated.shared }.spacings(board, columns)
        };
        let all = 0..COLUMNS;
        match self {
            Self::Rig => by(stated.left_from_right, &all),
            Self::Pair => by(board.own_pose(rig, &all), &all),
            Self::OtherHalf => {
                HALVES.iter().flat_map(|[tells, is_measured]| by(board.own_pose(rig, tells), is_measured)).collect()
            }
        }
    }
}

/// Largest rms in millimetres by the pose of each pair, and by that from the other half.
const MOST_WITHOUT_MOTION: [f64; 2] = [0.21, 0.24];

/// What the spacings of all boards show.
struct Row {
    count: usize,
    bias: f64,
    rms: f64,
    nees: f64,
}

impl Row {
    /// Asserts what a user of the rig file measures.
    fn check(&self, kernel: Kernel) {
        let Self { count, bias, rms, nees } = self;
        assert!(*count >= 550, "{kernel:?}: {count} spacings");
        let [most_bias, most] = if kernel == Kernel::Rectified { [0.15, 0.6] } else { [0.1, 0.42] };
        assert!(*rms < most && bias.abs() < most_bias, "{kernel:?}: bias {bias} mm, rms {rms} mm");
        // Of the other methods the covariance is that of the pseudo-intersection, to which they agree in the epipolar plane only.
        // It counts the whole residual of the lens fits as noise of single corners. Most of that residual is misfit, which
        // neighbours share, so that spacings are better than is stated.
        if kernel == Kernel::PseudoIntersection {
            assert!((0.2..1.0).contains(nees), "NEES {nees:.2} of 1");
        }
    }
}

/// Prints how far each pair's own pose is from that of the rig, and what that does to its spacings.
fn by_pairs(boards: &[Board], rig: &Rig, sigma_px: f64) {
    let stated = rig.pose_read_at(&[]).left_from_right;
    println!("pair  its pose is off by deg, mm   rms mm by the pose of {}, {}, {}", POSES[0].1, POSES[1].1, POSES[2].1);
    for board in boards {
        let own = board.own_pose(rig, &(0..COLUMNS));
        let turn = (own.rotation() * stated.rotation().inverse()).angle().to_degrees();
        let shift = (own.origin().mm() - stated.origin().mm()).norm();
        let [by_rig, by_pair, by_half] =
            POSES.map(|(pose, _)| bias_and_rms(&pose.spacings_of(board, Kernel::PseudoIntersection, rig, sigma_px)).1);
        println!("{:4} {turn:21.2} {shift:7.2} {by_rig:24.3} {by_pair:9.3} {by_half:9.3}", board.number);
    }
}
