//! A process loads one ONNX Runtime for its whole life, so this needs a process of its own.
#![allow(clippy::expect_used, reason = "a test fails loudly")]

use std::path::Path;

use vergence_matching::learned::NetworkError;
use vergence_networks::OnnxRuntime;

#[test]
fn a_runtime_that_is_not_there_is_an_error() {
    let error = OnnxRuntime::load(Path::new("/nonexistent/libonnxruntime.so"), 1).err().expect("refused");
    assert!(matches!(error, NetworkError::Runtime { .. }), "{error}");
}
