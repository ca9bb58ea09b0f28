//! Networks on ONNX Runtime, a shared library that is loaded at run time.

use std::path::{Path, PathBuf};
use std::sync::{Mutex, PoisonError};

use ort::environment::Environment;
use ort::session::{Session, SessionInputValue};
use ort::value::{DynValue, Outlet as OrtOutlet, TensorElementType, Value, ValueType};
use vergence_matching::learned::{Elements, Network, NetworkError, Outlet, Signature, Tensor};

use crate::processor::Processor;

const NAME: &str = "ONNX Runtime";

/// The library that this process has loaded with its environment; a process can load only one.
static LOADED: Mutex<Option<(PathBuf, Environment)>> = Mutex::new(None);

/// ONNX Runtime, loaded from a library file. It stays loaded until the process ends.
pub struct OnnxRuntime {
    environment: Environment,
    threads: usize,
    processor: Processor,
}

impl OnnxRuntime {
    /// Loads `library` (`libonnxruntime.so`), unless it is loaded already. Each network will use `threads` threads of the
    /// machine's own processor for what `processor` does not compute.
    ///
    /// # Errors
    /// [`NetworkError::Runtime`] where the library is missing or too old, or another one is loaded already.
    pub fn load(library: &Path, threads: usize, processor: Processor) -> Result<Self, NetworkError> {
        let mut loaded = LOADED.lock().unwrap_or_else(PoisonError::into_inner);
        let environment = match &*loaded {
            Some((path, environment)) if path == library => environment.clone(),
            Some((other, _)) => {
                return Err(unusable(&format!("this process uses {} already, and can use only one", other.display())));
            }
            None => {
                let builder = ort::init_from(library).map_err(|error| unusable(&error))?;
                let environment = builder.with_telemetry(false).build().map_err(|error| unusable(&error))?;
                *loaded = Some((library.to_owned(), environment.clone()));
                environment
            }
        };
        Ok(Self { environment, threads, processor })
    }

    /// What computes.
    #[must_use]
    pub fn processor(&self) -> Processor {
        self.processor
    }

    /// Loads a network from the bytes of an ONNX file; `name` appears in messages.
    ///
    /// # Errors
    /// [`NetworkError::Load`] where the runtime does not support the file, or cannot use the processor.
    pub fn network(&self, name: &str, bytes: &[u8]) -> Result<Box<dyn Network>, NetworkError> {
        let failed =
            |error: &dyn std::fmt::Display| NetworkError::Load { network: name.into(), reason: error.to_string() };
        let builder = Session::builder(&self.environment).map_err(|error| failed(&error))?;
        let mut builder = builder.with_intra_threads(self.threads).map_err(|error| failed(&error))?;
        if let Some(provider) = self.processor.provider() {
            let registered = builder.with_execution_providers([provider]);
            builder = registered.map_err(|error| failed(&self.processor.unusable(&error.to_string())))?;
        }
        let session = builder.commit_from_memory(bytes).map_err(|error| failed(&error))?;
        let outlets = |outlets: &[OrtOutlet]| outlets.iter().map(outlet).collect();
        let signature = Signature { inputs: outlets(session.inputs()), outputs: outlets(session.outputs()) };
        Ok(Box::new(Loaded { session: Mutex::new(session), signature }))
    }
}

fn outlet(outlet: &OrtOutlet) -> Outlet {
    let shape = match outlet.dtype() {
        ValueType::Tensor { shape, .. } => Some(shape.iter().map(|&extent| usize::try_from(extent).ok()).collect()),
        _ => None,
    };
    Outlet { name: outlet.name().into(), shape }
}

struct Loaded {
    /// Behind a lock, because the library's `run` needs exclusive access.
    session: Mutex<Session>,
    signature: Signature,
}

impl Network for Loaded {
    fn signature(&self) -> &Signature {
        &self.signature
    }

    fn run(&self, inputs: Vec<(&str, Tensor)>, outputs: &[&str]) -> Result<Vec<Tensor>, NetworkError> {
        let mut values: Vec<(&str, SessionInputValue<'_>)> = Vec::with_capacity(inputs.len());
        for (name, tensor) in inputs {
            values.push((name, value(tensor)?));
        }
        let mut session = self.session.lock().unwrap_or_else(PoisonError::into_inner);
        let given = session.run(values).map_err(|error| failed(&error))?;
        let taken = outputs.iter().map(|name| {
            let output = given.get(name).ok_or_else(|| NetworkError::Run(format!("it gave no '{name}'")))?;
            tensor(output)
        });
        taken.collect()
    }
}

fn value(tensor: Tensor) -> Result<SessionInputValue<'static>, NetworkError> {
    let shape = tensor.shape;
    Ok(match tensor.data {
        Elements::Float(data) => Value::from_array((shape, data)).map_err(|error| failed(&error))?.into(),
        Elements::Integer(data) => Value::from_array((shape, data)).map_err(|error| failed(&error))?.into(),
    })
}

fn tensor(value: &DynValue) -> Result<Tensor, NetworkError> {
    let extent = |shape: &[i64]| shape.iter().map(|&n| usize::try_from(n).unwrap_or(0)).collect();
    let ValueType::Tensor { ty, .. } = value.dtype() else {
        return Err(NetworkError::Run("an output is no tensor".into()));
    };
    match ty {
        TensorElementType::Float32 => {
            let (shape, data) = value.try_extract_tensor::<f32>().map_err(|error| failed(&error))?;
            Ok(Tensor { shape: extent(shape), data: Elements::Float(data.to_vec()) })
        }
        TensorElementType::Int64 => {
            let (shape, data) = value.try_extract_tensor::<i64>().map_err(|error| failed(&error))?;
            Ok(Tensor { shape: extent(shape), data: Elements::Integer(data.to_vec()) })
        }
        TensorElementType::Int32 => {
            let (shape, data) = value.try_extract_tensor::<i32>().map_err(|error| failed(&error))?;
            let wide = data.iter().copied().map(i64::from).collect();
            Ok(Tensor { shape: extent(shape), data: Elements::Integer(wide) })
        }
        other => Err(NetworkError::Run(format!("an output holds {other:?}, not floats or integers"))),
    }
}

fn unusable(error: &dyn std::fmt::Display) -> NetworkError {
    NetworkError::Runtime { runtime: NAME, reason: error.to_string() }
}

fn failed(error: &dyn std::fmt::Display) -> NetworkError {
    NetworkError::Run(error.to_string())
}
