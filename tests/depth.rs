//! The command line of `depth`: bad images and correspondences are refused, and nothing is left behind.
#![allow(
    clippy::expect_used,
    clippy::panic,
    clippy::print_stdout,
    reason = "a test fails loudly and shows its figures"
)]

mod common;

use std::path::Path;

use common::{fails_with, run_json};

fn temporary() -> tempfile::TempDir {
    tempfile::tempdir().expect("a temporary folder")
}

fn path(folder: &tempfile::TempDir, name: &str) -> String {
    folder.path().join(name).to_string_lossy().into_owned()
}

/// A small grey picture with some texture.
fn picture(path: &str, width: u32, height: u32) {
    picture_from(path, width, height, 0);
}

/// The same, of another place.
fn picture_from(path: &str, width: u32, height: u32, shift: u32) {
    image::RgbImage::from_fn(width, height, |x, y| image::Rgb([(((x + shift) * 7 + y * 13) % 251) as u8; 3]))
        .save(path)
        .expect("a picture is written");
}

/// A pair whose pose is fixed, for 64 x 48 images.
const SMALL_RIG: &str = r#"
name = "small"
[left.camera]
size = [64, 48]
fx = 20.0
fy = 20.0
cx = 31.5
cy = 23.5
opencv_k1 = 0.0
opencv_k2 = 0.0
opencv_k3 = 0.0
opencv_k4 = 0.0
[right.camera]
size = [64, 48]
fx = 20.0
fy = 20.0
cx = 31.5
cy = 23.5
opencv_k1 = 0.0
opencv_k2 = 0.0
opencv_k3 = 0.0
opencv_k4 = 0.0
[right.at_zero]
origin = ["100mm", "0mm", "0mm"]
rotation_vector = ["0deg", "0deg", "0deg"]
"#;

#[test]
fn depth_refuses_bad_images_and_leaves_no_file() {
    let folder = temporary();
    let file = |name: &str| path(&folder, name);
    let (rig, out) = (file("rig.toml"), file("cloud.ply"));
    std::fs::write(&rig, SMALL_RIG).expect("a rig file is written");
    picture(&file("good.png"), 64, 48);
    picture(&file("wide.png"), 65, 48);
    let whole = std::fs::read(file("good.png")).expect("just written");
    std::fs::write(file("cut.png"), &whole[..whole.len() / 2]).expect("half a picture is written");
    picture(&file("good.jpg"), 64, 48);
    let whole = std::fs::read(file("good.jpg")).expect("just written");
    std::fs::write(file("cut.jpg"), &whole[..whole.len() - 20]).expect("most of a picture is written");
    std::fs::write(file("bad.csv"), "u_left,v_left,u_right\n1,2,3\n").expect("written");
    let good = file("good.png");
    let depth = |left: &str, right: &str, more: &[&str], words: &[&str]| {
        let pair = ["depth", "--rig", &rig, "--left", left, "--right", right, "--out", &out];
        fails_with(&[&pair, more].concat(), 2, words);
        assert!(!Path::new(&out).exists(), "an output file was left behind");
    };
    depth(&file("missing.png"), &good, &[], &["missing.png"]);
    depth(&good, &file("cut.png"), &[], &["cut.png", "not a readable image"]);
    // Decoders fill what a JPEG lacks with grey.
    depth(&good, &file("cut.jpg"), &[], &["cut.jpg", "ends before"]);
    depth(&good, &file("wide.png"), &[], &["wide", "65 x 48", "64 x 48"]);
    depth(&good, &good, &["--points", &file("bad.csv")], &["bad.csv", "v_right"]);
    depth(&good, &good, &["--separation", "10deg"], &["separation"]);
    depth(&good, folder.path().to_str().expect("a name"), &[], &["must pair up"]);
    assert_eq!(std::fs::read_dir(folder.path()).expect("a folder").count(), 7, "only the inputs are there");
}

#[test]
fn depth_of_given_correspondences() {
    let folder = temporary();
    let file = |name: &str| path(&folder, name);
    std::fs::write(file("rig.toml"), SMALL_RIG).expect("a rig file is written");
    picture(&file("grey.png"), 64, 48);
    // Equidistant, 20 px/rad, 100 mm apart: 45° on the left and straight ahead on the right meet at (100, 0, 100).
    let column = 31.5 + 20.0 * std::f64::consts::FRAC_PI_4;
    std::fs::write(
        file("pairs.csv"),
        format!("u_left,v_left,u_right,v_right\n{column},23.5,31.5,23.5\n31.5,23.5,60,23.5\n"),
    )
    .expect("written");
    let (rig, grey, pairs, out) = (file("rig.toml"), file("grey.png"), file("pairs.csv"), file("cloud.ply"));
    let options = ["--rig", &rig, "--left", &grey, "--right", &grey, "--points", &pairs, "--out", &out];
    // Exact rays meet in one point by every method.
    let methods =
        ["pseudo-intersection", "midpoint", "mid2", "angular-l1", "angular-linf", "reprojection", "rectified"];
    for method in methods.into_iter().chain(["edge-plane:0,1,0"]) {
        let result = run_json(&[&["depth", "--json", "--ascii", "--kernel", method], &options[..]].concat());
        assert_eq!(result["points"], 1, "{method}: {result}");
        assert_eq!(result["dropped"]["matches"]["diverging"], 1, "{method}: {result}");
        assert!(result["pose_drift"].is_null(), "two pairs say nothing of the pose");
        let cloud = std::fs::read_to_string(&out).expect("a cloud");
        let (header, body) = cloud.split_once("end_header\n").expect("a PLY header");
        assert!(header.contains("element vertex 1") && header.contains("property double u_left"));
        let numbers: Vec<f64> = body.split_whitespace().map(|word| word.parse().expect("a number")).collect();
        for (got, expected) in numbers.iter().zip([100.0, 0.0, 100.0]) {
            assert!((got - expected).abs() < 0.01, "{method}: {numbers:?}");
        }
    }
    fails_with(&[&["depth", "--kernel", "guess"], &options[..]].concat(), 2, &["guess", "midpoint"]);
    std::fs::write(file("none.csv"), "u_left,v_left,u_right,v_right\n").expect("written");
    let none =
        ["--rig", &rig, "--left", &grey, "--right", &grey, "--points", &file("none.csv"), "--out", &file("n.ply")];
    fails_with(&[&["depth"], &none[..]].concat(), 1, &["no line of --points"]);
    run_json(&[&["depth", "--json", "--also", "csv,json"], &options[..]].concat());
    let csv = std::fs::read_to_string(file("cloud.csv")).expect("a table");
    let row: Vec<f64> =
        csv.lines().nth(1).expect("a row").split(',').map(|number| number.parse().expect("a number")).collect();
    let json: serde_json::Value =
        serde_json::from_str(&std::fs::read_to_string(file("cloud.json")).expect("a table")).expect("JSON");
    assert!(csv.starts_with("x_mm,y_mm,z_mm,red,green,blue,u_left") && csv.lines().count() == 2, "{csv}");
    assert_eq!(
        (json["columns"][10].as_str(), json["rows"][0].as_array().map(Vec::len)),
        (Some("sigma_range_mm"), Some(26))
    );
    assert!((row[0] - 100.0).abs() < 0.01 && (row[2] - 100.0).abs() < 0.01, "{row:?}");
    // The variance of the range, along (1, 0, 1): half of xx and zz, and xz.
    let along = (0.5 * (row[12] + row[17]) + row[14]).sqrt();
    assert!((along / row[10] - 1.0).abs() < 1e-3, "{along} {}", row[10]);
}

#[test]
fn dense_depth_refuses_bad_input_and_says_where_nothing_is_seen() {
    let folder = temporary();
    let file = |name: &str| path(&folder, name);
    let (rig, together, out) = (file("rig.toml"), file("together.toml"), file("cloud.ply"));
    std::fs::write(&rig, SMALL_RIG).expect("a rig file is written");
    std::fs::write(&together, SMALL_RIG.replace("\"100mm\"", "\"0mm\"")).expect("a rig file is written");
    picture(&file("good.png"), 64, 48);
    picture(&file("wide.png"), 65, 48);
    picture_from(&file("other.png"), 64, 48, 5);
    image::RgbImage::new(64, 48).save(file("black.png")).expect("a picture is written");
    let (good, wide, black) = (file("good.png"), file("wide.png"), file("black.png"));
    let depth = |rig: &str, left: &str, right: &str, more: &[&str], code: i32, words: &[&str]| {
        let pair = ["depth", "--dense", "--rig", rig, "--left", left, "--right", right, "--out", &out];
        fails_with(&[&pair, more].concat(), code, words);
    };
    depth(&rig, &good, &wide, &[], 2, &["wide", "65 x 48", "64 x 48"]);
    depth(&together, &good, &file("other.png"), &[], 2, &["no baseline"]);
    depth(&rig, &good, &good, &["--points", "pairs.csv"], 2, &["--dense", "--points"]);
    depth(&rig, &good, &good, &["--matcher", "guided"], 2, &["--dense", "--matcher"]);
    assert!(!Path::new(&out).exists(), "an output file was left behind");
    depth(&rig, &black, &black, &[], 1, &["nothing in black has a range", "dark"]);
    let ranges = image::open(file("cloud-range.png")).expect("the range image is written").into_luma16();
    assert!(ranges.dimensions() == (64, 48) && ranges.pixels().all(|range| range.0 == [0]));
    for name in ["cloud.ply", "cloud-sigma.png", "cloud-confidence.png", "cloud-preview.svg"] {
        assert!(Path::new(&file(name)).exists(), "{name} is written");
    }
}
