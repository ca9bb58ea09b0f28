//! The published networks on a pair of photographs, against Python's onnxruntime 1.31.1: 330 matches of 1024 keypoints.
//! Networks and photographs live outside the repository, see `tests/common/data.rs`.
#![allow(
    clippy::expect_used,
    clippy::panic,
    clippy::print_stdout,
    clippy::disallowed_methods,
    reason = "a test fails loudly, shows its figures and looks for its data"
)]

#[path = "../../../tests/common/data.rs"]
mod data;

use std::path::{Path, PathBuf};

use data::{real_data, say_skipped};
use vergence_matching::learned::{GreyImage, Manifest, Model, Network, NetworkError};
use vergence_networks::{OnnxRuntime, Processor, load_rten};

const KEYPOINTS: usize = 1024;
const FILES: [&str; 2] = ["xfeat_top4096_f32.onnx", "lighterglue_l6_f32.onnx"];

/// The folder with the networks and the pair of photographs.
fn models() -> Option<PathBuf> {
    real_data(&format!("models/{}", FILES[0])).and_then(|file| file.parent().map(Path::to_owned))
}

fn model(folder: &Path, load: impl Fn(&str, &[u8]) -> Result<Box<dyn Network>, NetworkError>) -> Model {
    let networks = FILES.map(|file| load(file, &std::fs::read(folder.join(file)).expect("a file")).expect("a network"));
    Model::new(Manifest::xfeat_lighterglue(FILES[0], FILES[1]), networks.into()).expect("the contract holds")
}

fn count_matches(folder: &Path, model: &Model) -> [usize; 3] {
    let pictures = ["pair_0410_640x480.png", "pair_0411_640x480.png"].map(|name| {
        let image = image::open(folder.join(name)).expect("a photograph").to_luma8();
        image.iter().map(|&grey| f32::from(grey) / 255.0).collect::<Vec<f32>>()
    });
    let [left, right] = [0, 1].map(|i| GreyImage { values: &pictures[i], width: 640, height: 480 });
    let found = model.compare([left, right], KEYPOINTS, [&|_| true, &|_| true]).expect("matches");
    [found.keypoints[0].len(), found.keypoints[1].len(), found.matches.len()]
}

fn expect_reference(counts: [usize; 3]) {
    assert_eq!(counts[..2], [KEYPOINTS, KEYPOINTS]);
    assert!(counts[2].abs_diff(330) <= 5, "{} matches", counts[2]);
}

#[test]
fn rten_finds_what_python_finds() {
    let Some(folder) = models() else { return };
    let counts = count_matches(&folder, &model(&folder, load_rten));
    println!("rten: {counts:?}");
    expect_reference(counts);
}

#[test]
fn onnx_runtime_finds_what_python_finds() {
    let Some(folder) = models() else { return };
    let Some(library) = std::env::var_os("ORT_DYLIB_PATH") else {
        say_skipped("ORT_DYLIB_PATH names no ONNX Runtime");
        return;
    };
    let runtime = OnnxRuntime::load(Path::new(&library), 2, Processor::Cpu).expect("a runtime");
    let counts = count_matches(&folder, &model(&folder, |name, bytes| runtime.network(name, bytes)));
    println!("ONNX Runtime: {counts:?}");
    expect_reference(counts);
}

/// Sums in another order move a score by parts in a million, so that a few matches at the limit come or go.
#[test]
fn a_graphics_processor_finds_what_python_finds() {
    let Some(folder) = models() else { return };
    let processor = match std::env::var("VERGENCE_GRAPHICS").as_deref() {
        Ok("cuda") => Processor::Cuda,
        Ok("webgpu") => Processor::WebGpu,
        _ => return say_skipped("VERGENCE_GRAPHICS names neither cuda nor webgpu"),
    };
    let library = std::env::var_os("ORT_DYLIB_PATH").expect("ORT_DYLIB_PATH names an ONNX Runtime");
    let runtime = OnnxRuntime::load(Path::new(&library), 2, processor).expect("a runtime");
    let counts = count_matches(&folder, &model(&folder, |name, bytes| runtime.network(name, bytes)));
    println!("{}: {counts:?}", processor.runtime_name());
    expect_reference(counts);
}
