//! `vergence models`: networks for matching.

use std::path::PathBuf;

use serde_json::json;
use vergence_models::{KNOWN, Pull, add, read_manifest, verify};

use super::model_options::{RuntimeOptions, StoreOptions};
use crate::console::Console;
use crate::failure::Failure;
use crate::stopwatch::clock;

/// Keeps pre-trained networks of the LightGlue family for matching. None comes with this program: add files that you
/// have, or pull what their publishers offer.
#[derive(Debug, clap::Args)]
pub struct Args {
    #[command(subcommand)]
    verb: Verb,
}

#[derive(Debug, clap::Subcommand)]
enum Verb {
    /// Lists the models that are kept, and those that could be.
    List(ListArgs),
    /// Keeps a model: a folder with model.toml, or with networks whose tensors are known.
    Add(AddArgs),
    /// Checks the digests and tensors of every model that is kept, and runs it once.
    Verify(VerifyArgs),
    /// Fetches a model from its publisher.
    Pull(PullArgs),
}

#[derive(Debug, clap::Args)]
struct ListArgs {
    #[command(flatten)]
    store: StoreOptions,
}

/// Checks that the networks have the tensors they should, keeps copies of them, and times them on every runtime of this
/// machine.
#[derive(Debug, clap::Args)]
struct AddArgs {
    /// A folder with model.toml and the files it names, or with ONNX files of a known model; or one ONNX file.
    #[arg(value_name = "DIR|FILE")]
    source: PathBuf,
    /// The name to keep it under, instead of the name in its manifest.
    #[arg(long)]
    name: Option<String>,
    #[command(flatten)]
    runtime: RuntimeOptions,
    #[command(flatten)]
    store: StoreOptions,
}

/// Reads every model, checks digests and tensors, and runs it on a drawn pattern on every runtime of this machine. The
/// times are kept beside the model: the faster runtime serves from then on.
#[derive(Debug, clap::Args)]
struct VerifyArgs {
    #[command(flatten)]
    runtime: RuntimeOptions,
    #[command(flatten)]
    store: StoreOptions,
}

/// Fetches a model from its publisher's address; an interrupted download continues where it stopped. The publishers serve
/// no digests: the digest of the first download is recorded and checked from then on. The addresses are untested.
#[derive(Debug, clap::Args)]
struct PullArgs {
    /// Its name in `vergence models list`.
    name: String,
    /// Confirms that you have read the licence, which forbids commercial use, and keep to it.
    #[arg(long)]
    accept_non_commercial: bool,
    /// A mirror of the publisher's file.
    #[arg(long, value_name = "URL")]
    from: Option<String>,
    /// The digest that the file must have.
    #[arg(long, value_name = "HEX")]
    sha256: Option<String>,
    #[command(flatten)]
    runtime: RuntimeOptions,
    #[command(flatten)]
    store: StoreOptions,
}

pub fn run(args: &Args, console: Console) -> Result<(), Failure> {
    match &args.verb {
        Verb::List(args) => list(args, console),
        Verb::Add(args) => keep(args, console),
        Verb::Verify(args) => check(args, console),
        Verb::Pull(args) => pull(args, console),
    }
}

fn list(args: &ListArgs, console: Console) -> Result<(), Failure> {
    let store = args.store.store()?;
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
        let how = if known.address.is_some() { "can be pulled, untested" } else { "add it from files" };
        console.say(format!("  {}  {} ({}; {how})", known.name, known.about, known.licence))?;
    }
    let known: Vec<_> = KNOWN
        .iter()
        .map(|known| json!({ "name": known.name, "licence": known.licence, "address": known.address }))
        .collect();
    console.result(&json!({ "folder": store.folder(), "kept": kept, "known": known }))
}

fn keep(args: &AddArgs, console: Console) -> Result<(), Failure> {
    let store = args.store.store()?;
    let work = console.progress(&format!("{}", args.source.display()));
    let added = add(&store, &args.source, args.name.as_deref(), &args.runtime.all()?, clock)?;
    work.finish_and_clear();
    console.say(format!(
        "{} is kept in {}: use it with --matcher {}",
        added.name,
        added.folder.display(),
        added.name
    ))?;
    console.result(&json!({ "name": added.name, "folder": added.folder }))
}

fn check(args: &VerifyArgs, console: Console) -> Result<(), Failure> {
    let store = args.store.store()?;
    let runtimes = args.runtime.all()?;
    let mut results = Vec::new();
    let mut failed = false;
    for name in store.names()? {
        for verdict in verify(&store, &name, &runtimes, clock)? {
            let message = verdict.in_words();
            console.say(format!("{name} on {}: {message}", verdict.runtime))?;
            failed |= verdict.matches.is_err();
            results.push(json!({
                "name": name, "runtime": verdict.runtime, "ok": verdict.matches.is_ok(), "message": message,
                "seconds": verdict.seconds,
            }));
        }
    }
    console.result(&json!({ "models": results }))?;
    if failed { Err(Failure::check("a model is not what it should be")) } else { Ok(()) }
}

fn pull(args: &PullArgs, console: Console) -> Result<(), Failure> {
    let pull =
        Pull::of(&args.name, args.accept_non_commercial)?.from(args.from.as_deref()).expecting(args.sha256.as_deref());
    let store = args.store.store()?;
    let bar = console.count_bar(&args.name, 100);
    let file = pull.fetch(&store, &mut |part| bar.set_position((100.0 * part) as u64))?;
    bar.finish_and_clear();
    let pulled = pull.keep(&store, &file, &args.runtime.all()?, clock)?;
    let folder = pulled.folder.display();
    console.say(format!("{} is kept in {folder}; SHA-256 {}, now on record", pulled.name, pulled.sha256))?;
    console.result(&json!({ "name": pulled.name, "folder": pulled.folder, "sha256": pulled.sha256 }))
}
