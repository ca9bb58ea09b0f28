//! What a pre-trained network is to us: named tensors in, named tensors out.

/// A dense tensor, row-major.
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
    /// Integers of whatever width the network has.
    Integer(Vec<i64>),
}

impl Tensor {
    /// A tensor of floats.
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

/// A tensor that a network takes or gives.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Outlet {
    /// Its name.
    pub name: String,
    /// Its dimensions, `None` where they are dynamic; `None` as a whole where the file does not say.
    pub shape: Option<Vec<Option<usize>>>,
}

/// What a network takes and gives.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Signature {
    /// Inputs.
    pub inputs: Vec<Outlet>,
    /// Outputs.
    pub outputs: Vec<Outlet>,
}

/// A network that is loaded and can be run.
pub trait Network: Send + Sync {
    /// What it takes and gives.
    fn signature(&self) -> &Signature;

    /// Runs it: `inputs` by name, the outputs in the order of their names in `outputs`.
    ///
    /// # Errors
    /// [`NetworkError`] where a name or shape does not fit, or the runtime fails.
    fn run(&self, inputs: Vec<(&str, Tensor)>, outputs: &[&str]) -> Result<Vec<Tensor>, NetworkError>;
}

/// Why a network could not be loaded or run.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum NetworkError {
    /// The runtime could not be loaded.
    #[error("{runtime} cannot be used: {reason}")]
    Runtime {
        /// Which runtime.
        runtime: &'static str,
        /// What it says.
        reason: String,
    },
    /// The file is not a network that the runtime understands.
    #[error("the network '{network}' cannot be loaded: {reason}")]
    Load {
        /// Which network.
        network: String,
        /// What the runtime says.
        reason: String,
    },
    /// The tensors are not those that the manifest describes.
    #[error("the network '{network}' does not fit its manifest: {reason}")]
    Contract {
        /// Which network.
        network: String,
        /// What does not fit.
        reason: String,
    },
    /// It failed while running.
    #[error("the network failed: {0}")]
    Run(String),
}
