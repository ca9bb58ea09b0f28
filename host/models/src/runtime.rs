//! The programs that run networks, and where ONNX Runtime is on this machine.

use std::path::{Path, PathBuf};

use vergence_matching::learned::{Manifest, Model, Network, NetworkError};
use vergence_networks::{OnnxRuntime, Processor, load_rten};

use crate::error::ModelsError;
use crate::speed::Speed;

/// A program that runs networks.
pub enum Runtime {
    /// Pure Rust, always there.
    Rten,
    /// Microsoft's library, from this file.
    OnnxRuntime(OnnxRuntime, PathBuf),
}

/// The runtimes that may be used.
#[derive(Clone, Debug, Default)]
pub struct Runtimes {
    /// The runtime that must run the networks; `None` for the one that was faster when the model was added or verified.
    pub wanted: Option<RuntimeKind>,
    /// The ONNX Runtime library, such as `libonnxruntime.so`; `None` for one that pip installed.
    pub library: Option<PathBuf>,
}

/// The kinds of [`Runtime`].
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum RuntimeKind {
    /// rten, in pure Rust.
    Rten,
    /// Microsoft's ONNX Runtime on a processor.
    OnnxRuntime(Processor),
}

/// Threads that this machine runs at once.
#[must_use]
pub fn threads() -> usize {
    std::thread::available_parallelism().map_or(1, std::num::NonZero::get)
}

impl Runtimes {
    /// The runtime for the model in `folder`, and why it was chosen: the one that is wanted, else the faster one by the
    /// model's record, else ONNX Runtime where it is installed.
    ///
    /// # Errors
    /// Fails if the wanted runtime is missing, or the named library cannot be loaded.
    pub fn choose(&self, folder: &Path) -> Result<(Runtime, String), ModelsError> {
        if self.wanted == Some(RuntimeKind::Rten) {
            return Ok((Runtime::Rten, "as asked".into()));
        }
        let speed = Speed::read(folder);
        let processor = self.processor().or(speed.as_ref().map(|speed| speed.processor)).unwrap_or_default();
        match (self.onnx_runtime(processor)?, speed) {
            (Err(why), _) if self.wanted.is_some() => Err(ModelsError::NoOnnxRuntime(why)),
            (Err(why), _) => Ok((Runtime::Rten, why)),
            (Ok(found), _) if self.wanted.is_some() => Ok((found, "as asked".into())),
            (Ok(found), Some(speed)) => Ok(faster(found, &speed)),
            (Ok(found), None) => Ok((found, "not timed yet, see 'vergence models verify'".into())),
        }
    }

    /// Every runtime on this machine.
    ///
    /// # Errors
    /// Fails if the named library cannot be loaded.
    pub fn all(&self) -> Result<Vec<Runtime>, ModelsError> {
        Ok(std::iter::once(Runtime::Rten).chain(self.onnx_runtime(self.processor().unwrap_or_default())?).collect())
    }

    /// The processor that ONNX Runtime must use.
    fn processor(&self) -> Option<Processor> {
        match self.wanted {
            Some(RuntimeKind::OnnxRuntime(processor)) => Some(processor),
            Some(RuntimeKind::Rten) | None => None,
        }
    }

    /// The named library, which must then load; else one that pip installed, or why none of them loads.
    fn onnx_runtime(&self, processor: Processor) -> Result<Result<Runtime, String>, ModelsError> {
        let load = |library: PathBuf| {
            OnnxRuntime::load(&library, threads(), processor).map(|found| Runtime::OnnxRuntime(found, library))
        };
        match &self.library {
            Some(named) => load(named.clone()).map(Ok).map_err(ModelsError::Load),
            None => Ok(installed_by_pip()
                .ok_or_else(|| "there is no ONNX Runtime".to_owned())
                .and_then(|library| load(library).map_err(|error| error.to_string()))),
        }
    }
}

/// The faster of rten and the ONNX Runtime that was `found`, and why.
fn faster(found: Runtime, speed: &Speed) -> (Runtime, String) {
    match (speed.rten_seconds, speed.onnxruntime_seconds) {
        (Some(rten), Some(onnx)) if rten < onnx => (Runtime::Rten, format!("{rten:.2} s, ONNX Runtime {onnx:.2} s")),
        (Some(rten), Some(onnx)) => (found, format!("{onnx:.2} s, rten {rten:.2} s")),
        (Some(_), None) if speed.onnxruntime.is_some() => (Runtime::Rten, "ONNX Runtime does not run it".into()),
        (None, Some(_)) => (found, "rten does not run it".into()),
        _ => (found, "not timed yet, see 'vergence models verify'".into()),
    }
}

impl Runtime {
    /// Name of the runtime.
    #[must_use]
    pub fn name(&self) -> &'static str {
        match self {
            Self::Rten => "rten",
            Self::OnnxRuntime(runtime, _) => runtime.processor().runtime_name(),
        }
    }

    /// Checks that one of the runtimes loads the networks and that they fit the manifest.
    ///
    /// # Errors
    /// The refusal of the first runtime that could load them, else of the first one.
    pub fn check(runtimes: &[Self], manifest: &Manifest, files: &[(String, Vec<u8>)]) -> Result<(), NetworkError> {
        let mut refusal = None;
        for runtime in runtimes {
            match (runtime.model(manifest.clone(), files), &refusal) {
                (Ok(_), _) => return Ok(()),
                (Err(error), None | Some(NetworkError::Load { .. })) => refusal = Some(error),
                (Err(_), Some(_)) => {}
            }
        }
        refusal.map_or(Ok(()), Err)
    }

    /// Loads a model from the bytes of its files.
    ///
    /// # Errors
    /// Fails if a file is not a network, or has other tensors than the manifest says.
    pub fn model(&self, manifest: Manifest, files: &[(String, Vec<u8>)]) -> Result<Model, NetworkError> {
        let networks: Result<Vec<_>, _> = files.iter().map(|(file, bytes)| self.network(file, bytes)).collect();
        Model::new(manifest, networks?)
    }

    fn network(&self, file: &str, bytes: &[u8]) -> Result<Box<dyn Network>, NetworkError> {
        match self {
            Self::Rten => load_rten(file, bytes),
            Self::OnnxRuntime(runtime, _) => runtime.network(file, bytes),
        }
    }
}

/// `libonnxruntime.so.*` in the package folder of the Python that the shell finds, or of the active environment.
fn installed_by_pip() -> Option<PathBuf> {
    let prefixes = std::env::var_os("VIRTUAL_ENV").map(PathBuf::from).into_iter();
    let homes = std::env::var_os("HOME").map(|home| PathBuf::from(home).join(".local")).into_iter();
    let system = ["/usr/local", "/usr"].map(PathBuf::from);
    prefixes
        .chain(homes)
        .chain(system)
        .flat_map(|prefix| ["site-packages", "dist-packages"].map(|packages| (prefix.clone(), packages)))
        .find_map(|(prefix, packages)| {
            let pattern = prefix.join("lib/python3*").join(packages).join("onnxruntime/capi/libonnxruntime.so*");
            glob::glob(pattern.to_str()?).ok()?.flatten().next()
        })
}
