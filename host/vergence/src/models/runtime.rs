//! Which program runs the networks, and where ONNX Runtime is.

use std::path::PathBuf;

use vergence_matching::learned::{Manifest, Model, Network, NetworkError};
use vergence_networks::{OnnxRuntime, load_rten};

/// What runs networks.
pub enum Runtime {
    /// Pure Rust, always there.
    Rten,
    /// Microsoft's library, from this file.
    OnnxRuntime(OnnxRuntime, PathBuf),
}

impl Runtime {
    /// The library named on the command line or by ORT_DYLIB_PATH, which must then work; else one that pip installed;
    /// else rten.
    ///
    /// # Errors
    /// Where the library that was named cannot be loaded.
    pub fn find(named: Option<PathBuf>, threads: usize) -> Result<Self, NetworkError> {
        if let Some(library) = named {
            return Ok(Self::OnnxRuntime(OnnxRuntime::load(&library, threads)?, library));
        }
        Ok(match installed_by_pip() {
            Some(library) => match OnnxRuntime::load(&library, threads) {
                Ok(runtime) => Self::OnnxRuntime(runtime, library),
                Err(_) => Self::Rten,
            },
            None => Self::Rten,
        })
    }

    /// Its name.
    #[must_use]
    pub fn name(&self) -> &'static str {
        match self {
            Self::Rten => "rten",
            Self::OnnxRuntime(..) => "ONNX Runtime",
        }
    }

    /// Loads a model from the bytes of its files.
    ///
    /// # Errors
    /// Where a file is no network, or has other tensors than the manifest says.
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
    let mut found: Vec<PathBuf> = prefixes
        .chain(homes)
        .chain(system)
        .flat_map(|prefix| ["site-packages", "dist-packages"].map(|packages| (prefix.clone(), packages)))
        .filter_map(|(prefix, packages)| {
            let pattern = prefix.join("lib/python3*").join(packages).join("onnxruntime/capi/libonnxruntime.so*");
            glob::glob(pattern.to_str()?).ok()?.flatten().next()
        })
        .collect();
    found.truncate(1);
    found.pop()
}
