//! Real photographs: used where they are (`VERGENCE_SHARED`, or `../shared` beside the checkout), never copied.
#![allow(
    clippy::expect_used,
    clippy::panic,
    clippy::print_stdout,
    reason = "a test fails loudly and shows its figures"
)]

mod common;

use std::path::{Path, PathBuf};

use common::{real_data, run_json};
use nalgebra::{Matrix3, Rotation3, Vector3};
use serde_json::Value;

fn numbers(value: &Value) -> Vec<f64> {
    value.as_array().expect("a list").iter().map(|x| x.as_f64().expect("a number")).collect()
}

fn camera(side: &str, parameters: &Value) -> String {
    let names = ["fx", "fy", "cx", "cy", "opencv_k1", "opencv_k2", "opencv_k3", "opencv_k4"];
    let lines = names.iter().zip(numbers(parameters)).map(|(name, value)| format!("{name} = {value:?}\n"));
    format!("[{side}.camera]\nsize = [960, 600]\n{}", lines.collect::<String>())
}

/// The reference calibration (another program's) as a rig file. It holds right_from_left; the rig wants the way back.
fn rig_file(reference: &Value) -> String {
    let rows: Vec<Vec<f64>> = reference["R"].as_array().expect("rows").iter().map(numbers).collect();
    let rotation = Rotation3::from_matrix_unchecked(Matrix3::from_fn(|row, column| rows[row][column])).inverse();
    let origin = rotation * -Vector3::from_vec(numbers(&reference["T_mm"]));
    let vector = rotation.scaled_axis();
    format!(
        "name = \"reference\"\n[calibration_sigma]\nrotation = \"0.3deg\"\ntranslation = \"3mm\"\n{}{}[right.at_zero]\n\
         origin = [\"{:?}mm\", \"{:?}mm\", \"{:?}mm\"]\nrotation_vector = [\"{:?}rad\", \"{:?}rad\", \"{:?}rad\"]\n",
        camera("left", &reference["k_left"]),
        camera("right", &reference["k_right"]),
        origin.x,
        origin.y,
        origin.z,
        vector.x,
        vector.y,
        vector.z
    )
}

/// The target corners of pair 10 in both images.
fn correspondences(corners: &Path) -> String {
    let mut reader = csv::Reader::from_path(corners).expect("corners");
    let mut sides = [const { Vec::new() }; 2];
    for row in reader.records() {
        let row = row.expect("a row");
        if &row[2] == "10" {
            sides[usize::from(&row[0] == "right")].push(format!("{},{}", &row[4], &row[5]));
        }
    }
    let [left, right] = &sides;
    assert_eq!((left.len(), right.len()), (54, 54));
    let rows = left.iter().zip(right).map(|(left, right)| format!("{left},{right}\n"));
    format!("u_left,v_left,u_right,v_right\n{}", rows.collect::<String>())
}

fn points(ply: &Path) -> Vec<Vector3<f64>> {
    let text = std::fs::read_to_string(ply).expect("a cloud");
    let (_, body) = text.split_once("end_header\n").expect("a header");
    body.lines().map(|line| Vector3::from_iterator(line.split(' ').take(3).map(|x| x.parse().expect("mm")))).collect()
}

/// Distance from the best plane, rms.
fn flatness(points: &[Vector3<f64>]) -> f64 {
    let count = points.len() as f64;
    let mean = points.iter().sum::<Vector3<f64>>() / count;
    let scatter: Matrix3<f64> = points.iter().map(|p| (p - mean) * (p - mean).transpose()).sum();
    (scatter.symmetric_eigenvalues().min() / count).sqrt()
}

/// A photographed pair of the set, and a folder for what is made of it.
struct RealPair {
    set: PathBuf,
    folder: tempfile::TempDir,
    rig: String,
}

impl RealPair {
    /// `None` without the set.
    fn new() -> Option<Self> {
        let set = real_data("data/sourishg_stereo")?;
        let folder = tempfile::tempdir().expect("a temporary folder");
        let rig = write_rig(&set, folder.path());
        Some(Self { set, folder, rig })
    }

    fn file(&self, name: &str) -> String {
        self.folder.path().join(name).to_string_lossy().into_owned()
    }

    /// A file of the target's corners in both images.
    fn corners(&self) -> String {
        let pairs = self.file("pairs.csv");
        std::fs::write(&pairs, correspondences(&self.set.join("corners_opencv_classic.csv"))).expect("written");
        pairs
    }

    fn depth(&self, options: &[&str]) -> Value {
        let image = |name: &str| self.set.join("images").join(name).to_string_lossy().into_owned();
        let (left, right) = (image("left10.jpg"), image("right10.jpg"));
        let depth = ["depth", "--ascii", "--json", "--rig", &self.rig, "--left", &left, "--right", &right];
        run_json(&[&depth[..], options].concat())
    }
}

/// Writes the rig file of the set into `folder`.
fn write_rig(set: &Path, folder: &Path) -> String {
    let text = std::fs::read_to_string(set.join("reference_opencv_classic_cv5.json")).expect("a reference");
    let reference: Value = serde_json::from_str(&text).expect("JSON");
    let rig = folder.join("rig.toml");
    std::fs::write(&rig, rig_file(&reference["stereo"]["kb4_scipy_ba_trimmed"])).expect("written");
    rig.to_string_lossy().into_owned()
}

/// The published networks see the same scene, and nearly all that both matchers see lies at the same range.
#[test]
fn networks_and_the_classical_matcher_agree_on_a_real_pair() {
    let (Some(pair), Some(models)) = (RealPair::new(), real_data("models")) else { return };
    let store = pair.file("store");
    run_json(&["models", "add", &models.to_string_lossy(), "--models", &store, "--json"]);
    let (learned, classical) = (pair.file("learned.ply"), pair.file("classical.ply"));
    pair.depth(&["--out", &learned, "--matcher", "learned", "--models", &store]);
    pair.depth(&["--out", &classical]);
    let [learned, classical] = [learned, classical].map(|cloud| points(Path::new(&cloud)));
    // Points of the two clouds that lie in one direction to half a degree.
    let (mut near, mut alike) = (0, 0);
    for point in &learned {
        let closest = classical.iter().min_by(|a, b| a.angle(point).total_cmp(&b.angle(point))).expect("points");
        if closest.angle(point) < 0.5_f64.to_radians() {
            near += 1;
            alike += usize::from((closest.norm() / point.norm() - 1.0).abs() < 0.1);
        }
    }
    println!("{} points by networks, {} classical; {alike} of {near} neighbours alike", learned.len(), classical.len());
    assert!(learned.len() >= 100 && near >= 50);
    assert!(alike * 10 >= near * 8, "{alike} of {near} neighbours lie at the same range");
}

#[test]
fn a_cloud_and_a_flat_target_from_a_real_pair() {
    let Some(pair) = RealPair::new() else { return };
    let (cloud, target, pairs) = (pair.file("cloud.ply"), pair.file("target.ply"), pair.corners());
    let result = pair.depth(&["--out", &cloud]);
    let count = result["points"].as_u64().expect("a count");
    assert!(count >= 200, "{result}");
    assert_eq!(points(Path::new(&cloud)).len() as u64, count);

    let result = pair.depth(&["--out", &target, "--points", &pairs]);
    let corners = points(Path::new(&target));
    assert!(corners.len() >= 50, "{result}");
    let rms = flatness(&corners);
    println!("{count} points; target of {} corners flat to {rms:.3} mm rms", corners.len());
    assert!(rms < 1.0, "{rms} mm");
}

/// A range for every pixel: the target's corners lie where the dense cloud has them.
#[test]
fn dense_ranges_of_a_real_pair_hold_the_target() {
    let Some(pair) = RealPair::new() else { return };
    let (cloud, target, pairs) = (pair.file("dense.ply"), pair.file("target.ply"), pair.corners());
    let result = pair.depth(&["--out", &cloud, "--dense"]);
    pair.depth(&["--out", &target, "--points", &pairs]);

    let ranges = image::open(pair.file("dense-range.png")).expect("a range image").into_luma16();
    assert_eq!(ranges.dimensions(), (960, 600));
    let text = std::fs::read_to_string(&target).expect("a cloud");
    let (_, body) = text.split_once("end_header\n").expect("a header");
    let corners: Vec<Vec<f64>> =
        body.lines().map(|line| line.split(' ').map(|x| x.parse().expect("a number")).collect()).collect();
    let alike = corners.iter().filter(|corner| {
        let range = Vector3::new(corner[0], corner[1], corner[2]).norm();
        let dense = f64::from(ranges.get_pixel(corner[6].round() as u32, corner[7].round() as u32).0[0]);
        (dense / range - 1.0).abs() < 0.02
    });
    let alike = alike.count();
    println!("{result}; {alike} of {} corners alike", corners.len());
    // Pixels beside edges are measured, with the step in their sigma; where they were gaps, 17.5 % were left.
    let share = result["measured_share"].as_f64().expect("a share");
    assert!(share > 0.195, "{result}");
    assert!(
        alike * 10 >= corners.len() * 9,
        "{alike} of {} corners lie where the dense ranges have them",
        corners.len()
    );
    // As text, because all clouds of this pair are asked for so: one row for each point.
    let text = std::fs::read_to_string(&cloud).expect("a dense cloud");
    let (_, rows) = text.split_once("end_header\n").expect("a header");
    assert_eq!(rows.lines().count() as u64, result["points"].as_u64().expect("a count"));
}
