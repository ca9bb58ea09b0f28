//! `vergence models pull`: fetch a model from its publisher, by the `curl` that every system has.

use std::path::Path;
use std::process::{Command, ExitStatus};

use serde_json::json;

use crate::console::Console;
use crate::failure::Failure;
use crate::models::{
    KNOWN, Known, ModelStore, Runtime, RuntimeOptions, Speed, StoreOptions, digest, read_manifest, threads,
};
use crate::output::make_folder;

/// Fetches a model from its publisher's address; a broken download is taken up where it broke. The publishers serve no
/// digests: what came first is recorded and checked from then on. None of the addresses could be tried by us.
#[derive(Debug, clap::Args)]
pub struct Args {
    /// Which one: see `vergence models list`.
    name: String,
    /// I have read the licence, which forbids commercial use, and keep to it.
    #[arg(long)]
    accept_non_commercial: bool,
    /// A mirror of the publisher's file.
    #[arg(long, value_name = "URL")]
    from: Option<String>,
    /// Take nothing but a file with this digest.
    #[arg(long, value_name = "HEX")]
    sha256: Option<String>,
    #[command(flatten)]
    runtime: RuntimeOptions,
    #[command(flatten)]
    store: StoreOptions,
}

pub fn run(args: &Args, console: Console) -> Result<(), Failure> {
    let known = KNOWN.iter().find(|known| known.name == args.name).ok_or_else(|| {
        Failure::usage(format!("nobody is known to offer '{}': see 'vergence models list'", args.name))
    })?;
    let Some(published) = known.address else {
        return Err(Failure::usage(format!("{}: {}", known.name, known.about)));
    };
    if known.non_commercial && !args.accept_non_commercial {
        return Err(Failure::usage(format!(
            "{} is licensed '{}': read it, and say --accept-non-commercial if you keep to it",
            known.name, known.licence
        )));
    }
    let store = ModelStore::open(&args.store)?;
    let downloads = store.path(".downloads");
    make_folder(&downloads)?;
    let file = published.rsplit('/').next().unwrap_or(published);
    fetch(args.from.as_deref().unwrap_or(published), &downloads.join(file), console)?;
    keep(args, known, &store, &downloads.join(file), console)
}

/// What curl says of a server that cannot take up a download where it broke.
const NO_RANGES: i32 = 33;

fn fetch(address: &str, to: &Path, console: Console) -> Result<(), Failure> {
    let mut status = curl(address, to, console)?;
    if status.code() == Some(NO_RANGES) {
        remove(to)?;
        status = curl(address, to, console)?;
    }
    if status.success() {
        return Ok(());
    }
    let kept = if to.is_file() { ": what came is kept, try again" } else { "" };
    Err(Failure::usage(format!("{address} could not be fetched (curl: {status}){kept}")))
}

fn curl(address: &str, to: &Path, console: Console) -> Result<ExitStatus, Failure> {
    let mut command = Command::new("curl");
    command.args(["--location", "--fail", "--retry", "3", "--continue-at", "-", "--output"]).arg(to);
    command.args(if console.is_json() { &["--silent", "--show-error"][..] } else { &["--progress-bar"] });
    command.arg(address).status().map_err(|error| {
        Failure::usage(format!("curl cannot be run ({error}): install it, or fetch {address} yourself and add it"))
    })
}

/// Keeps what was fetched if it is what it was the first time, and a network of the tensors that the model should have.
fn keep(args: &Args, known: &Known, store: &ModelStore, path: &Path, console: Console) -> Result<(), Failure> {
    let (Some(folder), Some(file)) = (path.parent(), path.file_name().and_then(|name| name.to_str())) else {
        return Err(Failure::usage(format!("{} is no name for a file", path.display())));
    };
    let manifest = known.manifest(&[file]).ok_or_else(|| Failure::check("one file is not enough for this model"))?;
    let bytes = std::fs::read(path).map_err(|error| Failure::input(path, error))?;
    let sha256 = digest(&bytes);
    let recorded = read_manifest(&store.path(known.name)).ok();
    let recorded = recorded.as_ref().and_then(|manifest| manifest.files().next()?.1);
    if let Some(expected) = args.sha256.as_deref().or(recorded).filter(|expected| *expected != sha256) {
        remove(path)?;
        return Err(Failure::check(format!(
            "what came has SHA-256 {sha256}, not {expected}: it is thrown away, and nothing was changed"
        )));
    }
    let runtimes = args.runtime.all()?;
    Runtime::check(&runtimes, &manifest, &[(file.to_owned(), bytes)])
        .map_err(|error| Failure::usage(format!("{error}; what came is in {}", path.display())))?;
    let kept = store.keep(manifest, folder)?;
    Speed::measure(&kept, &runtimes, threads())?;
    remove(path)?;
    console.say(format!("{} is kept in {}; SHA-256 {sha256}, recorded now", known.name, kept.display()))?;
    console.result(&json!({ "name": known.name, "folder": kept, "sha256": sha256 }))
}

fn remove(path: &Path) -> Result<(), Failure> {
    std::fs::remove_file(path).map_err(|error| Failure::output(path, error))
}
