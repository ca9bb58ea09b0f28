//! `vergence models pull`: fetch a model from its publisher, by the `curl` that every system has.

use std::path::Path;
use std::process::Command;

use serde_json::json;

use crate::console::Console;
use crate::failure::Failure;
use crate::models::{KNOWN, Known, ModelStore, StoreOptions, digest};
use crate::output::make_folder;

/// Fetches a model from its publisher's address; a broken download is taken up where it broke. The publishers serve no
/// digests: what came first is recorded and checked from then on. No download could be tried by us.
#[derive(Debug, clap::Args)]
pub struct Args {
    /// Which one: see `vergence models list`.
    name: String,
    /// I have read the licence, which forbids commercial use, and keep to it.
    #[arg(long)]
    accept_non_commercial: bool,
    #[command(flatten)]
    store: StoreOptions,
}

pub fn run(args: &Args, console: Console) -> Result<(), Failure> {
    let known = KNOWN.iter().find(|known| known.name == args.name).ok_or_else(|| {
        Failure::usage(format!("nobody is known to offer '{}': see 'vergence models list'", args.name))
    })?;
    let Some(address) = known.address else {
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
    let file = address.rsplit('/').next().unwrap_or(address);
    fetch(address, &downloads.join(file), console)?;
    keep(known, &store, &downloads, file, console)
}

fn fetch(address: &str, to: &Path, console: Console) -> Result<(), Failure> {
    let mut command = Command::new("curl");
    command.args(["--location", "--fail", "--retry", "3", "--continue-at", "-", "--output"]).arg(to);
    command.arg(if console.is_json() { "--silent" } else { "--progress-bar" });
    let status = command.arg(address).status().map_err(|error| {
        Failure::usage(format!("curl cannot be run ({error}): install it, or fetch {address} yourself and add it"))
    })?;
    if status.success() {
        return Ok(());
    }
    Err(Failure::usage(format!("{address} could not be fetched (curl: {status}): what came is kept, try again")))
}

fn keep(known: &Known, store: &ModelStore, from: &Path, file: &str, console: Console) -> Result<(), Failure> {
    let manifest = known.manifest(&[file]).ok_or_else(|| Failure::check("one file is not enough for this model"))?;
    let path = from.join(file);
    let bytes = std::fs::read(&path).map_err(|error| Failure::input(&path, error))?;
    let folder = store.keep(manifest, from)?;
    let sha256 = digest(&bytes);
    console.say(format!("{} is kept in {}; SHA-256 {sha256}, recorded now", known.name, folder.display()))?;
    std::fs::remove_file(&path).map_err(|error| Failure::output(&path, error))?;
    console.result(&json!({ "name": known.name, "folder": folder, "sha256": sha256 }))
}
