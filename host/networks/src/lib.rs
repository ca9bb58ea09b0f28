//! Runs pre-trained networks for [`vergence_matching::learned`].
//!
//! Two runtimes, the same files, the same results: [`rten`](load_rten), pure Rust, always there; and
//! [`OnnxRuntime`], Microsoft's library, found at run time because it is not ours to ship. Files are read by the
//! caller: this crate takes bytes.

mod onnx_runtime;
mod rten;

pub use onnx_runtime::OnnxRuntime;
pub use rten::load_rten;
