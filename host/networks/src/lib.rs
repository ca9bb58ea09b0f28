//! Runtimes of pre-trained networks for [`vergence_matching::learned`].
//!
//! Two runtimes load the same ONNX files and give the same results: [`rten`](load_rten) is pure Rust and always
//! available; [`OnnxRuntime`] is Microsoft's library, which is loaded at run time because it is not shipped with this
//! program, and can use a graphics processor. The caller reads the networks' files and passes their bytes.

mod onnx_runtime;
mod processor;
mod rten;

pub use onnx_runtime::OnnxRuntime;
pub use processor::Processor;
pub use rten::load_rten;
