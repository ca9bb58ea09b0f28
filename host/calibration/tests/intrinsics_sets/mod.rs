//! Real corner lists with the stored optimum of an independent bundle adjustment. They live outside the repository, see
//! `tests/common/data.rs`.

#![allow(clippy::unwrap_used, reason = "a test fails by panicking")]
#![allow(dead_code, reason = "each test file uses its share")]

#[path = "../../../../tests/common/data.rs"]
pub mod data;

use std::path::Path;

use serde_json::Value;
use vergence_targets::{Corner, TargetView};
use vergence_vision::{ImageSize, OpenCvFisheye, Pixel};

/// One camera's corners and reference.
pub struct RealSet {
    pub name: String,
    pub size: ImageSize,
    pub views: Vec<TargetView>,
    pub reference: Reference,
}

/// Plain least squares after corners beyond six times the median residual were taken out.
#[derive(Debug)]
pub struct Reference {
    pub lens: OpenCvFisheye,
    /// Standard deviations of fx, fy, cx, cy, k1 to k4.
    pub sigma: [f64; 8],
    pub rms_px: f64,
    pub corners_kept: usize,
}

/// Folder, corner list, reference file, camera.
const SETS: [[&str; 4]; 5] = [
    ["sourishg_stereo", "corners_opencv_classic.csv", "reference_opencv_classic_cv5.json", "left"],
    ["sourishg_stereo", "corners_opencv_classic.csv", "reference_opencv_classic_cv5.json", "right"],
    ["ocam_fisheye1", "corners_opencv_classic.csv", "reference_opencv_classic_cv5.json", "cam"],
    ["ov_plane", "corners_babelcalib_train.csv", "reference_babelcalib_train_cv5.json", "cam"],
    ["ov_plane", "corners_babelcalib_test.csv", "reference_babelcalib_test_cv5.json", "cam"],
];

/// All sets; none if the data are missing.
pub fn real_sets() -> Vec<RealSet> {
    let Some(folder) = data::real_data("data") else { return Vec::new() };
    SETS.iter().map(|set| read_set(&folder, set)).collect()
}

/// One camera's corners.
pub struct CornerSet {
    /// Folder and camera.
    pub name: String,
    pub size: ImageSize,
    pub views: Vec<TargetView>,
}

/// The corners of every real lens, with all views that were taken of it; none if the data are missing.
pub fn corner_sets() -> Vec<CornerSet> {
    let Some(folder) = data::real_data("data") else { return Vec::new() };
    let sets: [(&str, &str, &[&str]); 6] = [
        ("sourishg_stereo", "left", &["corners_opencv_classic.csv"]),
        ("sourishg_stereo", "right", &["corners_opencv_classic.csv"]),
        ("ocam_fisheye1", "cam", &["corners_opencv_classic.csv"]),
        ("ov_plane", "cam", &["corners_babelcalib_train.csv", "corners_babelcalib_test.csv"]),
        ("opencv_pinhole_stereo", "left", &["corners_opencv_classic.csv"]),
        ("opencv_pinhole_stereo", "right", &["corners_opencv_classic.csv"]),
    ];
    let read = |(set, camera, files): &(&str, &str, &[&str])| CornerSet {
        name: format!("{set} {camera}"),
        size: image_size(&folder.join(set)),
        views: files.iter().flat_map(|file| read_views(&folder.join(set).join(file), camera)).collect(),
    };
    sets.iter().map(read).collect()
}

fn image_size(folder: &Path) -> ImageSize {
    let meta: Value = serde_json::from_slice(&std::fs::read(folder.join("meta.json")).unwrap()).unwrap();
    let [width, height] = [0, 1].map(|i: usize| meta["size"][i].as_u64().unwrap() as u32);
    ImageSize { width, height }
}

fn read_set(folder: &Path, [set, corners, reference, camera]: &[&str; 4]) -> RealSet {
    let folder = folder.join(set);
    let json = |name: &str| -> Value { serde_json::from_slice(&std::fs::read(folder.join(name)).unwrap()).unwrap() };
    let views = read_views(&folder.join(corners), camera);
    let given: usize = views.iter().map(|v| v.corners.len()).sum();
    let trimmed = &json(reference)["mono"][camera]["kb4_scipy_ba_trimmed"];
    let eight = |key: &str| -> [f64; 8] { std::array::from_fn(|i| trimmed[key][i].as_f64().unwrap()) };
    let [fx, fy, cx, cy, k1, k2, k3, k4] = eight("fx_fy_cx_cy_k1_k2_k3_k4");
    RealSet {
        name: format!("{set} {corners} {camera}"),
        size: image_size(&folder),
        views,
        reference: Reference {
            lens: OpenCvFisheye { fx, fy, cx, cy, k: [k1, k2, k3, k4] },
            sigma: eight("sigma"),
            rms_px: trimmed["rms_px"].as_f64().unwrap(),
            corners_kept: given - trimmed["outliers"].as_u64().unwrap() as usize,
        },
    }
}

fn read_views(path: &Path, camera: &str) -> Vec<TargetView> {
    let mut views: Vec<TargetView> = Vec::new();
    let mut reader = csv::Reader::from_path(path).unwrap();
    for record in reader.records().map(Result::unwrap).filter(|r| &r[0] == camera) {
        let number = |i: usize| record[i].parse::<f64>().unwrap();
        let corner = Corner::new([number(6), number(7)], Pixel { u: number(4), v: number(5) });
        let name = format!("{} {}", &record[1], &record[2]);
        match views.iter_mut().find(|view| view.name == name) {
            Some(view) => view.corners.push(corner),
            None => views.push(TargetView { name, corners: vec![corner] }),
        }
    }
    views
}

/// fx, fy, cx, cy, k1 to k4.
pub fn parameters(lens: &OpenCvFisheye) -> [f64; 8] {
    let [k1, k2, k3, k4] = lens.k;
    [lens.fx, lens.fy, lens.cx, lens.cy, k1, k2, k3, k4]
}

/// The largest difference of two lenses in units of `sigma`.
pub fn largest_difference(a: &OpenCvFisheye, b: &OpenCvFisheye, sigma: &[f64; 8]) -> f64 {
    let differences = parameters(a).into_iter().zip(parameters(b)).zip(sigma).map(|((a, b), s)| ((a - b) / s).abs());
    differences.fold(0.0, f64::max)
}
