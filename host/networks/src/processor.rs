//! The processors that ONNX Runtime can use.

use ort::ep::{CUDA, ExecutionProviderDispatch, WebGPU};
use serde::{Deserialize, Serialize};

/// What computes for ONNX Runtime. The library must be built for it; none falls back to another.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Processor {
    /// The machine's own processor.
    #[default]
    Cpu,
    /// A graphics processor of NVIDIA, by CUDA: `pip install onnxruntime-gpu`.
    Cuda,
    /// Any graphics processor, by WebGPU over Vulkan, Metal or Direct3D: `pip install onnxruntime-webgpu`.
    WebGpu,
}

impl Processor {
    /// The runtime's name with this processor.
    #[must_use]
    pub fn runtime_name(self) -> &'static str {
        match self {
            Self::Cpu => "ONNX Runtime",
            Self::Cuda => "ONNX Runtime (CUDA)",
            Self::WebGpu => "ONNX Runtime (WebGPU)",
        }
    }

    /// A sentence for people where a library cannot use the processor.
    pub(crate) fn unusable(self, reason: &str) -> String {
        let (name, package) = (self.runtime_name(), self.package());
        let reason = reason.trim_end_matches(['.', ' ', '\n']);
        format!("{name} cannot be used: {reason}. It takes a library such as that of Python's package {package}")
    }

    /// The Python package whose library uses this processor.
    fn package(self) -> &'static str {
        match self {
            Self::Cpu => "onnxruntime",
            Self::Cuda => "onnxruntime-gpu",
            Self::WebGpu => "onnxruntime-webgpu",
        }
    }

    /// What a session registers for it: nothing for the machine's own processor.
    pub(crate) fn provider(self) -> Option<ExecutionProviderDispatch> {
        match self {
            Self::Cpu => None,
            Self::Cuda => Some(CUDA::default().build().error_on_failure()),
            Self::WebGpu => Some(WebGPU::default().build().error_on_failure()),
        }
    }
}
