//! Real photographs of chessboards against OpenCV's classic detector.
//!
//! The data live outside the repository, see `tests/common/data.rs`. `corners_opencv_classic.csv` holds the corners of OpenCV 5.0.0,
//! findChessboardCorners + cornerSubPix with a window of 0.4 of the smallest spacing, 5 px at most.

#![allow(clippy::unwrap_used, clippy::panic, reason = "a test fails by panicking")]
#![allow(clippy::print_stdout, reason = "measured figures are printed")]
#![allow(clippy::disallowed_methods, reason = "the time that detection takes is printed")]

#[path = "../../../tests/common/data.rs"]
mod data;

use std::collections::BTreeMap;
use std::path::Path;
use std::time::Instant;

use data::real_data;
use image::GrayImage;
use vergence_calibration::{IntrinsicsOptions, LensModel, calibrate_intrinsics};
use vergence_targets::{Corner, Detection, TargetSpec, TargetView, detect};
use vergence_vision::{ImageSize, Length, Pixel};

/// Furthest that two detectors' corners may lie apart to count as the same.
const SAME_PX: f64 = 1.5;

/// Both detectors' corners of one camera.
#[derive(Default)]
struct Camera {
    size: Option<ImageSize>,
    ours: Vec<TargetView>,
    opencv: Vec<TargetView>,
    images: Vec<GrayImage>,
}

/// Detects the set's targets, asserts that 99 % of OpenCV's corners are among ours and that both label them alike, and
/// returns the corners by camera.
fn compare(folder: &Path, target: TargetSpec) -> BTreeMap<String, Camera> {
    let mut reference: BTreeMap<(String, String), BTreeMap<u32, Pixel>> = BTreeMap::new();
    for row in csv::Reader::from_path(folder.join("corners_opencv_classic.csv")).unwrap().records() {
        let row = row.unwrap();
        let pixel = Pixel { u: row[4].parse().unwrap(), v: row[5].parse().unwrap() };
        let image = reference.entry((row[0].to_owned(), row[1].to_owned())).or_default();
        image.insert(row[3].parse().unwrap(), pixel);
    }
    let mut cameras: BTreeMap<String, Camera> = BTreeMap::new();
    let (mut distances, mut milliseconds, mut total, mut complete) = (Vec::new(), Vec::new(), 0, 0);
    for ((name, file), opencv) in &reference {
        let image = image::open(folder.join("images").join(file)).unwrap().to_luma8();
        let start = Instant::now();
        let detection = detect(&image, &target, None).unwrap_or_else(|error| panic!("{file}: {error}"));
        milliseconds.push(start.elapsed().as_secs_f64() * 1e3);
        total += opencv.len();
        complete += usize::from(detection.complete);
        distances.extend(distances_of_same_corners(&detection, opencv, &target, file));
        let camera = cameras.entry(name.clone()).or_default();
        camera.size = Some(ImageSize { width: image.width(), height: image.height() });
        camera.ours.push(detection.view(file, &target));
        let corner = |(&index, &pixel): (&u32, &Pixel)| Corner::new(target.corner_mm(index), pixel);
        camera.opencv.push(TargetView { name: file.clone(), corners: opencv.iter().map(corner).collect() });
        camera.images.push(image);
    }
    distances.sort_by(f64::total_cmp);
    milliseconds.sort_by(f64::total_cmp);
    let recall = distances.len() as f64 / f64::from(u32::try_from(total).unwrap());
    println!(
        "{}: {complete}/{} complete, {}/{total} corners = {recall:.4}, mean {:.4} px, p95 {:.4} px, median {:.1} ms",
        folder.display(),
        reference.len(),
        distances.len(),
        distances.iter().sum::<f64>() / distances.len() as f64,
        distances[distances.len() * 95 / 100],
        milliseconds[milliseconds.len() / 2],
    );
    assert!(recall >= 0.99);
    cameras
}

/// Distances of the corners that both found, which must be numbered alike, or one backwards.
fn distances_of_same_corners(
    detection: &Detection,
    opencv: &BTreeMap<u32, Pixel>,
    target: &TargetSpec,
    file: &str,
) -> Vec<f64> {
    let last = target.columns * target.rows - 1;
    let (mut forwards, mut backwards) = (Vec::new(), Vec::new());
    for corner in &detection.corners {
        let distance = |index: u32| {
            let at = opencv.get(&index)?;
            Some((at.u - corner.pixel.u).hypot(at.v - corner.pixel.v)).filter(|&distance| distance < SAME_PX)
        };
        forwards.extend(distance(corner.index));
        backwards.extend(distance(last - corner.index));
    }
    assert!(forwards.is_empty() || backwards.is_empty(), "{file}: labels disagree");
    forwards.append(&mut backwards);
    forwards
}

/// Calibrates from both detectors' corners: ours must leave no larger residuals, without a hint as with the lens that
/// they give. All corners weigh the same, as OpenCV tells no sigma: weights make a better lens, not smaller residuals. Both have a lens of one
/// model: by evidence OpenCV's corners may ask for a richer one than ours.
fn assert_residuals(cameras: &BTreeMap<String, Camera>, target: TargetSpec) {
    let options = IntrinsicsOptions { model: LensModel::Central, ..IntrinsicsOptions::default() };
    for (name, camera) in cameras {
        let calibrate = |views: &[TargetView]| {
            let mut views = views.to_vec();
            views.iter_mut().flat_map(|view| &mut view.corners).for_each(|corner| corner.relative_sigma = 1.0);
            calibrate_intrinsics(&views, camera.size.unwrap(), &options).unwrap()
        };
        let (ours, opencv) = (calibrate(&camera.ours), calibrate(&camera.opencv));
        let again = |image: &GrayImage| detect(image, &target, Some(&ours.camera)).unwrap().view("", &target);
        let hinted = calibrate(&camera.images.iter().map(again).collect::<Vec<_>>());
        for (corners, found) in [("found", &ours), ("found again", &hinted)] {
            println!(
                "{name}: {corners}, inlier RMS {:.4} px of {}/{} corners, with OpenCV's {:.4} px of {}/{}",
                found.rms_inlier_px,
                found.corners_inlier,
                found.corners_total,
                opencv.rms_inlier_px,
                opencv.corners_inlier,
                opencv.corners_total,
            );
            assert!(found.rms_inlier_px <= opencv.rms_inlier_px);
            assert!(found.corners_inlier >= opencv.corners_inlier);
        }
    }
}

#[test]
fn moderate_fisheye_stereo() {
    let target = TargetSpec { columns: 9, rows: 6, square: Length::from_mm(24.23) };
    if let Some(folder) = real_data("data/sourishg_stereo") {
        assert_residuals(&compare(&folder, target), target);
    }
}

#[test]
fn strong_fisheye_close_up() {
    let target = TargetSpec { columns: 6, rows: 8, square: Length::from_mm(32.5) };
    if let Some(folder) = real_data("data/ocam_fisheye1") {
        assert_residuals(&compare(&folder, target), target);
    }
}

#[test]
fn perspective_stereo() {
    let target = TargetSpec { columns: 9, rows: 6, square: Length::from_mm(25.0) };
    if let Some(folder) = real_data("data/opencv_pinhole_stereo") {
        assert_residuals(&compare(&folder, target), target);
    }
}

#[test]
fn both_cameras_of_a_pair_number_the_corners_alike() {
    let Some(folder) = real_data("data/sourishg_stereo") else { return };
    let target = TargetSpec { columns: 9, rows: 6, square: Length::from_mm(24.23) };
    for number in 1..=19 {
        let [left, right] = ["left", "right"].map(|side| {
            let image = image::open(folder.join("images").join(format!("{side}{number}.jpg"))).unwrap().to_luma8();
            detect(&image, &target, None).unwrap()
        });
        // The cameras are parallel: first and last corner lie the same way round in both images.
        let [a, b] = [&left, &right].map(|detection| {
            let [first, last] = [0, 53].map(|i| detection.corners[i].pixel);
            [last.u - first.u, last.v - first.v]
        });
        assert!(a[0] * b[0] + a[1] * b[1] > 0.0, "pair {number}");
    }
}
