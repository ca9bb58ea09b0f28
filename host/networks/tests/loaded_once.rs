//! A process can load one ONNX Runtime only, so this test has a process of its own.
#![allow(clippy::expect_used, clippy::disallowed_methods, reason = "a test fails loudly")]

#[path = "../../../tests/common/data.rs"]
mod data;

use std::path::Path;

use data::say_skipped;
use vergence_networks::{OnnxRuntime, Processor};

#[test]
fn a_library_can_be_loaded_again_and_another_one_cannot() {
    let Some(library) = std::env::var_os("ORT_DYLIB_PATH") else {
        say_skipped("ORT_DYLIB_PATH names no ONNX Runtime");
        return;
    };
    let missing = OnnxRuntime::load(Path::new("/nonexistent/libonnxruntime.so"), 1, Processor::Cpu);
    assert!(missing.is_err(), "what failed does not stand in the way");
    OnnxRuntime::load(Path::new(&library), 1, Processor::Cpu).expect("a runtime");
    let again = OnnxRuntime::load(Path::new(&library), 2, Processor::Cpu).expect("the same again");
    let tiny = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/tiny/per_keypoint64.onnx");
    again.network("tiny", &std::fs::read(tiny).expect("a tiny network")).expect("it loads");
    let other = OnnxRuntime::load(Path::new("/nonexistent/another.so"), 1, Processor::Cpu).err().expect("refused");
    assert!(other.to_string().contains("can use only one"), "{other}");
}
