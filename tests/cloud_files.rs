//! Clouds by the command line, read by other projects' libraries: PCD by pypcd4 (MAP IV), LAS by laspy, PLY by plyfile, E57 by pye57 (libE57Format).
#![allow(clippy::expect_used, clippy::print_stdout, reason = "a test fails loudly and shows its figures")]

mod common;

use std::path::Path;
use std::process::Command;

use common::pairs::{Work, refs};
use common::{fails_with, python, run_json, small_bench_toml, text};
use serde_json::Value;

/// Prints a PCD file as JSON: the encoding, the type of each column, and one row of as many as the second argument says, each with red, green and blue for `rgb`.
const PCD: &str = r#"
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
    "rows": list(zip(*columns))[::int(sys.argv[2])],
}))
"#;

/// The same of a LAS file, whose extra columns have their units too.
const LAS: &str = r#"
import json, sys
import laspy
cloud = laspy.read(sys.argv[1])
system, = cloud.vlrs.get("WktCoordinateSystemVlr")
assert 'UNIT["millimetre",0.001]' in system.string and cloud.header.global_encoding.wkt, system.string
assert str(cloud.header.version) == "1.4" and cloud.point_format.id == 2
about, = (bytes(v.record_data) for v in cloud.vlrs if v.user_id == "LASF_Spec" and v.record_id == 3)
assert about.startswith(b"millimetres in the left camera's frame"), about
extra = list(cloud.point_format.extra_dimensions)
colour = [cloud[name] // 256 for name in ["red", "green", "blue"]]
columns = [cloud.x, cloud.y, cloud.z, *colour, *(cloud[dimension.name] for dimension in extra)]
print(json.dumps({
    "encoding": "binary",
    "fields": [f"{d.name}:{d.dtype}:{d.description}" for d in extra],
    "rows": list(zip(*(column.tolist() for column in map(__import__("numpy").asarray, columns))))[::int(sys.argv[2])],
}))
"#;

/// The same of a PLY file.
const PLY: &str = r#"
import json, sys
from plyfile import PlyData
cloud = PlyData.read(sys.argv[1])
vertex = cloud["vertex"].data
print(json.dumps({
    "encoding": "ascii" if cloud.text else "binary",
    "fields": [f"{name}:{vertex.dtype[name].name}" for name in vertex.dtype.names],
    "rows": [list(map(float, row)) for row in vertex[::int(sys.argv[2])]],
}))
"#;

/// The same of an E57 file, in millimetres.
const E57: &str = r#"
import json, sys
import numpy as np
import pye57
from pye57 import libe57
# pye57 itself leaves out columns of extensions; libE57Format, which it wraps, reads them.
opened = pye57.E57(sys.argv[1])
image = opened.image_file
cloud = image.root()["data3D"][0]
points = cloud["points"]
fields = libe57.StructureNode(points.prototype())
names = [fields.get(index).elementName() for index in range(fields.childCount())]
count = points.childCount()
columns = {name: np.empty(count, np.float64) for name in names}
buffers = libe57.VectorSourceDestBuffer()
for name in names:
    buffers.append(libe57.SourceDestBuffer(image, name, columns[name], count, True, True))
assert points.reader(buffers).read() == count
about = cloud["description"].value()
assert about.startswith("the left camera's frame") and "in metres" in about, about
for name in ["cartesianX", "cartesianY", "cartesianZ"]:
    columns[name] *= 1000
print(json.dumps({"encoding": "binary", "fields": names, "rows": list(zip(*(column.tolist() for column in columns.values())))[::int(sys.argv[2])]}))
"#;

/// A cloud as another library reads it.
struct Read {
    encoding: String,
    fields: String,
    rows: Vec<Vec<f64>>,
}

/// The interpreter of these libraries; `None` where one is missing.
fn reader() -> Option<String> {
    python("import pypcd4, laspy, plyfile, pye57", "pypcd4 laspy plyfile pye57")
}

fn read(python: &str, script: &str, file: impl AsRef<Path>) -> Read {
    read_one_of(1, python, script, file)
}

/// The same of one row of so many.
fn read_one_of(rows: usize, python: &str, script: &str, file: impl AsRef<Path>) -> Read {
    let output = Command::new(python)
        .args(["-c", script])
        .arg(file.as_ref())
        .arg(rows.to_string())
        .output()
        .expect("python runs");
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
        let (cloud, table) = (read(&python, PCD, &out), table(&work.file("cloud.csv")));
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

/// LAS keeps coordinates to a micrometre.
#[test]
fn a_cloud_as_las_e57_and_ply_holds_the_numbers_of_the_table() {
    let Some(python) = reader() else { return };
    let (work, arguments) = pair();
    for (name, script, first, last) in [
        ("cloud.las", LAS, "u_left:float32:pixels", "own_zz:float32:mm^2 extrapolated:uint8: track:int32:"),
        ("cloud.e57", E57, "cartesianX cartesianY cartesianZ colorRed", "vergence:extrapolated vergence:track"),
        ("cloud.ply", PLY, "x:float64 y:float64 z:float64 red:uint8", "own_zz:float32 extrapolated:uint8 track:int32"),
    ] {
        run_json(&with(&arguments, &work.file(name), &["--also", "csv"]));
        let (mut cloud, mut table) = (read(&python, script, work.file(name)), table(&work.file("cloud.csv")));
        println!("{name}: {} points, {}", cloud.rows.len(), cloud.fields);
        assert!(cloud.fields.starts_with(first) && cloud.fields.ends_with(last), "{}", cloud.fields);
        assert!(cloud.rows.len() > 100 && cloud.encoding == "binary");
        for (row, other) in cloud.rows.iter_mut().zip(&mut table) {
            let off = (0..3).map(|axis| (row[axis] - other[axis]).abs()).fold(0.0, f64::max);
            assert!(off < 6e-4, "{row:?} is not {other:?}");
            // Compared.
            [&mut *row, other].into_iter().for_each(|row| drop(row.drain(..3)));
        }
        assert_same(&cloud.rows, &table);
    }
}

#[test]
fn a_dense_cloud_holds_the_same_numbers_in_every_format() {
    let Some(python) = reader() else { return };
    let (work, arguments) = pair();
    let formats = [("dense.pcd", PCD), ("dense.las", LAS), ("dense.e57", E57), ("dense.ply", PLY)];
    let [pcd, las, e57, ply] = formats.map(|(name, script)| {
        let out = work.file(name);
        run_json(&with(&arguments, &out, &["--dense"]));
        let cloud = read_one_of(10, &python, script, &out);
        println!("{name}: {} of its points, {}", cloud.rows.len(), cloud.fields);
        cloud
    });
    assert!(ply.rows.len() > 10_000 && ply.encoding == "binary");
    // On the way through JSON a number may lose its last bit of double precision.
    let single = |rows: &[Vec<f64>], from: usize| {
        rows.iter().flat_map(|row| &row[from..]).map(|value| *value as f32).collect::<Vec<_>>()
    };
    assert!(single(&pcd.rows, 0) == single(&ply.rows, 0), "PCD and PLY differ");
    assert!(single(&las.rows, 3) == single(&ply.rows, 3), "LAS and PLY differ");
    let off =
        |(row, other): (&Vec<f64>, &Vec<f64>)| (0..3).map(|axis| (row[axis] - other[axis]).abs()).fold(0.0, f64::max);
    assert!(las.rows.iter().zip(&ply.rows).map(off).fold(0.0, f64::max) < 6e-4);
    assert!(single(&e57.rows, 0) == single(&ply.rows, 0), "E57 and PLY differ");
    depth_camera(&python, &work);
}

/// The image of a depth camera beside the dense cloud, read by OpenCV, makes the points of the cloud.
fn depth_camera(python: &str, work: &Work) {
    let script = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../tests/export/depth.py");
    let output = Command::new(python).arg(script).arg(work.file("dense")).output().expect("python runs");
    assert!(output.status.success(), "{}", text(&output.stderr));
    let said: Value = serde_json::from_slice(&output.stdout).expect("JSON");
    println!("{said}");
    let number = |name: &str| said[name].as_f64().expect("a number");
    assert!(number("points") > 10_000.0, "{said}");
    assert!(number("median_mm") < 1.5 && number("percentile_95_relative") < 0.02, "{said}");
    assert!(number("nearest_relative") < 0.02 && number("grey_off") < 4.0, "{said}");
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
    let cloud = read(&python, PCD, Path::new(&out).join("1.pcd"));
    assert_eq!(result["pairs"][0]["points"].as_u64(), Some(cloud.rows.len() as u64));

    // An old cloud in the other format is not left beside the newest one.
    let (small, live) = (file("small.toml"), file("live"));
    std::fs::write(&small, small_bench_toml()).expect("a rig file");
    for (format, other) in [("ply", "las"), ("e57", "ply"), ("las", "e57"), ("pcd", "las")] {
        let board = ["--port", "sim", "--rig", &small, "run", "--cameras", "sim", "--home", "--match-time", "100ms"];
        let frames = ["--frames", "1", "--out", &live, "--also", "csv", "--format", format];
        let output = common::run(&[&board[..], &frames].concat());
        assert!(output.status.success(), "{}", text(&output.stderr));
        let cloud = |ending: &str| Path::new(&live).join(format!("cloud.{ending}"));
        assert!(cloud(format).exists() && !cloud(other).exists(), "{format}");
    }
    assert_same(&read(&python, PCD, Path::new(&live).join("cloud.pcd")).rows, &table(&format!("{live}/cloud.csv")));
}
