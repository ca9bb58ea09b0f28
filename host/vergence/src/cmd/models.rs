//! `vergence models`: networks for matching.

mod add;
mod pull;
mod verify;

use serde_json::json;

use crate::console::Console;
use crate::failure::Failure;
use crate::models::{KNOWN, ModelStore, StoreOptions, read_manifest};

/// Keeps pre-trained networks of the LightGlue family for matching. None comes with this program: add files that you
/// have, or pull what their publishers offer.
#[derive(Debug, clap::Args)]
pub struct Args {
    #[command(subcommand)]
    verb: Verb,
}

#[derive(Debug, clap::Subcommand)]
enum Verb {
    /// List the models that are kept, and those that could be.
    List(ListArgs),
    /// Keep a model: a folder with model.toml, or with networks whose tensors are known.
    Add(add::Args),
    /// Check the digests and tensors of every model that is kept, and run it once.
    Verify(verify::Args),
    /// Fetch a model from its publisher.
    Pull(pull::Args),
}

#[derive(Debug, clap::Args)]
struct ListArgs {
    #[command(flatten)]
    store: StoreOptions,
}

pub fn run(args: &Args, console: Console) -> Result<(), Failure> {
    match &args.verb {
        Verb::List(args) => list(args, console),
        Verb::Add(args) => add::run(args, console),
        Verb::Verify(args) => verify::run(args, console),
        Verb::Pull(args) => pull::run(args, console),
    }
}

fn list(args: &ListArgs, console: Console) -> Result<(), Failure> {
    let store = ModelStore::open(&args.store)?;
    let mut kept = Vec::new();
    console.say(format!("in {}:", store.folder().display()))?;
    for name in store.names()? {
        let manifest = read_manifest(&store.path(&name))?;
        let files: Vec<&str> = manifest.files().map(|(file, _)| file).collect();
        console.say(format!("  {name}  ({}; {})", manifest.licence, files.join(", ")))?;
        kept.push(json!({ "name": name, "licence": manifest.licence, "files": files }));
    }
    if kept.is_empty() {
        console.say("  none: the classical matcher serves")?;
    }
    console.say("known:")?;
    for known in KNOWN {
        let how = if known.address.is_some() { "can be pulled, not tried by us" } else { "add it from files" };
        console.say(format!("  {}  {} ({}; {how})", known.name, known.about, known.licence))?;
    }
    let known: Vec<_> = KNOWN
        .iter()
        .map(|known| json!({ "name": known.name, "licence": known.licence, "address": known.address }))
        .collect();
    console.result(&json!({ "folder": store.folder(), "kept": kept, "known": known }))
}
