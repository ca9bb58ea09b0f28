//! `vergence models add`: keep files that the user has.

use std::path::{Path, PathBuf};

use serde_json::json;
use vergence_matching::learned::Manifest;

use crate::console::Console;
use crate::failure::Failure;
use crate::models::{
    MODEL_FILE, ModelStore, Runtime, RuntimeOptions, Speed, StoreOptions, manifest_for, read_manifest, threads,
};

/// Checks that the networks have the tensors they should, keeps copies of them, and times them on every runtime there is.
#[derive(Debug, clap::Args)]
pub struct Args {
    /// A folder with model.toml and the files it names, or with ONNX files of a known model; or one ONNX file.
    #[arg(value_name = "DIR|FILE")]
    source: PathBuf,
    /// What to call it, instead of the name in its manifest.
    #[arg(long)]
    name: Option<String>,
    #[command(flatten)]
    runtime: RuntimeOptions,
    #[command(flatten)]
    store: StoreOptions,
}

pub fn run(args: &Args, console: Console) -> Result<(), Failure> {
    let store = ModelStore::open(&args.store)?;
    let work = console.progress(&format!("{}", args.source.display()));
    let runtimes = args.runtime.all()?;
    let (folder, mut manifest) = manifest(&args.source, &runtimes)?;
    if let Some(name) = &args.name {
        manifest.name.clone_from(name);
    }
    let files = read(&folder, manifest.files().map(|(file, _)| file))?;
    Runtime::check(&runtimes, &manifest, &files).map_err(|error| Failure::usage(error.to_string()))?;
    let kept = store.keep(manifest.clone(), &folder)?;
    Speed::measure(&kept, &runtimes, threads())?;
    work.finish_and_clear();
    console.say(format!("{} is kept in {}: use it with --matcher {}", manifest.name, kept.display(), manifest.name))?;
    console.result(&json!({ "name": manifest.name, "folder": kept }))
}

/// The folder of the files and what they are.
fn manifest(source: &Path, runtimes: &[Runtime]) -> Result<(PathBuf, Manifest), Failure> {
    if source.is_file() {
        let folder = source.parent().filter(|folder| !folder.as_os_str().is_empty()).unwrap_or(Path::new("."));
        let file = source.file_name().unwrap_or_default().to_string_lossy().into_owned();
        let files = read(folder, [file.as_str()].into_iter())?;
        let manifest = manifest_for(&files, runtimes).map_err(|reason| Failure::input(source, reason))?;
        return Ok((folder.to_owned(), manifest));
    }
    if source.join(MODEL_FILE).is_file() {
        return Ok((source.to_owned(), read_manifest(source)?));
    }
    let entries = std::fs::read_dir(source).map_err(|error| Failure::input(source, error))?;
    let mut names: Vec<String> =
        entries.flatten().map(|entry| entry.file_name().to_string_lossy().into_owned()).collect();
    names.retain(|name| Path::new(name).extension().is_some_and(|extension| extension == "onnx"));
    names.sort();
    let files = read(source, names.iter().map(String::as_str))?;
    let manifest = manifest_for(&files, runtimes).map_err(|reason| Failure::input(source, reason))?;
    Ok((source.to_owned(), manifest))
}

fn read<'a>(folder: &Path, names: impl Iterator<Item = &'a str>) -> Result<Vec<(String, Vec<u8>)>, Failure> {
    names
        .map(|name| {
            let path = folder.join(name);
            let bytes = std::fs::read(&path).map_err(|error| Failure::input(&path, error))?;
            Ok((name.to_owned(), bytes))
        })
        .collect()
}
