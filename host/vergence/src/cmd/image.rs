//! `vergence image`: makes keys, signs firmware images, and prints what an image holds.

use std::path::{Path, PathBuf};

use serde_json::json;
use vergence_board::{hardware_name, version_text};
use vergence_files::write_whole;
use vergence_image::notes::version_of;
use vergence_image::{is_signed_by, sha256};
use vergence_protocol::management::ImageHeader;

use crate::console::Console;
use crate::failure::Failure;
use crate::firmware::{
    DEVELOPMENT, Hardware, PublicKey, SecretKey, build_of, flatten, fresh_secret, header_json, hex, parse_version,
    read_image,
};

/// Makes keys, signs firmware images and prints what an image holds. Boards take signed images only: see docs/flashing.md.
#[derive(Debug, clap::Args)]
pub struct Args {
    #[command(subcommand)]
    task: Task,
}

#[derive(Debug, clap::Subcommand)]
enum Task {
    /// Makes a new pair of keys: FILE, which signs and must stay secret, and FILE.pub, which boards trust.
    Keygen(KeygenArgs),
    /// Makes a signed image of an ELF file, or of the raw bytes for flash.
    Sign(SignArgs),
    /// Prints what an image holds, and whether its signature is valid. Exit code 1 where it is not.
    Info(InfoArgs),
}

pub fn run(args: &Args, console: Console) -> Result<(), Failure> {
    match &args.task {
        Task::Keygen(args) => keygen(args, console),
        Task::Sign(args) => sign(args, console),
        Task::Info(args) => info(args, console),
    }
}

#[derive(Debug, clap::Args)]
struct KeygenArgs {
    /// The file for the secret key; a file that exists is never overwritten.
    #[arg(long, value_name = "FILE")]
    out: PathBuf,
}

fn keygen(args: &KeygenArgs, console: Console) -> Result<(), Failure> {
    let secret = fresh_secret()?;
    let mut name = args.out.clone().into_os_string();
    name.push(".pub");
    let public_file = PathBuf::from(name);
    secret.write_new(&args.out)?;
    secret.public().write(&public_file)?;
    console.say(format!(
        "secret key {}: keep it to yourself\npublic key {}: what boards trust",
        args.out.display(),
        public_file.display()
    ))?;
    console.result(&json!({
        "secret": args.out, "public": public_file, "public_key": hex(&secret.public().0),
    }))
}

#[derive(Debug, clap::Args)]
struct SignArgs {
    /// The application: an ELF file, or the raw bytes for flash.
    file: PathBuf,
    /// The secret key: a file of 'image keygen', or 'development' for the one that everybody knows.
    #[arg(long, value_name = "FILE")]
    key: PathBuf,
    /// The version, such as 1.2.3, where the application does not name its own; where it does, both must be equal.
    #[arg(long, value_parser = parse_version)]
    version: Option<[u8; 3]>,
    /// The board it is for.
    #[arg(long)]
    hardware: Hardware,
    /// The file for the image.
    #[arg(long, value_name = "FILE")]
    out: PathBuf,
}

fn sign(args: &SignArgs, console: Console) -> Result<(), Failure> {
    let key = SecretKey::named(&args.key)?;
    let file = std::fs::read(&args.file).map_err(|error| Failure::input(&args.file, error))?;
    let image = flatten(&file, args.hardware).map_err(|problem| Failure::input(&args.file, problem))?;
    let header = ImageHeader {
        hardware: args.hardware.id(),
        version: version(args, version_of(&image))?,
        length: image.len() as u32,
        build: build_of(&image),
        sha256: sha256(&image),
    };
    write_whole(&args.out, &[&key.seal(header).to_bytes()[..], &image].concat())?;
    console.say(format!(
        "{}: version {} for {}, {} bytes, build {:016x}",
        args.out.display(),
        version_text(header.version),
        hardware_name(header.hardware),
        header.length,
        header.build
    ))?;
    console.result(&header_json(&header))
}

/// A header that named another version than the application itself would let the board take what it must refuse.
fn version(args: &SignArgs, said: Option<[u8; 3]>) -> Result<[u8; 3], Failure> {
    match (args.version, said) {
        (Some(named), Some(said)) if named != said => Err(Failure::input(
            &args.file,
            format!("the application says that it is version {}, not {}", version_text(said), version_text(named)),
        )),
        (named, said) => said.or(named).ok_or_else(|| {
            Failure::input(&args.file, "the application does not say which version it is: name it with --version")
        }),
    }
}

#[derive(Debug, clap::Args)]
struct InfoArgs {
    /// The image.
    file: PathBuf,
    /// The public key that should have signed it; without one, the development key, whose secret everybody knows.
    #[arg(long, value_name = "FILE", default_value = DEVELOPMENT)]
    key: PathBuf,
}

fn info(args: &InfoArgs, console: Console) -> Result<(), Failure> {
    let PublicKey(key) = PublicKey::named(&args.key)?;
    let image = read_image(&args.file)?;
    let header = image.header();
    let is_valid = is_signed_by(&key, &header.signed_bytes(), &image.seal.signature);
    console.say(format!("hardware   {}", hardware_name(header.hardware)))?;
    console.say(format!("version    {}", version_text(header.version)))?;
    console.say(format!("length     {} bytes", header.length))?;
    console.say(format!("build      {:016x}", header.build))?;
    console.say(format!("sha256     {}", hex(&header.sha256)))?;
    console.say(format!("signature  {}", judgement(is_valid, &args.key)))?;
    let mut said = header_json(header);
    said["key"] = hex(&key).into();
    said["signature_valid"] = is_valid.into();
    console.result(&said)?;
    if is_valid {
        return Ok(());
    }
    Err(Failure::check(format!("{}: not signed by the key {}", args.file.display(), args.key.display())))
}

fn judgement(is_valid: bool, key: &Path) -> String {
    match (is_valid, key.as_os_str() == DEVELOPMENT) {
        (true, true) => "valid, by the development key: anybody can sign so".into(),
        (true, false) => format!("valid, by {}", key.display()),
        (false, _) => "not valid; another key is named with --key FILE.pub".into(),
    }
}
