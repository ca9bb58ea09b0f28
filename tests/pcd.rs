//! Clouds as PCD by the command line, read by another project's library, pypcd4 (MAP IV).
#![allow(clippy::expect_used, clippy::print_stdout, reason = "a test fails loudly and shows its figures")]

mod common;

use std::path::Path;
use std::process::Command;

use common::pairs::{Work, refs};
use common::{fails_with, python, run_json, small_bench_toml, text};
use serde_json::Value;

/// Prints a PCD file as JSON: the encoding, the type of each column, and its rows, each with red, green and blue for `rgb`.
const READ: &str = r#"
import json, sys
from pypcd4 import PointCloud
cloud = PointCloud.from_path(sys.argv[1])
columns = []
for name in cloud.fields:
    values = cloud.pc_data[name]
    columns.extend(PointCloud.decode_rgb(values).T.tolist() if name == "rgb" else [values.tolist()])
print(json.dumps({
    "encoding": cloud.metadata.data.value,
    "fields": [f"{name}:{cloud.pc_data.dtype[name]}" for name in cloud.fields],
    "rows": list(zip(*columns)),
}))
"#;

/// A cloud as pypcd4 reads it.
struct Read {
    encoding: String,
    fields: String,
    rows: Vec<Vec<f64>>,
}

/// pypcd4's interpreter; `None` where it is missing.
fn reader() -> Option<String> {
    python("import pypcd4", "pypcd4")
}

fn read(python: &str, file: impl AsRef<Path>) -> Read {
    let output = Command::new(python).args(["-c", READ]).arg(file.as_ref()).output().expect("python runs");
    assert!(output.status.success(), "{}", text(&output.stderr));
    let said: Value = serde_json::from_slice(&output.stdout).expect("JSON");
    let words = |name: &str| -> Vec<String> { serde_json::from_value(said[name].clone()).expect("words") };
    Read {
        encoding: said["encoding"].as_str().expect("a word").to_owned(),
        fields: words("fields").join(" "),
        rows: serde_json::from_value(said["rows"].clone()).expect("numbers"),
    }
}

/// The rows of a table whose numbers have six decimals.
fn table(file: &str) -> Vec<Vec<f64>> {
    let numbers = |line: &str| line.split(',').map(|number| number.parse().expect("a number")).collect();
    std::fs::read_to_string(file).expect("a table").lines().skip(1).map(numbers).collect()
}

/// Whether both hold the same numbers up to the single precision of a PCD file and the six decimals of a table.
fn assert_same(rows: &[Vec<f64>], others: &[Vec<f64>]) {
    assert_eq!(rows.len(), others.len());
    for (row, other) in rows.iter().zip(others) {
        assert_eq!(row.len(), other.len());
        let is_near = |(one, other): (&f64, &f64)| (one - other).abs() <= 1e-6 + 1.2e-7 * other.abs();
        assert!(row.iter().zip(other).all(is_near), "{row:?} is not {other:?}");
    }
}

/// The same photograph with channels that differ.
fn tint(path: &str) {
    let mut image = image::open(path).expect("a photograph").into_rgb8();
    for image::Rgb([red, green, blue]) in image.pixels_mut() {
        (*red, *blue) = (*green / 2 + 128, *green / 4);
    }
    image.save(path).expect("it is written");
}

/// The folder with a pair of the simulated room, and the arguments that measure it.
fn pair() -> (Work, Vec<String>) {
    let work = Work::new();
    work.photograph(0.0, 1, ["one.png", "two.png"]);
    tint(&work.file("one.png"));
    let arguments = work.depth("one.png", "two.png", &["--json"]);
    (work, arguments)
}

fn with<'a>(arguments: &'a [String], out: &'a str, more: &[&'a str]) -> Vec<&'a str> {
    let at = arguments.iter().position(|word| word == "--out").expect("an option") + 1;
    let mut all = refs(arguments);
    all[at] = out;
    [&all, more].concat()
}

#[test]
fn sparse_clouds_hold_the_numbers_of_the_table_in_both_encodings() {
    let Some(python) = reader() else { return };
    let (work, arguments) = pair();
    let out = work.file("cloud.PCD");
    for (encoding, colour, more) in [("binary", "float32", &[][..]), ("ascii", "uint32", &["--ascii"])] {
        let result = run_json(&with(&arguments, &out, &[&["--also", "csv"], more].concat()));
        let (cloud, table) = (read(&python, &out), table(&work.file("cloud.csv")));
        println!("{encoding}: {} points, {}", cloud.rows.len(), cloud.fields);
        assert_eq!(cloud.encoding, encoding);
        assert_eq!(result["points"].as_u64(), Some(cloud.rows.len() as u64));
        assert!(cloud.rows.len() > 100, "{result}");
        assert!(cloud.fields.starts_with(&format!("x:float32 y:float32 z:float32 rgb:{colour} u_left:float32")));
        assert!(cloud.fields.ends_with("own_zz:float32 extrapolated:uint8 track:int32"), "{}", cloud.fields);
        assert!(cloud.rows.iter().any(|row| row[3] > row[4] && row[4] > row[5]), "the channels differ");
        assert_same(&cloud.rows, &table);
    }
}

#[test]
fn a_dense_cloud_holds_the_numbers_of_the_ply_file() {
    let Some(python) = reader() else { return };
    let (work, arguments) = pair();
    let [pcd, ply] = ["dense.pcd", "dense.ply"].map(|name| work.file(name));
    for out in [&pcd, &ply] {
        run_json(&with(&arguments, out, &["--dense"]));
    }
    let cloud = read(&python, &pcd);
    let bytes = std::fs::read(&ply).expect("a cloud");
    let mark = b"end_header\n";
    let at = bytes.windows(mark.len()).position(|window| window == mark).expect("a header") + mark.len();
    let rows: Vec<Vec<f64>> = bytes[at..]
        .chunks_exact(36)
        .map(|row| {
            let float = |at: usize| f64::from(f32::from_le_bytes([row[at], row[at + 1], row[at + 2], row[at + 3]]));
            let colour = [12, 13, 14].map(|at| f64::from(row[at]));
            let [point, rest] =
                [&[0, 4, 8][..], &[15, 19, 23, 27, 31]].map(|places| places.iter().map(|&at| float(at)));
            point.chain(colour).chain(rest).chain([f64::from(row[35])]).collect()
        })
        .collect();
    println!("{} points, {}", cloud.rows.len(), cloud.fields);
    assert!(cloud.rows.len() > 10_000 && cloud.encoding == "binary");
    // On the way through JSON a number may lose its last bit of double precision.
    let single = |rows: &[Vec<f64>]| rows.iter().flatten().map(|value| *value as f32).collect::<Vec<_>>();
    assert!(single(&cloud.rows) == single(&rows), "the files differ");
}

#[test]
fn folders_and_the_live_loop_take_the_format_as_an_option() {
    let Some(python) = reader() else { return };
    let (work, arguments) = pair();
    let file = |name: &str| work.file(name);
    fails_with(&with(&arguments, &file("cloud.pcd"), &["--format", "pcd"]), 2, &["--format is for folders"]);
    for (side, name) in [("left", "one.png"), ("right", "two.png")] {
        std::fs::create_dir(file(side)).expect("a folder");
        std::fs::rename(file(name), Path::new(&file(side)).join("1.png")).expect("it is moved");
    }
    let (rig, left, right, out) = (file("rig.toml"), file("left"), file("right"), file("clouds"));
    let folders = ["depth", "--rig", &rig, "--mode", "human", "--left", &left, "--right", &right, "--out", &out];
    let result = run_json(&[&folders[..], &["--format", "pcd", "--json"]].concat());
    let cloud = read(&python, Path::new(&out).join("1.pcd"));
    assert_eq!(result["pairs"][0]["points"].as_u64(), Some(cloud.rows.len() as u64));

    // An old cloud in the other format is not left beside the newest one.
    let (small, live) = (file("small.toml"), file("live"));
    std::fs::write(&small, small_bench_toml()).expect("a rig file");
    for (format, other) in [("ply", "pcd"), ("pcd", "ply")] {
        let board = ["--port", "sim", "--rig", &small, "run", "--cameras", "sim", "--home", "--match-time", "100ms"];
        let frames = ["--frames", "1", "--out", &live, "--also", "csv", "--format", format];
        let output = common::run(&[&board[..], &frames].concat());
        assert!(output.status.success(), "{}", text(&output.stderr));
        let cloud = |ending: &str| Path::new(&live).join(format!("cloud.{ending}"));
        assert!(cloud(format).exists() && !cloud(other).exists(), "{format}");
    }
    assert_same(&read(&python, Path::new(&live).join("cloud.pcd")).rows, &table(&format!("{live}/cloud.csv")));
}
