//! The interface of pre-trained networks: functions from named tensors to named tensors.

/// A dense tensor in row-major order.
#[derive(Clone, Debug, PartialEq)]
pub struct Tensor {
    /// Extent of every dimension.
    pub shape: Vec<usize>,
    /// The elements.
    pub data: Elements,
}

/// The elements of a tensor.
#[derive(Clone, Debug, PartialEq)]
pub enum Elements {
    /// Single precision.
    Float(Vec<f32>),
    /// Integers, of any width in the network.
    Integer(Vec<i64>),
}

impl Tensor {
    /// Makes a tensor of floats.
    #[must_use]
    pub fn floats(shape: &[usize], values: Vec<f32>) -> Self {
        Self { shape: shape.to_vec(), data: Elements::Float(values) }
    }

    /// The elements as floats.
    #[must_use]
    pub fn to_floats(&self) -> Vec<f32> {
        match &self.data {
            Elements::Float(values) => values.clone(),
            Elements::Integer(values) => values.iter().map(|&value| value as f32).collect(),
        }
    }

    /// The elements as integers; `None` where they are floats.
    #[must_use]
    pub fn integers(&self) -> Option<&[i64]> {
        match &self.data {
            Elements::Float(_) => None,
            Elements::Integer(values) => Some(values),
        }
    }
}

/// An input or output tensor of a network.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Outlet {
    /// Name of the tensor.
    pub name: String,
    /// Extents of its dimensions, `None` for dynamic ones; `None` as a whole where the file does not state the shape.
    pub shape: Option<Vec<Option<usize>>>,
}

/// The inputs and outputs of a network.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Signature {
    /// The inputs.
    pub inputs: Vec<Outlet>,
    /// The outputs.
    pub outputs: Vec<Outlet>,
}

/// A loaded network.
pub trait Network: Send + Sync {
    /// Names, types and shapes of the inputs and outputs.
    fn signature(&self) -> &Signature;

    /// Runs the network on `inputs` by name; returns the tensors named in `outputs`, in that order.
    ///
    /// # Errors
    /// [`NetworkError::Run`] where a name or shape does not fit, or the runtime fails.
    fn run(&self, inputs: Vec<(&str, Tensor)>, outputs: &[&str]) -> Result<Vec<Tensor>, NetworkError>;
}

/// Why a network could not be loaded or run.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum NetworkError {
    /// The runtime could not be loaded.
    #[error("{runtime} cannot be used: {reason}")]
    Runtime {
        /// Name of the runtime.
        runtime: &'static str,
        /// Message of the runtime.
        reason: String,
    },
    /// The file is not a network that the runtime understands.
    #[error("the network '{network}' cannot be loaded: {reason}")]
    Load {
        /// Name of the network.
        network: String,
        /// Message of the runtime.
        reason: String,
    },
    /// The tensors are not those that the manifest describes.
    #[error("the network '{network}' does not fit its manifest: {reason}")]
    Contract {
        /// Name of the network.
        network: String,
        /// The mismatch between network and manifest.
        reason: String,
    },
    /// The network failed while running.
    #[error("the network failed: {0}")]
    Run(String),
}
