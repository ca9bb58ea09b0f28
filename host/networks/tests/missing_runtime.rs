//! A process can load one ONNX Runtime only, so this test has a process of its own.
#![allow(clippy::expect_used, reason = "a test fails loudly")]

use std::path::Path;

use vergence_matching::learned::NetworkError;
use vergence_networks::{OnnxRuntime, Processor};

#[test]
fn a_missing_runtime_is_an_error() {
    let error =
        OnnxRuntime::load(Path::new("/nonexistent/libonnxruntime.so"), 1, Processor::Cpu).err().expect("refused");
    assert!(matches!(error, NetworkError::Runtime { .. }), "{error}");
}
