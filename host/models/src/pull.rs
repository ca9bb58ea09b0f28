//! Fetches a model from its publisher, by the `curl` that every system has.

use std::io::{BufRead, BufReader};
use std::path::{Path, PathBuf};
use std::process::{Command, ExitStatus, Stdio};

use crate::Clock;
use crate::error::ModelsError;
use crate::files::{digest, make_folder, read, remove};
use crate::known::{KNOWN, Known};
use crate::runtime::{Runtime, threads};
use crate::speed::Speed;
use crate::store::{ModelStore, read_manifest};

/// A download that was asked for.
#[derive(Clone, Copy, Debug)]
pub struct Pull<'a> {
    known: &'static Known,
    published: &'static str,
    from: Option<&'a str>,
    sha256: Option<&'a str>,
}

/// A model that was fetched and kept.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Pulled {
    /// Name of the model.
    pub name: &'static str,
    /// Folder of the model in the store.
    pub folder: PathBuf,
    /// SHA-256 of the file in hexadecimal, on record from now on.
    pub sha256: String,
}

impl<'a> Pull<'a> {
    /// The model that is known as `name`.
    ///
    /// # Errors
    /// Where nobody offers it, or where its licence forbids commercial use and `accept_non_commercial` is not set.
    pub fn of(name: &str, accept_non_commercial: bool) -> Result<Self, ModelsError> {
        let known =
            KNOWN.iter().find(|known| known.name == name).ok_or_else(|| ModelsError::Unknown(name.to_owned()))?;
        let published = known.address.ok_or(ModelsError::NotOffered { name: known.name, about: known.about })?;
        if known.non_commercial && !accept_non_commercial {
            return Err(ModelsError::NonCommercial { name: known.name, licence: known.licence });
        }
        Ok(Self { known, published, from: None, sha256: None })
    }

    /// Fetches from this mirror in place of the publisher's address.
    #[must_use]
    pub fn from(self, mirror: Option<&'a str>) -> Self {
        Self { from: mirror, ..self }
    }

    /// Accepts only a file with this SHA-256, in hexadecimal.
    #[must_use]
    pub fn expecting(self, sha256: Option<&'a str>) -> Self {
        Self { sha256, ..self }
    }

    /// Fetches the file into the store's folder `.downloads`; an interrupted download continues where it stopped.
    /// `progress` gets the part that has come, 0 to 1. Returns the path of the file.
    ///
    /// # Errors
    /// Fails if curl is missing or fails.
    pub fn fetch(&self, store: &ModelStore, progress: &mut dyn FnMut(f64)) -> Result<PathBuf, ModelsError> {
        let downloads = store.path(".downloads");
        make_folder(&downloads)?;
        let to = downloads.join(self.published.rsplit('/').next().unwrap_or(self.published));
        let address = self.from.unwrap_or(self.published);
        let (mut status, mut reason) = curl(address, &to, progress)?;
        if status.code() == Some(NO_RANGES) {
            remove(&to)?;
            (status, reason) = curl(address, &to, progress)?;
        }
        if status.success() {
            return Ok(to);
        }
        Err(ModelsError::Fetch { address: address.to_owned(), reason, partial: to.is_file() })
    }

    /// Keeps the `file` that was fetched, if it has the digest it had the first time and the tensors it should have, and
    /// times it on every runtime.
    ///
    /// # Errors
    /// Fails if it is another file, or cannot be kept.
    pub fn keep(
        &self,
        store: &ModelStore,
        file: &Path,
        runtimes: &[Runtime],
        clock: Clock,
    ) -> Result<Pulled, ModelsError> {
        let name = self.known.name;
        let (Some(folder), Some(file_name)) = (file.parent(), file.file_name().and_then(|name| name.to_str())) else {
            return Err(ModelsError::Name(file.display().to_string()));
        };
        let manifest = self.known.manifest(&[file_name]);
        let manifest = manifest.ok_or(ModelsError::NotOffered { name, about: self.known.about })?;
        let bytes = read(file)?;
        let sha256 = digest(&bytes);
        let recorded = read_manifest(&store.path(name)).ok();
        let recorded = recorded.as_ref().and_then(|manifest| manifest.files().next()?.1);
        if let Some(expected) = self.sha256.or(recorded).filter(|expected| *expected != sha256) {
            remove(file)?;
            return Err(ModelsError::DownloadDigest { expected: expected.to_owned(), found: sha256 });
        }
        Runtime::check(runtimes, &manifest, &[(file_name.to_owned(), bytes)])
            .map_err(|reason| ModelsError::DownloadNetwork { reason, path: file.to_owned() })?;
        let folder = store.keep(manifest, folder)?;
        Speed::measure(&folder, runtimes, threads(), clock)?;
        remove(file)?;
        Ok(Pulled { name, folder, sha256 })
    }
}

/// Exit code of curl where the server cannot continue an interrupted download.
const NO_RANGES: i32 = 33;

/// Runs curl; returns its exit status and its last message.
fn curl(address: &str, to: &Path, progress: &mut dyn FnMut(f64)) -> Result<(ExitStatus, String), ModelsError> {
    let failed = |error: std::io::Error| ModelsError::Curl { reason: error.to_string(), address: address.to_owned() };
    let mut child = Command::new("curl")
        .args(["--location", "--fail", "--retry", "3", "--continue-at", "-", "--progress-bar", "--output"])
        .arg(to)
        .arg(address)
        .stderr(Stdio::piped())
        .spawn()
        .map_err(failed)?;
    let mut message = String::new();
    if let Some(stderr) = child.stderr.take() {
        // The bar is drawn anew after each carriage return and ends in a percentage; messages begin with 'curl:'.
        for drawn in BufReader::new(stderr).split(b'\r').map_while(Result::ok) {
            for line in String::from_utf8_lossy(&drawn).lines() {
                let percent =
                    line.strip_suffix('%').and_then(|line| line.rsplit([' ', '#']).next()?.parse::<f64>().ok());
                if let Some(percent) = percent {
                    progress(percent / 100.0);
                } else if line.starts_with("curl:") {
                    line.clone_into(&mut message);
                }
            }
        }
    }
    let status = child.wait().map_err(failed)?;
    Ok((status, if message.is_empty() { format!("curl: {status}") } else { message }))
}
